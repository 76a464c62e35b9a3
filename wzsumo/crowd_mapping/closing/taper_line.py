"""Where a closed lane ends: the line of devices across it, from those who still drove beside it and from the course's kinks."""

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtr

from wzsumo.crowd_mapping.hypotheses.announcement import Announcement
from wzsumo.frames import FloatArray

GAP_PRIOR_M, MOST_GAPS = 100.0, 4  # from the last possible place of a merge to a vehicle's own, as much as one vehicle's word
EARLY_SHARE = 0.3  # chance that all drivers leave the lane well ahead of where the devices make them
STATION_SD_M = 8.0  # of the place of a lane change between stations 10 m apart
LENGTH_FACTORS, LENGTH_WEIGHTS = np.array([0.85, 1.0, 1.15]), np.array([0.25, 0.5, 0.25])  # of the taper's length
STEP_M = 2.0
LEAST_DOUBT = 0.05  # that a trace was where its levels and lane changes say: at 2 m up to so many are mistaken
ANYWHERE_M = 1000.0  # along which such a one may seem to leave the lane
LEAST_DENSITY = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class TaperLine:
    """Belief in the station where a device line reaches the inner edge of a lane; it starts a `length` before, at the outer.

    `stations` (m,) [m] ascend; `probability` (lengths, m) are the chances that the line ends there, for each of `lengths`.
    """

    stations: FloatArray
    probability: FloatArray
    lengths: FloatArray

    def open_beyond(self, s: FloatArray, across: FloatArray) -> FloatArray:
        """Chance (n,) that the line is still ahead at stations s (n,), shares `across` (n,) of the lane from its inner edge."""
        chance = np.zeros(len(s))
        for length, weight, row in zip(self.lengths, LENGTH_WEIGHTS, self.probability, strict=True):
            below = np.concatenate([[0.0], np.cumsum(row)])
            place = s + length * np.clip(across, 0.0, 1.0)
            edges = np.concatenate([self.stations - STEP_M / 2, [self.stations[-1] + STEP_M / 2]])
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
    shares: FloatArray,
    *,
    length: float,
    half_vehicle: float,
    kink: float | None,
    announcement: Announcement | None = None,
    doubts: FloatArray | None = None,
) -> TaperLine:
    """The belief from vehicles that left the lane: their shares (vehicles, stations) of its width still to go, at stations [m].

    No vehicle's body crosses the line, so each bounds it from below; how far they scatter tells how much later it may be. A
    kink of the open lanes' course at station `kink` [m], where a shifting taper starts, bounds it from above: the merging
    taper ends there, or a tangent of about L/2 before. `half_vehicle` is half a vehicle's width in lane widths. Where the
    zone's first device is known, that says more than how vehicles scatter, and there need not be any; `doubts` (vehicles,)
    are the chances that they drove in another lane after all.
    """
    lengths = length * LENGTH_FACTORS
    if announcement:
        sure = np.ones(len(shares)) if doubts is None else 1 - np.maximum(doubts, LEAST_DOUBT)
        each = [_bounds(stations, shares, at, half_vehicle) for at in lengths]
        return _announced_line(lengths, each, sure, kink=kink, announcement=announcement)
    bounds = np.array([_bounds(stations, shares, at, half_vehicle) for at in lengths])
    low = float(bounds.min())
    ends = np.arange(low - 4 * STATION_SD_M, max(float(bounds.max()), kink or low) + MOST_GAPS * GAP_PRIOR_M, STEP_M)
    rows = []
    for at, each in zip(lengths, bounds, strict=True):
        last, n = each.max(), len(each)
        # The gap from the last of n vehicles to the line, when gaps are exponential, is exponential with an n-th of the mean.
        scale = (GAP_PRIOR_M + (last - each).sum()) / n / n
        late, early = (_shifted_exponential(ends - last, mean) for mean in (scale, scale + GAP_PRIOR_M))
        belief = (1 - EARLY_SHARE) * late + EARLY_SHARE * early
        if kink is not None:
            belief = belief * _ahead_of_kink(kink - ends, at)
        rows.append(belief / max(belief.sum(), 1e-300) if belief.sum() > 0 else _nearest(ends, last))
    return TaperLine(stations=ends, probability=np.array(rows), lengths=lengths)


