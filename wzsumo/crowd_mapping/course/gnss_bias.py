"""Constant errors of position on a bend: what they do to offsets there, how large they are, and how to take them away.

A receiver's bias stays the same in the world while the road turns under it. Seen from the road at a bearing a from the middle
one it is  across cos a - along sin a:  `across` is part of the trace's level, the rest a drift whose shape is known.
"""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.road import Road

LEAST_TURN_RAD = 0.1  # by less, an error of 2 m changes by less than vehicles wander
RATIOS, RATIO_SD = np.geomspace(0.25, 4.0, 17), 0.5  # of the errors' size to the usual one: tried, and usual in logarithms
ERROR_PER_SCATTER = 4.0  # what stays for a trace against what is new in each fix: wzsumo.sensing.gnss, sourced there
OWN_SCATTER_M = 0.12  # of vehicles between places 10 to 30 m apart: 0.04 to 0.15 m, of sways of 0.2 to 0.35 m over 60 m
USUAL_DRIFT_M = 0.08  # per station beside the the bias: wzsumo.sensing.gnss at 1 m and 25 m/s


def bias_effect_along(axis: Road, stations: FloatArray) -> FloatArray | None:
    """What a metre of error (along, across) adds to offsets at stations (n,) [m] of a road: (n, 2); None if straight."""
    bearing = np.unwrap(axis.heading_at(stations))
    if np.ptp(bearing) < LEAST_TURN_RAD:
        return None
    turned = bearing - (bearing.min() + bearing.max()) / 2
    return np.column_stack([-np.sin(turned), np.cos(turned) - 1.0])


def usual_bias_sd(offsets: FloatArray) -> float:
    """Standard deviation [m] of constant errors that is usual where offsets (traces, stations) [m] scatter as these do.

    The scatter is taken from each offset and the line between its neighbours: lanes and courses count little there.
    """
    misses = []
    for row in offsets:
        at = np.flatnonzero(np.isfinite(row))
        share = (at[1:-1] - at[:-2]) / (at[2:] - at[:-2])
        between = (1 - share) * row[at[:-2]] + share * row[at[2:]]
        misses.append((row[at[1:-1]] - between) / np.sqrt(1 + share**2 + (1 - share) ** 2))
    # The median of a normal's size is 0.6745 of its standard deviation.
    size = float(np.median(np.abs(np.concatenate(misses)))) / 0.6745 if any(map(len, misses)) else 0.0
    return ERROR_PER_SCATTER * float(np.sqrt(max(size**2 - OWN_SCATTER_M**2, 0.0)))


def estimate_bias_sd(
    rest: FloatArray, bias_effect: FloatArray, *, noise_m: float, usual_m: float, weights: FloatArray
) -> float:
    """Standard deviation [m] of the constant errors of traces, not far from the usual: the likeliest (empirical Bayes).

    `rest` (traces, stations) [m] are offsets less course and lanes, NaN where unknown.
    """
    if usual_m == 0.0:
        return 0.0
    precision, side = _normal_equations(rest, bias_effect, noise_m)
    log_chance = [
        weights @ _log_evidence(precision, side, ratio * usual_m) - (np.log(ratio) / RATIO_SD) ** 2 / 2 for ratio in RATIOS
    ]
    return float(RATIOS[np.argmax(log_chance)] * usual_m)


def offsets_from_bias(rest: FloatArray, bias_effect: FloatArray, *, noise_m: float, bias_m: float) -> FloatArray:
    """What the likeliest constant errors of traces add to their offsets (traces, stations) [m]; see `estimate_bias_sd`."""
    precision, side = _normal_equations(rest, bias_effect, noise_m)
    errors = bias_m**2 * np.linalg.solve(np.eye(2) + bias_m**2 * precision, side[:, :, None])[:, :, 0]
    return np.asarray(errors @ bias_effect.T)


def _log_evidence(precision: FloatArray, side: FloatArray, spread: float) -> FloatArray:
    """Log of the evidence (traces,) for errors of a size [m], against that for none."""
    scaled = np.eye(2) + spread**2 * precision
    errors = spread**2 * np.linalg.solve(scaled, side[:, :, None])[:, :, 0]
    return np.asarray((side * errors).sum(axis=1) - np.linalg.slogdet(scaled)[1]) / 2


def _normal_equations(rest: FloatArray, bias_effect: FloatArray, noise_m: float) -> tuple[FloatArray, FloatArray]:
    """(traces, 2, 2) T' R^-1 T and (traces, 2) T' R^-1 r; R has white noise, a random walk over stations and a free level."""
    precision, side = np.zeros((len(rest), 2, 2)), np.zeros((len(rest), 2))
    _innovate(rest, bias_effect, USUAL_DRIFT_M**2, noise_m**2, precision, side)
    return precision, side


@njit(cache=True)
def _innovate(
    rest: FloatArray,
    bias_effect: FloatArray,
    drift_variance: float,
    white_variance: float,
    precision: FloatArray,
    side: FloatArray,
) -> None:
    """Add up the products of innovations of offsets and of bias_effect: the same Kalman filter whitens all of them."""
    for i in range(len(rest)):
        level, along, across, variance = np.nan, 0.0, 0.0, 0.0
        for j in range(rest.shape[1]):
            variance += drift_variance
            if np.isnan(rest[i, j]):
                continue
            if np.isnan(level):
                level, along, across, variance = rest[i, j], bias_effect[j, 0], bias_effect[j, 1], white_variance
                continue
            spread = variance + white_variance
            new, new_along, new_across = rest[i, j] - level, bias_effect[j, 0] - along, bias_effect[j, 1] - across
            precision[i, 0, 0] += new_along * new_along / spread
            precision[i, 0, 1] += new_along * new_across / spread
            precision[i, 1, 0] += new_along * new_across / spread
            precision[i, 1, 1] += new_across * new_across / spread
            side[i, 0] += new_along * new / spread
            side[i, 1] += new_across * new / spread
            gain = variance / spread
            level, along, across = level + gain * new, along + gain * new_along, across + gain * new_across
            variance *= 1.0 - gain
