"""Where a closed lane ends: the line of devices across it, from those who still drove beside it and from the course's kinks."""

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtr

from wzsumo.frames import FloatArray
from wzsumo.units import METRES_PER_FOOT, feet_from_metres, mph_from_mps

GAP_PRIOR_M, MOST_GAPS = 100.0, 4  # from the last possible place of a merge to a vehicle's own, as much as one vehicle's word
EARLY_SHARE = 0.3  # chance that all drivers leave the lane well ahead of where the devices make them
STATION_SD_M = 8.0  # of the place of a lane change between stations 10 m apart
LENGTH_FACTORS, LENGTH_WEIGHTS = np.array([0.85, 1.0, 1.15]), np.array([0.25, 0.5, 0.25])  # of the taper's length
STEP_M = 2.0
LEAST_SHOULDER, MOST_WITH_SHOULDER = 0.6, 0.9  # 8 ft in lanes; chance that so wide a shoulder is closed by a taper of its own
ANNOUNCED_SD_M = 8.0  # of a taper's end, where the manual says how long it is: devices are set out by pacing


def merging_taper_m(speed_mps: float, *, width_m: float) -> float:
    """Length L [m] of a merging taper: W S from 45 mph, W S^2 / 60 below. Source: MUTCD 11th ed., Table 6B-4."""
    speed_mph = mph_from_mps(speed_mps)
    width_ft = feet_from_metres(width_m)
    return METRES_PER_FOOT * width_ft * (speed_mph if speed_mph >= 42.5 else speed_mph**2 / 60)


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


@dataclass(frozen=True, kw_only=True)
class Announcement:
    """The station [m] of a zone's first device, and what closes ahead of a lane: other lanes, a shoulder [lane widths]."""

    station: float
    lanes_before: int
    shoulder: float


def fit_taper_line(
    stations: FloatArray,
    shares: FloatArray,
    *,
    length: float,
    half_vehicle: float,
    kink: float | None,
    announcement: Announcement | None = None,
) -> TaperLine:
    """The belief from vehicles that left the lane: their shares (vehicles, stations) of its width still to go, at stations [m].

    No vehicle's body crosses the line, so each bounds it from below; how far they scatter tells how much later it may be. A
    kink of the open lanes' course at station `kink` [m], where a shifting taper starts, bounds it from above: the merging
    taper ends there, or a tangent of about L/2 before. `half_vehicle` is half a vehicle's width in lane widths. Where the
    zone's first device is known, that says more than how vehicles scatter, and there need not be any.
    """
    lengths = length * LENGTH_FACTORS
    if announcement:
        return _announced_line(stations, shares, lengths, half_vehicle=half_vehicle, kink=kink, announcement=announcement)
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
    stations: FloatArray,
    shares: FloatArray,
    lengths: FloatArray,
    *,
    half_vehicle: float,
    kink: float | None,
    announcement: Announcement,
) -> TaperLine:
    ends = np.arange(announcement.station, announcement.station + (4 * announcement.lanes_before + 5) * lengths[1], STEP_M)
    rows = []
    for at in lengths:
        last = _bounds(stations, shares, at, half_vehicle).max(initial=-np.inf)
        belief = _after_announcement(ends, at, announcement)
        belief = belief * ndtr((ends - last) / STATION_SD_M)
        if kink is not None:
            belief = belief * _ahead_of_kink(kink - ends, at)
        rows.append(belief / belief.sum() if belief.sum() > 0 else _nearest(ends, last))
    return TaperLine(stations=ends, probability=np.array(rows), lengths=lengths)


def _after_announcement(ends: FloatArray, length: float, announcement: Announcement) -> FloatArray:
    """Prior density of a line's end, of a zone that begins with a merging taper or with a taper of the shoulder ahead of it.

    A shoulder's taper is L/3 long, for the shoulder's own width (MUTCD 11th ed., Table 6B-3; ibid., TA-33 draws one); between
    two merging tapers lie 2 L (ibid., TA-37) or less.
    """
    distance = ends - announcement.station
    with_shoulder = MOST_WITH_SHOULDER if announcement.shoulder > LEAST_SHOULDER else 1 - MOST_WITH_SHOULDER
    tangents = ((0.0, 1.0),) if announcement.lanes_before == 0 else ((0.0, 0.3), (1.0, 0.2), (2.0, 0.5))
    density = np.where(distance > length, 0.05 * np.exp(-(distance - length) / (2 * length)) / (2 * length), 0.0)
    for shoulder, share in ((0.0, 1 - with_shoulder), (announcement.shoulder / 3, with_shoulder)):
        for tangent, weight in tangents:
            end = (shoulder + 1 + announcement.lanes_before * (1 + tangent)) * length
            miss = (distance - end) / ANNOUNCED_SD_M
            density = density + 0.95 * share * weight * np.exp(-0.5 * miss**2) / (np.sqrt(2 * np.pi) * ANNOUNCED_SD_M)
    return np.asarray(density)


def _shifted_exponential(gap: FloatArray, scale: float) -> FloatArray:
    """Density of an exponential gap, blurred by the stations' error: an exponentially modified Gaussian."""
    ratio = STATION_SD_M / scale
    return np.asarray(np.exp(ratio**2 / 2 - gap / scale + log_ndtr(gap / STATION_SD_M - ratio)) / scale)


def _ahead_of_kink(distance: FloatArray, length: float) -> FloatArray:
    """Prior density of the line's end at a distance [m] ahead of where the shift starts: at once, or after a tangent."""
    at_once = np.exp(-0.5 * (distance / 10.0) ** 2) / 10.0
    tangent = np.exp(-0.5 * ((distance - length / 2) / (0.1 * length)) ** 2) / (0.1 * length)
    anywhere = np.where((distance > -10) & (distance < 2 * length), 1 / length, 0.0)
    return np.asarray(0.4 * at_once + 0.4 * tangent + 0.2 * anywhere + 1e-9)


def _nearest(stations: FloatArray, place: float) -> FloatArray:
    row = np.zeros(len(stations))
    row[np.argmin(np.abs(stations - place))] = 1.0
    return row
