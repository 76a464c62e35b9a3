"""TaperLine: where a closed lane ends, as a belief about the line of devices that a merging taper lays across it.

The line starts at the lane's outer edge and reaches the inner edge, where the lane ends, a taper's length L farther on, at
station e. Vehicles do not cross it. A vehicle whose body reaches a share a(s) of the lane width beyond the inner edge at
station s bounds the end from below:

    e >= b = max over s of (s + a(s) L)

Without an announcement, the gaps e - b of n vehicles are exponential with an unknown mean m, for which a prior of 100 m counts
as much as one vehicle. The gap beyond the last of the n vehicles is then exponential with mean m / n; with a probability of 0.3
all drivers leave the lane early and the mean is 100 m longer. With an announcement, its prior (`announcement`) is weighed by
whether the vehicles stay clear of the line. A kink of the open lanes' course, where a shifting taper starts, bounds the line
from above. Bounds are blurred by the error of a lane change's station, so that a gap is an exponentially modified Gaussian.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtr

from wzsumo.crowd_mapping.hypotheses.announcement import TaperEndPrior
from wzsumo.frames import FloatArray

MEAN_GAP_PRIOR_M = 100.0  # prior mean of the gap from a vehicle's bound to the line; chosen by us
MAX_GAPS_BEYOND = 4  # the line is looked for up to so many prior gaps beyond the last bound
P_ALL_LEAVE_EARLY = 0.3  # that all drivers leave the lane well ahead of the devices; chosen by us
STATION_SD_M = 8.0  # of the station of a lane change, where stations are 10 m apart; chosen by us
# The taper's length about the manual's, and the probability of each; chosen by us.
LENGTH_FACTORS, LENGTH_WEIGHTS = np.array([0.85, 1.0, 1.15]), np.array([0.25, 0.5, 0.25])
STATION_STEP_M = 2.0  # of the stations at which the line may end
# Least probability that a trace drove in another lane than it seems: at 2 m of GNSS error up to 5 % do on simulated traffic.
MIN_MISLABELLED_CHANCE = 0.05
MISLABELLED_RANGE_M = 1000.0  # along which such a trace may seem to leave the lane, with a uniform density; chosen by us
DENSITY_FLOOR = 1e-12  # [1/m], of one vehicle's gap
KINK_SD_M = 10.0  # of the line's end about a kink at which it ends at once; one station. Chosen by us
# Probability that the line ends at the kink, a tangent of L/2 ahead of it, or anywhere ahead, where the kink is of another
# shift. The tangent's standard deviation is relative to L. All chosen by us.
P_AT_KINK, P_TANGENT_TO_KINK, P_AHEAD_OF_KINK, TANGENT_RELATIVE_SD = 0.4, 0.4, 0.2, 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class TaperLine:
    """Belief about the station where a line of devices reaches the inner edge of a lane; it starts a length before, outside.

    `probability` (lengths, m) are the probabilities that a line of each of the `lengths` [m] ends at each of the ascending
    `stations` (m,) [m].
    """

    stations: FloatArray
    probability: FloatArray
    lengths: FloatArray

    def open_beyond(self, s: FloatArray, across: FloatArray) -> FloatArray:
        """Probability (n,) that places are still open: that the line crosses the lane farther on.

        The places are at stations s (n,) [m] and at shares `across` (n,) of the lane's width from its inner edge.
        """
        chance = np.zeros(len(s))
        for length, weight, row in zip(self.lengths, LENGTH_WEIGHTS, self.probability, strict=True):
            below = np.concatenate([[0.0], np.cumsum(row)])
            place = s + length * np.clip(across, 0.0, 1.0)
            edges = np.concatenate([self.stations - STATION_STEP_M / 2, [self.stations[-1] + STATION_STEP_M / 2]])
            chance += weight * (1 - np.interp(place, edges, below))
        return chance

    @property
    def end(self) -> float:
        """Expected station [m] of the line's end."""
        return float(LENGTH_WEIGHTS @ (self.probability @ self.stations))

    @property
    def end_sd(self) -> float:
        """Standard deviation [m] of the line's end."""
        return float(np.sqrt(LENGTH_WEIGHTS @ (self.probability @ (self.stations - self.end) ** 2)))


