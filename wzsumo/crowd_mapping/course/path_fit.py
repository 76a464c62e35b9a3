"""The common path of traces: guessed from single ones, then course, lanes and errors found from each other in turn."""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.course.common_path import KINK_SCALE_M, CommonPath, TraceErrors, lanes_along, without_bias_effect
from wzsumo.crowd_mapping.course.gnss_bias import estimate_bias_sd, offsets_from_bias, usual_bias_sd
from wzsumo.crowd_mapping.course.trend_filter import trend_filter
from wzsumo.frames import BoolArray, FloatArray

N_GUESSES, N_REFINED = 8, 3  # traces tried as the first guess of the course, and the best of them that are refined; by us
N_COMPARED = 40  # traces by which guesses are compared; chosen by us
REFINEMENTS = 2
MAX_ROUNDS = 4  # of lanes and course in turn; they settle after two or three
INITIAL_DRIFT_M, INITIAL_NOISE_M = 0.08, 0.25  # from station to station, and at a station, until they are estimated; by us
NOISE_RANGE_M = (0.12, 1.0)  # within which the estimated noise is kept; chosen by us
# Bounds of the estimated drift. Lane changes found by mistake take drift away with them, so it stays above a share of the
# noise: wzsumo.sensing.gnss at 25 m/s has 0.2.
MIN_DRIFT_PER_NOISE, MAX_DRIFT_M = 0.15, 0.5
MIN_DIFFERENCES = 9  # of residuals at one distance, for an estimate from them
HUBER_ROUNDS = 10  # of levels and course in turn
HUBER_THRESHOLD_SDS = 2.0  # standard deviations from which a residual weighs less; chosen by us
SD_PER_MEDIAN = 1.5  # of the absolute value of normal residuals: 1 / 0.6745, rounded
MIN_SD_M = 0.05  # of the residuals: vehicles wander by as much within seconds, even where simulated ones do not
# Cost of a metre that the course moves to the side: little beside that of one lane change of one trace (CHANGE_COST).
COURSE_COST_PER_M = 0.1
# A trace straddles lane lines if its root mean square departure from its lanes exceeds both: a share of their width, and a
# multiple of the traces' median. Of 3,600 SUMO traces (errors of 0, 1 and 2 m) 9 exceed both; the medians are 0.02 to 0.1 m,
# 0.3 m and 0.5 m.
MIN_STRADDLING_SHARE, MIN_STRADDLING_RATIO = 0.2, 3.0
MAX_STRADDLING_TRACES = 0.25  # as a share; where more seem to straddle lines, it is the lanes that are not understood
STRADDLING = "drove between lanes, half over a line, for most of its way"


def fit_common_path(offsets: FloatArray, *, width: float, weights: FloatArray, bias_effect: FloatArray | None) -> CommonPath:
    """The common path of offsets (traces, stations) [m], NaN where unknown, for lanes of a width [m] and weights (traces,).

    Single traces are guesses of the course: what most traces share is the course, what few do is a lane change.
    """
    compared = np.unique(np.linspace(0, len(offsets) - 1, N_COMPARED).astype(int))
    guesses = np.unique(np.linspace(0, len(offsets) - 1, N_GUESSES).astype(int))
    usual_m = usual_bias_sd(offsets)
    initial = TraceErrors(drift_m=INITIAL_DRIFT_M, noise_m=INITIAL_NOISE_M, bias_m=usual_m)
    traces = _Traces(offsets=offsets, weights=weights, width=width, bias_effect=bias_effect, usual_bias_m=usual_m)
    some = replace(traces, offsets=offsets[compared], weights=weights[compared])
    paths = sorted((_path_from_guess(some, _interpolated(offsets[i]), initial) for i in guesses), key=_total_cost)
    path = min((_refined(path, some, initial) for path in paths[:N_REFINED]), key=_total_cost)
    for _ in range(MAX_ROUNDS):
        lanes, cost = _lanes_of(traces, path.course, path.errors)
        settled = np.array_equal(lanes, path.lanes)
        path = _path_for_lanes(traces, lanes, cost=cost)
        if settled:
            break
    return path


def straddling_traces(path: CommonPath, offsets: FloatArray, *, width: float) -> BoolArray:
    """Which traces (n,) straddled lane lines, by their offsets (n, stations) [m] and the lanes that the path has them in."""
    rest = without_bias_effect(offsets - width * path.lanes - path.course, errors=path.errors, bias_effect=path.bias_effect)
    known = np.isfinite(rest)
    departure = np.where(known, rest - path.levels[:, None], 0.0)
    rms = np.sqrt((departure**2).sum(axis=1) / np.maximum(known.sum(axis=1), 1))
    straddling = rms > max(MIN_STRADDLING_SHARE * width, MIN_STRADDLING_RATIO * float(np.median(rms)))
    return np.asarray(straddling & (straddling.mean() <= MAX_STRADDLING_TRACES))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Traces:
    """What a path is fitted to: offsets (traces, stations) [m], weights (traces,), and what is known beforehand."""

    offsets: FloatArray
    weights: FloatArray
    width: float
    bias_effect: FloatArray | None
    usual_bias_m: float


def _path_from_guess(traces: _Traces, guess: FloatArray, errors: TraceErrors) -> CommonPath:
    """A path from one guess of the course; its cost is counted with the same errors for all guesses."""
    lanes, _ = _lanes_of(traces, guess, errors)
    return _path_near(traces, _path_for_lanes(traces, lanes, cost=0.0).course, errors)


