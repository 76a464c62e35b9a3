"""The common path of traces: guessed from single ones, then course, lanes and errors found from each other in turn."""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.course.common_path import KINK_SCALE_M, CommonPath, TraceErrors, lanes_along, without_bias_effect
from wzsumo.crowd_mapping.course.gnss_bias import estimate_bias_sd, offsets_from_bias, usual_bias_sd
from wzsumo.crowd_mapping.course.trend_filter import trend_filter
from wzsumo.frames import BoolArray, FloatArray

TEMPLATES, REFINED = 8, 3  # traces tried as the first guess of the course, and the best of them
COMPARED_TRACES = 40  # traces by which guesses are compared
ROUNDS = 4  # of lanes and course in turn; changes vanish after two or three
LEAST_NOISE_M = 0.05  # of a station's mean: vehicles wander by this within seconds even where simulated ones do not
LEAST_DRIFT = 0.15  # of the noise, per station; wzsumo.sensing.gnss at 25 m/s has 0.2
FIRST_DRIFT_M, FIRST_NOISE_M = 0.08, 0.25  # per 10 m and per station, until they are estimated


def fit_common_path(
    offsets: FloatArray, *, width: float, weights: FloatArray, bias_effect: FloatArray | None = None
) -> CommonPath:
    """The common path of offsets (traces, stations) [m], NaN where unknown, for lanes of a width [m].

    Every trace is a guess of the course (of many, some): what most traces share is the course, what few do is a lane change.
    """
    some = np.unique(np.linspace(0, len(offsets) - 1, COMPARED_TRACES).astype(int))
    guesses = np.unique(np.linspace(0, len(offsets) - 1, TEMPLATES).astype(int))
    usual_m = usual_bias_sd(offsets)
    first = TraceErrors(drift_m=FIRST_DRIFT_M, noise_m=FIRST_NOISE_M, bias_m=usual_m)
    traces = _Traces(offsets=offsets, weights=weights, width=width, bias_effect=bias_effect, usual_bias_m=usual_m)
    compared = replace(traces, offsets=offsets[some], weights=weights[some])
    tries = [_from_guess(compared, _filled(offsets[i]), first) for i in guesses]
    path = min((_refined(path, compared, first) for path in sorted(tries, key=_unlikely)[:REFINED]), key=_unlikely)
    for _ in range(ROUNDS):
        lanes, cost = _labelled(traces, path.course, path.errors)
        same = np.array_equal(lanes, path.lanes)
        path = _refit(traces, lanes, cost=cost)
        if same:
            break
    return path


@dataclass(frozen=True, kw_only=True, eq=False)
class _Traces:
    offsets: FloatArray
    weights: FloatArray
    width: float
    bias_effect: FloatArray | None
    usual_bias_m: float


def _from_guess(traces: _Traces, guess: FloatArray, errors: TraceErrors) -> CommonPath:
    """A path from one guess of the course; its cost is counted with the same errors for all guesses."""
    lanes, _ = _labelled(traces, guess, errors)
    return _relabelled(traces, _refit(traces, lanes, cost=0.0).course, errors)


def _refined(path: CommonPath, traces: _Traces, errors: TraceErrors) -> CommonPath:
    """The path, or a cheaper one near it."""
    best = path
    for _ in range(2):
        # What most traces do beside the course may be the course's own doing: then the others need fewer changes.
        moved = _relabelled(traces, best.course + traces.width * np.median(best.lanes, axis=0), errors)
        again = _relabelled(traces, best.course, errors)
        best = min((best, again, moved), key=lambda path: path.cost)
    return best


def _relabelled(traces: _Traces, course: FloatArray, errors: TraceErrors) -> CommonPath:
    lanes, cost = _labelled(traces, course, errors)
    return _refit(traces, lanes, cost=cost)


