"""CommonPath: the course that all traces share, and what each trace adds to it.

The lateral offset of trace i at station s is modelled as

    y_i(s) = c(s) + w h_i(s) + b_i + T(s) g_i + e_i(s)    [m]

with the common course c, the trace's lane h_i in lane widths w from its first lane (a fraction during a lane change), its level
b_i (its first lane, its driver's habit and what its GNSS bias adds everywhere), the part T g_i that its GNSS bias g_i adds as a
bend turns (`gnss_bias`), and a remainder e_i: a random walk from station to station (drift) and white noise.
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.course.gnss_bias import offsets_from_bias
from wzsumo.crowd_mapping.course.lane_changes import relative_lanes
from wzsumo.crowd_mapping.course.trend_filter import trend_filter
from wzsumo.frames import FloatArray

# Laplace scale of the course's second difference over 10 m, chosen by us: a line of MUTCD tapers has a kink of 1:60 to 1:10
# (0.17 to 1 m) every few hundred metres and none between.
KINK_SCALE_M = 0.02
# Noise standard deviations from which a trace's departure weighs less when further traces move a known course; chosen by us.
MAX_FULL_WEIGHT_SDS = 3.0


@dataclass(frozen=True, kw_only=True)
class TraceErrors:
    """Standard deviations [m] of a trace's drift from one station to the next, its white noise at a station, its GNSS bias.

    Only a bend shows the bias; on a straight road `bias_m` is what is usual beside such noise.
    """

    drift_m: float
    noise_m: float
    bias_m: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CommonPath:
    """Course (stations,) [m], zero on average; lanes (traces, stations) from each trace's first; levels (traces,) [m].

    `bias_effect` (stations, 2) is what a metre of bias adds to offsets (`bias_effect_along`), None on a straight road. `cost`
    is that of all traces' lanes (`relative_lanes`).
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
    """Offsets less course and lanes (traces, stations) [m], without what the likeliest GNSS biases add to them on a bend."""
    if bias_effect is None:
        return rest
    return rest - offsets_from_bias(rest, bias_effect, noise_m=errors.noise_m, bias_m=errors.bias_m)


def extend_path(path: CommonPath, offsets: FloatArray, lanes: FloatArray, *, width: float, weights: FloatArray) -> CommonPath:
    """The path for more (or other) traces of known lanes: one round of levels and course with the same errors.

    `offsets` [m] and `lanes` are (traces, stations), `weights` (traces,).
    """
    rest = without_bias_effect(offsets - width * lanes - path.course, errors=path.errors, bias_effect=path.bias_effect)
    known = np.isfinite(rest)
    rest = np.where(known, rest, 0.0)
    levels = rest.sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    miss = rest - levels[:, None]
    huber = np.minimum(1.0, MAX_FULL_WEIGHT_SDS * path.errors.noise_m / np.maximum(np.abs(miss), 1e-9))
    w = weights[:, None] * known * huber
    total = w.sum(axis=0)
    moved = np.where(total > 0, (w * miss).sum(axis=0) / np.maximum(total, 1e-12), 0.0)
    course = trend_filter(path.course + moved, total / path.errors.noise_m**2, scale=KINK_SCALE_M)
    middle = float(course.mean())
    return replace(path, course=course - middle, lanes=lanes, levels=levels + middle)