def _refined(path: CommonPath, traces: _Traces, errors: TraceErrors) -> CommonPath:
    """The path, or a cheaper one near it."""
    best = path
    for _ in range(REFINEMENTS):
        # What most traces do beside the course may be what the course itself does: then the others need fewer lane changes.
        moved = _path_near(traces, best.course + traces.width * np.median(best.lanes, axis=0), errors)
        again = _path_near(traces, best.course, errors)
        best = min((best, again, moved), key=lambda path: path.cost)
    return best


def _path_near(traces: _Traces, course: FloatArray, errors: TraceErrors) -> CommonPath:
    """The path for the lanes that traces drive in along a course."""
    lanes, cost = _lanes_of(traces, course, errors)
    return _path_for_lanes(traces, lanes, cost=cost)


def _lanes_of(traces: _Traces, course: FloatArray, errors: TraceErrors) -> tuple[FloatArray, float]:
    return lanes_along(course, traces.offsets, width=traces.width, errors=errors, bias_effect=traces.bias_effect)


def _path_for_lanes(traces: _Traces, lanes: FloatArray, *, cost: float) -> CommonPath:
    """Course, levels and errors for given lanes."""
    rest, bias_m = traces.offsets - traces.width * lanes, traces.usual_bias_m
    course, levels, certainty = _course_and_levels(rest, traces.weights)
    if traces.bias_effect is not None:
        miss = rest - course
        noise_m = _drift_and_noise(miss - levels[:, None])[1]
        usual_m = traces.usual_bias_m
        bias_m = estimate_bias_sd(miss, traces.bias_effect, noise_m=noise_m, usual_m=usual_m, weights=traces.weights)
        rest = rest - offsets_from_bias(miss, traces.bias_effect, noise_m=noise_m, bias_m=bias_m)
        course, levels, certainty = _course_and_levels(rest, traces.weights)
    drift_m, noise_m = _drift_and_noise(rest - course - levels[:, None])
    course = trend_filter(course, certainty.sum(axis=0) / noise_m**2, scale=KINK_SCALE_M)
    middle = float(course.mean())
    return CommonPath(
        course=course - middle,
        lanes=lanes,
        levels=levels + middle,
        errors=TraceErrors(drift_m=drift_m, noise_m=noise_m, bias_m=bias_m),
        bias_effect=traces.bias_effect,
        cost=cost,
    )


def _course_and_levels(rest: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Course (stations,), levels (traces,) [m] and weights (traces, stations), by robust (Huber) means in turn."""
    known = np.isfinite(rest)
    values = np.where(known, rest, 0.0)
    w = weights[:, None] * known
    levels = np.array([np.median(row[k]) for row, k in zip(values, known, strict=True)])
    course = np.zeros(rest.shape[1])
    huber = np.ones_like(w)
    for _ in range(HUBER_ROUNDS):
        total = (w * huber).sum(axis=0)
        mean = (w * huber * (values - levels[:, None])).sum(axis=0) / np.maximum(total, 1e-12)
        course = _interpolated(np.where(total > 0, mean, np.nan))
        miss = values - course
        levels = (huber * known * miss).sum(axis=1) / np.maximum((huber * known).sum(axis=1), 1e-12)
        residual = np.abs(miss - levels[:, None])
        sd = max(SD_PER_MEDIAN * float(np.median(residual[known])), MIN_SD_M)
        huber = np.minimum(1.0, HUBER_THRESHOLD_SDS * sd / np.maximum(residual, 1e-9))
    return course, levels, w * huber


def _drift_and_noise(residuals: FloatArray) -> tuple[float, float]:
    """Drift from station to station and white noise [m] of residuals (traces, stations), by how they differ with distance.

    Half the mean squared difference over l stations is noise^2 + l drift^2 / 2; medians keep unfinished lane changes out.
    """
    lags = np.array([1, 2, 4, 8, 16, 32])
    half_squares = []
    for lag in lags:
        differences = residuals[:, lag:] - residuals[:, :-lag]
        differences = differences[np.isfinite(differences)]
        # The median of a squared normal is 0.4549 of its mean.
        half_squares.append(np.median(differences**2) / 0.4549 / 2 if differences.size >= MIN_DIFFERENCES else np.nan)
    known = np.isfinite(half_squares)
    if known.sum() < 2:
        return INITIAL_DRIFT_M, INITIAL_NOISE_M
    slope, base = np.polyfit(lags[known], np.array(half_squares)[known], 1)
    noise = float(np.clip(np.sqrt(max(base, 0.0)), *NOISE_RANGE_M))
    return float(np.clip(np.sqrt(max(2 * slope, 0.0)), MIN_DRIFT_PER_NOISE * noise, MAX_DRIFT_M)), noise


def _interpolated(row: FloatArray) -> FloatArray:
    """The row (stations,) with values in place of NaN; 0 where nothing is known."""
    known = np.isfinite(row)
    index = np.arange(len(row))
    return np.asarray(np.interp(index, index[known], row[known])) if known.any() else np.zeros(len(row))


def _total_cost(path: CommonPath) -> float:
    """Cost of a path's lanes and, little beside it, of what its course moves to the side.

    From a guess that itself changes lanes all other traces seem to change lanes; among equals the calmest course is likeliest.
    """
    return path.cost + COURSE_COST_PER_M * float(np.abs(np.diff(path.course)).sum())