def _labelled(traces: _Traces, course: FloatArray, errors: TraceErrors) -> tuple[FloatArray, float]:
    return lanes_along(course, traces.offsets, width=traces.width, errors=errors, bias_effect=traces.bias_effect)


def _refit(traces: _Traces, lanes: FloatArray, *, cost: float) -> CommonPath:
    """Course, levels and errors for given lanes."""
    rest, bias_m = traces.offsets - traces.width * lanes, traces.usual_bias_m
    course, levels, certainty = _course_and_levels(rest, traces.weights)
    if traces.bias_effect is not None:
        miss = rest - course
        noise_m = _drift_and_noise(miss - levels[:, None])[1]
        bias_m = estimate_bias_sd(
            miss, traces.bias_effect, noise_m=noise_m, usual_m=traces.usual_bias_m, weights=traces.weights
        )
        rest = rest - offsets_from_bias(miss, traces.bias_effect, noise_m=noise_m, bias_m=bias_m)
        course, levels, certainty = _course_and_levels(rest, traces.weights)
    drift, noise = _drift_and_noise(rest - course - levels[:, None])
    course = trend_filter(course, certainty.sum(axis=0) / max(noise, LEAST_NOISE_M) ** 2, scale=KINK_SCALE_M)
    middle = float(course.mean())
    return CommonPath(
        course=course - middle, lanes=lanes, levels=levels + middle, bias_effect=traces.bias_effect, cost=cost,
        errors=TraceErrors(drift_m=drift, noise_m=noise, bias_m=bias_m),
    )  # fmt: skip


def _course_and_levels(rest: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Course (stations,), levels (traces,) [m] and how much each place counts, by robust means over either in turn."""
    known = np.isfinite(rest)
    values = np.where(known, rest, 0.0)
    w = weights[:, None] * known
    levels = np.array([np.median(row[k]) for row, k in zip(values, known, strict=True)])
    course = np.zeros(rest.shape[1])
    huber = np.ones_like(w)
    for _ in range(10):
        total = (w * huber).sum(axis=0)
        mean = (w * huber * (values - levels[:, None])).sum(axis=0) / np.maximum(total, 1e-12)
        course = _filled(np.where(total > 0, mean, np.nan))
        miss = values - course
        levels = (huber * known * miss).sum(axis=1) / np.maximum((huber * known).sum(axis=1), 1e-12)
        residual = np.abs(miss - levels[:, None])
        scale = max(1.5 * float(np.median(residual[known])), LEAST_NOISE_M)
        huber = np.minimum(1.0, 2 * scale / np.maximum(residual, 1e-9))
    return course, levels, w * huber


def _drift_and_noise(residuals: FloatArray) -> tuple[float, float]:
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


# Root mean square from a trace's lanes, of their width and of what is usual among the traces. Of 3,600 SUMO traces (seeds
# 101-105, errors of 0, 1 and 2 m) 9 are beyond both; the usual is 0.02 to 0.1 m, 0.3 m and 0.5 m.
FAR_SHARE, FAR_TIMES = 0.2, 3.0
MOST_ODD = 0.25  # share of the traces; where more seem to be, it is the lanes that are not understood
STRADDLING = "drove between lanes, half over a line, for most of its way"


def straddling_traces(path: CommonPath, offsets: FloatArray, *, width: float) -> BoolArray:
    """Which traces (n,) drove in no lane, by their offsets (n, stations) [m] and the lanes that the path has them in."""
    rest = without_bias_effect(offsets - width * path.lanes - path.course, errors=path.errors, bias_effect=path.bias_effect)
    apart = np.where(np.isfinite(rest), rest - path.levels[:, None], 0.0)
    far = np.sqrt((apart**2).sum(axis=1) / np.maximum(np.isfinite(rest).sum(axis=1), 1))
    odd = far > max(FAR_SHARE * width, FAR_TIMES * float(np.median(far)))
    return np.asarray(odd & (odd.mean() <= MOST_ODD))
