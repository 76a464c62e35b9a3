"""What the GNSS biases of traces do on a bend: how large they are, and what they add to the traces' offsets.

A receiver's bias stays the same in the world while the road turns under it. Let it be g = (along, across) [m], seen from the
road at the middle of its bearings. Where the road has turned by a from there, the bias moves the trace to the side by

    across cos a - along sin a  =  across + T(a) g,    T(a) = (-sin a, cos a - 1)

`across` is part of the trace's level; T g is a drift of known shape, and so told from the drift of other errors.

The biases of a trace have a normal prior of standard deviation `bias_m` on each axis. With the offsets r less course and lanes,
and the covariance R of their other errors (white noise, a random walk over stations, a free level), the likeliest bias is
g = (T' R^-1 T + I / bias_m^2)^-1 T' R^-1 r.
"""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.road import Road

MIN_TURN_RAD = 0.1  # where a road turns by less, a bias of 2 m changes by less than vehicles wander
# Sizes that are tried for the biases, times the usual one; the prior of their logarithm has this standard deviation. By us.
BIAS_RATIOS, LOG_RATIO_SD = np.geomspace(0.25, 4.0, 17), 0.5
BIAS_PER_NOISE = 4.0  # sqrt(BIAS_SHARE / WHITE_SHARE) of wzsumo.sensing.gnss, where the shares' source is named
# Standard deviation of true offsets about the line between places 10 to 30 m apart: 0.04 to 0.15 m for vehicles that sway by
# 0.2 to 0.35 m over 60 m.
VEHICLE_NOISE_M = 0.12
# Standard deviation from one station to the next of what is not bias, chosen by us: wzsumo.sensing.gnss drifts by 0.045 m at an
# error of 1 m and 25 m/s, and vehicles wander besides.
USUAL_DRIFT_M = 0.08


def bias_effect_along(axis: Road, stations: FloatArray) -> FloatArray | None:
    """T (n, 2): what a metre of bias (along, across) adds to offsets at stations (n,) [m] of a road; None if it is straight."""
    bearing = np.unwrap(axis.heading_at(stations))
    if np.ptp(bearing) < MIN_TURN_RAD:
        return None
    turned = bearing - (bearing.min() + bearing.max()) / 2
    return np.column_stack([-np.sin(turned), np.cos(turned) - 1.0])


def usual_bias_sd(offsets: FloatArray) -> float:
    """Standard deviation [m] of the GNSS bias that is usual where offsets (traces, stations) [m] scatter as these do.

    The scatter is that of each offset about the line between its neighbours: lanes and courses count little there.
    """
    misses = []
    for row in offsets:
        at = np.flatnonzero(np.isfinite(row))
        share = (at[1:-1] - at[:-2]) / (at[2:] - at[:-2])
        between = (1 - share) * row[at[:-2]] + share * row[at[2:]]
        misses.append((row[at[1:-1]] - between) / np.sqrt(1 + share**2 + (1 - share) ** 2))
    # The median of a normal's absolute value is 0.6745 standard deviations.
    noise = float(np.median(np.abs(np.concatenate(misses)))) / 0.6745 if any(map(len, misses)) else 0.0
    return BIAS_PER_NOISE * float(np.sqrt(max(noise**2 - VEHICLE_NOISE_M**2, 0.0)))


def estimate_bias_sd(
    rest: FloatArray, bias_effect: FloatArray, *, noise_m: float, usual_m: float, weights: FloatArray
) -> float:
    """Likeliest standard deviation [m] of the traces' biases, with a prior about the usual one (empirical Bayes).

    `rest` (traces, stations) [m] are offsets less course and lanes, NaN where unknown; `weights` are (traces,).
    """
    if usual_m == 0.0:
        return 0.0
    precision, side = _normal_equations(rest, bias_effect, noise_m)
    log_posterior = [
        weights @ _log_evidence(precision, side, ratio * usual_m) - (np.log(ratio) / LOG_RATIO_SD) ** 2 / 2
        for ratio in BIAS_RATIOS
    ]
    return float(BIAS_RATIOS[np.argmax(log_posterior)] * usual_m)


def offsets_from_bias(rest: FloatArray, bias_effect: FloatArray, *, noise_m: float, bias_m: float) -> FloatArray:
    """T g (traces, stations) [m] of each trace's likeliest bias g; `rest` as in `estimate_bias_sd`."""
    precision, side = _normal_equations(rest, bias_effect, noise_m)
    biases = bias_m**2 * np.linalg.solve(np.eye(2) + bias_m**2 * precision, side[:, :, None])[:, :, 0]
    return np.asarray(biases @ bias_effect.T)


def _log_evidence(precision: FloatArray, side: FloatArray, bias_m: float) -> FloatArray:
    """Log of the evidence (traces,) for biases of a standard deviation [m], against that for none."""
    scaled = np.eye(2) + bias_m**2 * precision
    biases = bias_m**2 * np.linalg.solve(scaled, side[:, :, None])[:, :, 0]
    return np.asarray((side * biases).sum(axis=1) - np.linalg.slogdet(scaled)[1]) / 2


def _normal_equations(rest: FloatArray, bias_effect: FloatArray, noise_m: float) -> tuple[FloatArray, FloatArray]:
    """T' R^-1 T (traces, 2, 2) and T' R^-1 r (traces, 2) of the module's docstring."""
    precision, side = np.zeros((len(rest), 2, 2)), np.zeros((len(rest), 2))
    _add_innovations(rest, bias_effect, USUAL_DRIFT_M**2, noise_m**2, precision, side)
    return precision, side


@njit(cache=True)
def _add_innovations(
    rest: FloatArray,
    bias_effect: FloatArray,
    drift_variance: float,
    white_variance: float,
    precision: FloatArray,
    side: FloatArray,
) -> None:
    """Add up products of the innovations of offsets and of T: one Kalman filter whitens all of them."""
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