def _bounds(stations: FloatArray, shares: FloatArray, length: float, half_vehicle: float) -> FloatArray:
    """Earliest ends (vehicles,) of a line that clears each vehicle's body."""
    # Body's outer side at (share + half_vehicle - 1/2) of the lane; a line that ends at e is at (e - s) / length of it.
    across = np.clip(shares + half_vehicle - 0.5, 0.0, 1.0)
    return np.asarray(np.where(across > 0, stations + length * across, -np.inf).max(axis=1))


def _announced_line(
    lengths: FloatArray, bounds: list[FloatArray], sure: FloatArray, *, kink: float | None, announcement: Announcement
) -> TaperLine:
    """The belief from what is announced, and from the vehicles' `bounds` for each length, of which each is so `sure`."""
    ends = np.arange(announcement.station, announcement.station + (4 * announcement.lanes_before + 5) * lengths[1], STEP_M)
    rows = []
    for at, each in zip(lengths, bounds, strict=True):
        gaps = ends[:, None] - each
        # Where the manual puts it, nobody need have come near a line: many leave early. Elsewhere those who came nearest tell.
        cleared = (1 - sure * ndtr(-gaps / STATION_SD_M)).prod(axis=1)
        belief = announcement.as_drawn(ends, length=at) * cleared
        belief = belief + announcement.late(ends, length=at) * _likelihood(gaps, sure)
        if kink is not None:
            belief = belief * _ahead_of_kink(kink - ends, at)
        rows.append(belief / belief.sum() if belief.sum() > 0 else _nearest(ends, each.max(initial=-np.inf)))
    return TaperLine(stations=ends, probability=np.array(rows), lengths=lengths)


def _likelihood(gaps: FloatArray, sure: FloatArray) -> FloatArray:
    """Likelihood (ends,), 1 at its highest, of gaps (ends, vehicles) [m] from vehicles' bounds to where the line may end.

    Gaps are exponential, with the mean that the gaps of those who keep clear of the line have; a vehicle that was in another
    lane may have been anywhere.
    """
    clear = sure * ndtr(gaps / STATION_SD_M)
    mean = (GAP_PRIOR_M + (clear * np.maximum(gaps, 0.0)).sum(axis=1)) / (1 + clear.sum(axis=1))
    each = sure * _shifted_exponential(gaps, mean[:, None]) + (1 - sure) / ANYWHERE_M + LEAST_DENSITY
    log_likelihood = np.log(each).sum(axis=1)
    return np.asarray(np.exp(log_likelihood - log_likelihood.max()))


def _shifted_exponential(gap: FloatArray, scale: FloatArray | float) -> FloatArray:
    """Density of an exponential gap, blurred by the stations' error: an exponentially modified Gaussian."""
    ratio = STATION_SD_M / scale
    return np.asarray(np.exp(ratio**2 / 2 - gap / scale + log_ndtr(gap / STATION_SD_M - ratio)) / scale)


def _ahead_of_kink(distance: FloatArray, length: float) -> FloatArray:
    """Prior density of the line's end at a distance [m] ahead of where the shift starts: at once, or after a tangent."""
    at_once = np.exp(-0.5 * (distance / 10.0) ** 2) / 10.0
    tangent = np.exp(-0.5 * ((distance - length / 2) / (0.1 * length)) ** 2) / (0.1 * length)
    anywhere = np.where(distance > -10, 1 / length, 0.0)  # the shift may be another one
    return np.asarray(0.4 * at_once + 0.4 * tangent + 0.2 * anywhere + 1e-9)


def _nearest(stations: FloatArray, place: float) -> FloatArray:
    row = np.zeros(len(stations))
    row[np.argmin(np.abs(stations - place))] = 1.0
    return row
