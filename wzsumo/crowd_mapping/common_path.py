"""CommonPath: the course that all traces share, up to lanes and levels of their own, and the size of what they do not share.

A trace's offset at a station is modelled as  y = c(s) + w h(s) + b + e(s):  common course c, lane h of width w, level b of
the trace (its GNSS bias, its driver's habit and the lane it started in), remainder e that drifts and scatters.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solveh_banded

from wzsumo.crowd_mapping.lane_changes import relative_lanes
from wzsumo.frames import FloatArray

TEMPLATES, REFINED = 8, 3  # traces tried as the first guess of the course, and the best of them
COMPARED_TRACES = 40  # traces by which guesses are compared
ROUNDS = 4  # of lanes and course in turn; changes vanish after two or three
# Laplace scale of the course's second difference over 10 m: a line of MUTCD tapers has a kink of 1:60 to 1:10 (0.17 to 1 m)
# every few hundred metres and none between.
KINK_SCALE_M = 0.02
REWEIGHTINGS = 12
SETTLED_M = 5e-4
LEAST_NOISE_M = 0.05  # of a station's mean: vehicles wander by this within seconds even where simulated ones do not
LEAST_DRIFT = 0.15  # of the noise, per station; wzsumo.sensing.gnss at 25 m/s has 0.2
FIRST_DRIFT_M, FIRST_NOISE_M = 0.08, 0.25  # per 10 m and per station, until they are estimated


@dataclass(frozen=True, kw_only=True, eq=False)
class CommonPath:
    """`course` (stations,) [m], zero on average; `lanes` (traces, stations) from each trace's first; `levels` (traces,) [m].

    `drift_m` is the standard deviation of a trace's drift from station to station, `noise_m` that of its scatter.
    """

    course: FloatArray
    lanes: FloatArray
    levels: FloatArray
    drift_m: float
    noise_m: float
    cost: float


def fit_common_path(offsets: FloatArray, *, width: float, weights: FloatArray) -> CommonPath:
    """The common path of offsets (traces, stations) [m], NaN where unknown, for lanes of a width [m].

    Every trace is a guess of the course (of many, some): what most traces share is the course, what few do is a lane change.
    """
    some = np.unique(np.linspace(0, len(offsets) - 1, COMPARED_TRACES).astype(int))
    guesses = np.unique(np.linspace(0, len(offsets) - 1, TEMPLATES).astype(int))
    tries = [_from_guess(offsets[some], _filled(offsets[i]), width=width, weights=weights[some]) for i in guesses]
    tries = sorted(tries, key=_unlikely)[:REFINED]
    path = min((_refined(path, offsets[some], width=width, weights=weights[some]) for path in tries), key=_unlikely)
    for _ in range(ROUNDS):
        lanes, cost = _labelled(offsets, path.course, width, path.drift_m, path.noise_m)
        same = np.array_equal(lanes, path.lanes)
        path = _refit(offsets, lanes, width=width, weights=weights, cost=cost)
        if same:
            break
    return path


def extend(path: CommonPath, offsets: FloatArray, lanes: FloatArray, *, width: float, weights: FloatArray) -> CommonPath:
    """The path for more (or other) traces of known lanes: one round of levels and course, sizes as they were."""
    known = np.isfinite(offsets)
    rest = np.where(known, offsets - width * lanes, 0.0)
    levels = (known * (rest - path.course)).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    miss = rest - path.course - levels[:, None]
    w = weights[:, None] * known * np.minimum(1.0, 3 * path.noise_m / np.maximum(np.abs(miss), 1e-9))
    total = w.sum(axis=0)
    moved = np.where(total > 0, (w * miss).sum(axis=0) / np.maximum(total, 1e-12), 0.0)
    course = trend_filter(path.course + moved, total / path.noise_m**2, scale=KINK_SCALE_M)
    middle = float(course.mean())
    return replace(path, course=course - middle, lanes=lanes, levels=levels + middle)


def trend_filter(values: FloatArray, precisions: FloatArray, *, scale: float) -> FloatArray:
    """Piecewise linear course (n,) through values (n,) with precisions (n,), 0 where unknown.

    Minimises  sum precision (value - c)^2 / 2 + sum |second difference of c| / scale  by reweighted least squares
    (Kim, Koh, Boyd and Gorinevsky 2009, "l1 trend filtering").
    """
    n = len(values)
    if n < 3 or not precisions.any():
        return np.array(values, dtype=float)
    filled = np.where(precisions > 0, values, 0.0)
    curvature_weight = np.full(n - 2, 1 / scale**2)
    course = filled
    for _ in range(REWEIGHTINGS):
        bands = np.zeros((3, n))  # upper bands of diag(precisions) + D' diag(curvature_weight) D
        bands[2] = precisions + 1e-9
        for i, a in enumerate((1.0, -2.0, 1.0)):
            for j, b in enumerate((1.0, -2.0, 1.0)):
                if j >= i:
                    bands[2 - (j - i), j : n - 2 + j] += a * b * curvature_weight
        before, course = course, solveh_banded(bands, precisions * filled)
        if np.abs(course - before).max() < SETTLED_M:
            break
        curvature_weight = 1 / (scale * np.maximum(np.abs(np.diff(course, 2)), 1e-4))
    return np.asarray(course)


def _from_guess(offsets: FloatArray, guess: FloatArray, *, width: float, weights: FloatArray) -> CommonPath:
    """A path from one guess of the course; its cost is counted with the same noise for all guesses."""
    lanes, _ = _labelled(offsets, guess, width, FIRST_DRIFT_M, FIRST_NOISE_M)
    path = _refit(offsets, lanes, width=width, weights=weights, cost=0.0)
    return _relabelled(offsets, path, 0.0, width=width, weights=weights)


def _refined(path: CommonPath, offsets: FloatArray, *, width: float, weights: FloatArray) -> CommonPath:
    """The path, or a cheaper one near it."""
    best = path
    for _ in range(2):
        # What most traces do beside the course may be the course's own doing: then the others need fewer changes.
        moved = _relabelled(offsets, best, width * np.median(best.lanes, axis=0), width=width, weights=weights)
        again = _relabelled(offsets, best, 0.0, width=width, weights=weights)
        best = min((best, again, moved), key=lambda path: path.cost)
    return best


def _relabelled(
    offsets: FloatArray, path: CommonPath, shift: FloatArray | float, *, width: float, weights: FloatArray
) -> CommonPath:
    lanes, cost = _labelled(offsets, path.course + shift, width, FIRST_DRIFT_M, FIRST_NOISE_M)
    return _refit(offsets, lanes, width=width, weights=weights, cost=cost)


def _labelled(offsets: FloatArray, course: FloatArray, width: float, drift: float, noise: float) -> tuple[FloatArray, float]:
    widths = np.full(offsets.shape[1], width)
    return relative_lanes(offsets - course, widths, drift_variance=drift**2, white_variance=noise**2)


def _refit(offsets: FloatArray, lanes: FloatArray, *, width: float, weights: FloatArray, cost: float) -> CommonPath:
    """Course, levels and sizes for given lanes, by means over traces and stations in turn."""
    known = np.isfinite(offsets)
    rest = np.where(known, offsets - width * lanes, 0.0)
    w = weights[:, None] * known
    levels = np.array([np.median(row[k]) for row, k in zip(rest, known, strict=True)])
    course = np.zeros(offsets.shape[1])
    huber = np.ones_like(w)
    for _ in range(10):
        total = (w * huber).sum(axis=0)
        course = np.where(total > 0, (w * huber * (rest - levels[:, None])).sum(axis=0) / np.maximum(total, 1e-12), np.nan)
        course = _filled(course)
        miss = rest - course
        levels = (huber * known * miss).sum(axis=1) / np.maximum((huber * known).sum(axis=1), 1e-12)
        residual = np.abs(miss - levels[:, None])
        scale = max(1.5 * float(np.median(residual[known])), LEAST_NOISE_M)
        huber = np.minimum(1.0, 2 * scale / np.maximum(residual, 1e-9))
    drift, noise = _sizes(np.where(known, rest - course - levels[:, None], np.nan))
    precisions = (w * huber).sum(axis=0) / max(noise, LEAST_NOISE_M) ** 2
    course = trend_filter(course, precisions, scale=KINK_SCALE_M)
    middle = float(course.mean())
    return CommonPath(course=course - middle, lanes=lanes, levels=levels + middle, drift_m=drift, noise_m=noise, cost=cost)


def _sizes(residuals: FloatArray) -> tuple[float, float]:
    """Drift per station and white noise [m] from the growth of the residuals' squared differences with distance.

    Half the mean square over l stations is noise^2 + l drift^2 / 2; medians keep unfinished lane changes out.
    """
    lags = np.array([1, 2, 4, 8, 16, 32])
    half_squares = []
    for lag in lags:
        gaps = residuals[:, lag:] - residuals[:, :-lag]
        gaps = gaps[np.isfinite(gaps)]
        # The median of a squared normal is 0.4549 of its mean.
        half_squares.append(np.median(gaps**2) / 0.4549 / 2 if gaps.size > 8 else np.nan)
    known = np.isfinite(half_squares)
    if known.sum() < 2:
        return FIRST_DRIFT_M, FIRST_NOISE_M
    slope, base = np.polyfit(lags[known], np.array(half_squares)[known], 1)
    noise = float(np.clip(np.sqrt(max(base, 0.0)), 0.12, 1.0))
    # Changes found by mistake take the drift away with them: it is not let fall below what errors of such a noise have.
    return float(np.clip(np.sqrt(max(2 * slope, 0.0)), LEAST_DRIFT * noise, 0.5)), noise


def _filled(row: FloatArray) -> FloatArray:
    known = np.isfinite(row)
    index = np.arange(len(row))
    return np.asarray(np.interp(index, index[known], row[known])) if known.any() else np.zeros(len(row))


def _unlikely(path: CommonPath) -> float:
    """Cost of a path. A guess that itself changes lanes makes all others change; among equals the calmest is likeliest.

    What the course moves sideways is small beside the cost of one lane change of one trace.
    """
    return path.cost + 0.1 * float(np.abs(np.diff(path.course)).sum())
