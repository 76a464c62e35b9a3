"""CommonPath: the course that all traces share, up to lanes and levels of their own, and the size of what they do not share.

A trace's offset at a station is modelled as  y = c(s) + w h(s) + b + e(s):  common course c, lane h of width w, level b of
the trace (its GNSS bias, its driver's habit and the lane it started in), remainder e that drifts and scatters. On a bend the
GNSS bias turns beside the road; what that adds is taken away from the offsets (`gnss_bias`).
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.course.gnss_bias import offsets_from_bias
from wzsumo.crowd_mapping.course.lane_changes import relative_lanes
from wzsumo.crowd_mapping.course.trend_filter import trend_filter
from wzsumo.frames import FloatArray

# Laplace scale of the course's second difference over 10 m: a line of MUTCD tapers has a kink of 1:60 to 1:10 (0.17 to 1 m)
# every few hundred metres and none between.
KINK_SCALE_M = 0.02


@dataclass(frozen=True, kw_only=True)
class TraceErrors:
    """Standard deviations [m] of a trace's drift from station to station, of its scatter, and of its constant error.

    The last one shows on a bend; elsewhere it is as usual beside such a scatter.
    """

    drift_m: float
    noise_m: float
    bias_m: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CommonPath:
    """`course` (stations,) [m], zero on average; `lanes` (traces, stations) from each trace's first; `levels` (traces,) [m].

    `bias_effect` (stations, 2) is what a metre of bias adds to offsets (`bias_effect_along`), None on a straight road.
    """

    course: FloatArray
    lanes: FloatArray
    levels: FloatArray
    errors: TraceErrors
    bias_effect: FloatArray | None
    cost: float


def lanes_along(
    course: FloatArray, offsets: FloatArray, *, width: float, errors: TraceErrors, bias_effect: FloatArray | None
) -> tuple[FloatArray, float]:
    """Lanes (traces, stations), from the first of each, of traces that drive along a known course; and the cost of all."""
    return relative_lanes(
        offsets - course,
        np.full(len(course), width),
        drift_variance=errors.drift_m**2,
        white_variance=errors.noise_m**2,
        bias_effect=bias_effect,
        bias_variance=0.0 if bias_effect is None else errors.bias_m**2,
    )


def without_bias_effect(rest: FloatArray, *, errors: TraceErrors, bias_effect: FloatArray | None) -> FloatArray:
    """Offsets less course and lanes (traces, stations) [m], without what constant errors add to them on a bend."""
    if bias_effect is None:
        return rest
    return rest - offsets_from_bias(rest, bias_effect, noise_m=errors.noise_m, bias_m=errors.bias_m)


def extend_path(path: CommonPath, offsets: FloatArray, lanes: FloatArray, *, width: float, weights: FloatArray) -> CommonPath:
    """The path for more (or other) traces of known lanes: one round of levels and course, errors as they were."""
    rest = without_bias_effect(offsets - width * lanes - path.course, errors=path.errors, bias_effect=path.bias_effect)
    known = np.isfinite(rest)
    rest = np.where(known, rest, 0.0)
    levels = rest.sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    miss = rest - levels[:, None]
    w = weights[:, None] * known * np.minimum(1.0, 3 * path.errors.noise_m / np.maximum(np.abs(miss), 1e-9))
    total = w.sum(axis=0)
    moved = np.where(total > 0, (w * miss).sum(axis=0) / np.maximum(total, 1e-12), 0.0)
    course = trend_filter(path.course + moved, total / path.errors.noise_m**2, scale=KINK_SCALE_M)
    middle = float(course.mean())
    return replace(path, course=course - middle, lanes=lanes, levels=levels + middle)