def fit_taper_line(
    stations: FloatArray,
    remaining: FloatArray,
    *,
    length: float,
    half_vehicle: float,
    kink: float | None,
    end_prior: TaperEndPrior | None,
    mislabelled: FloatArray,
) -> TaperLine:
    """The belief from vehicles that left the lane, from the course's kink and from what is announced.

    `remaining` (vehicles, stations) is the share of the lane's width that a vehicle's middle has still to go to the middle of
    the next lane, at `stations` [m]. `length` [m] is the taper's by the manual, `half_vehicle` half a vehicle's width in lane
    widths, `kink` the station [m] where a shift of the open lanes starts, if one does. With an `end_prior` there need not be
    any vehicle; `mislabelled` (vehicles,) are then the probabilities that they drove in another lane.
    """
    lengths = length * LENGTH_FACTORS
    if end_prior:
        certain = 1 - np.maximum(mislabelled, MIN_MISLABELLED_CHANCE)
        each = [_bounds(stations, remaining, at, half_vehicle) for at in lengths]
        return _announced_line(lengths, each, certain, kink=kink, end_prior=end_prior)
    bounds = np.array([_bounds(stations, remaining, at, half_vehicle) for at in lengths])
    low = float(bounds.min())
    farthest = max(float(bounds.max()), kink or low) + MAX_GAPS_BEYOND * MEAN_GAP_PRIOR_M
    ends = np.arange(low - 4 * STATION_SD_M, farthest, STATION_STEP_M)
    rows = []
    for at, each in zip(lengths, bounds, strict=True):
        last, n = each.max(), len(each)
        mean_beyond_last = (MEAN_GAP_PRIOR_M + (last - each).sum()) / n / n
        as_usual, early = (_gap_density(ends - last, mean) for mean in (mean_beyond_last, mean_beyond_last + MEAN_GAP_PRIOR_M))
        belief = (1 - P_ALL_LEAVE_EARLY) * as_usual + P_ALL_LEAVE_EARLY * early
        if kink is not None:
            belief = belief * _ahead_of_kink(kink - ends, at)
        rows.append(belief / max(belief.sum(), 1e-300) if belief.sum() > 0 else _nearest(ends, last))
    return TaperLine(stations=ends, probability=np.array(rows), lengths=lengths)


def _bounds(stations: FloatArray, remaining: FloatArray, length: float, half_vehicle: float) -> FloatArray:
    """Least ends (vehicles,) [m] of a line that stays clear of each vehicle's body."""
    # The body's outer side is at (remaining + half_vehicle - 1/2) of the lane, a line that ends at e at (e - s) / length of it.
    across = np.clip(remaining + half_vehicle - 0.5, 0.0, 1.0)
    return np.asarray(np.where(across > 0, stations + length * across, -np.inf).max(axis=1))


def _announced_line(
    lengths: FloatArray, bounds: list[FloatArray], certain: FloatArray, *, kink: float | None, end_prior: TaperEndPrior
) -> TaperLine:
    """The belief from what is announced and from the vehicles' `bounds` (vehicles,) [m] for each length.

    `certain` (vehicles,) are the probabilities that the vehicles drove in the lane.
    """
    last_end = end_prior.first_device + (4 * end_prior.lanes_before + 5) * lengths[1]
    ends = np.arange(end_prior.first_device, last_end, STATION_STEP_M)
    rows = []
    for at, each in zip(lengths, bounds, strict=True):
        gaps = ends[:, None] - each
        # Many drivers leave a lane early: where the line lies as drawn, they only need to stay clear of it. Where it lies
        # elsewhere, the gaps tell where.
        all_clear = (1 - certain * ndtr(-gaps / STATION_SD_M)).prod(axis=1)
        belief = end_prior.density_as_drawn(ends, length=at) * all_clear
        belief = belief + end_prior.density_late(ends, length=at) * _gap_likelihood(gaps, certain)
        if kink is not None:
            belief = belief * _ahead_of_kink(kink - ends, at)
        rows.append(belief / belief.sum() if belief.sum() > 0 else _nearest(ends, each.max(initial=-np.inf)))
    return TaperLine(stations=ends, probability=np.array(rows), lengths=lengths)


def _gap_likelihood(gaps: FloatArray, certain: FloatArray) -> FloatArray:
    """Likelihood (ends,), 1 at its highest, of gaps (ends, vehicles) [m] from the vehicles' bounds to the line's end.

    Gaps are exponential; their mean is that of the vehicles that stay clear of the line. A vehicle that drove in another lane
    seems to leave this one anywhere.
    """
    clear = certain * ndtr(gaps / STATION_SD_M)
    mean = (MEAN_GAP_PRIOR_M + (clear * np.maximum(gaps, 0.0)).sum(axis=1)) / (1 + clear.sum(axis=1))
    each = certain * _gap_density(gaps, mean[:, None]) + (1 - certain) / MISLABELLED_RANGE_M + DENSITY_FLOOR
    log_likelihood = np.log(each).sum(axis=1)
    return np.asarray(np.exp(log_likelihood - log_likelihood.max()))


def _gap_density(gap: FloatArray, mean: FloatArray | float) -> FloatArray:
    """Density [1/m] of gaps [m] that are exponential with a mean [m] and blurred: an exponentially modified Gaussian."""
    ratio = STATION_SD_M / mean
    return np.asarray(np.exp(ratio**2 / 2 - gap / mean + log_ndtr(gap / STATION_SD_M - ratio)) / mean)


def _ahead_of_kink(distance: FloatArray, length: float) -> FloatArray:
    """Weight (n,) of a line that ends a distance (n,) [m] ahead of where the shift starts: at once, or after a tangent."""
    at_once = np.exp(-0.5 * (distance / KINK_SD_M) ** 2) / KINK_SD_M
    tangent_sd = TANGENT_RELATIVE_SD * length
    tangent = np.exp(-0.5 * ((distance - length / 2) / tangent_sd) ** 2) / tangent_sd
    anywhere = np.where(distance > -KINK_SD_M, 1 / length, 0.0)
    return np.asarray(P_AT_KINK * at_once + P_TANGENT_TO_KINK * tangent + P_AHEAD_OF_KINK * anywhere + 1e-9)


def _nearest(stations: FloatArray, place: float) -> FloatArray:
    """All probability (m,) at the station nearest to a place [m]."""
    row = np.zeros(len(stations))
    row[np.argmin(np.abs(stations - place))] = 1.0
    return row
