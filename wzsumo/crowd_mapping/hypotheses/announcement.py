"""Announced: where a zone's devices are said to stand, and where lanes are likely to end and to begin again within them."""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.frames import FloatArray

LEAST_SHOULDER, MOST_WITH_SHOULDER = 0.6, 0.9  # 8 ft in lanes; chance that so wide a shoulder is closed by a taper of its own
ANNOUNCED_SD_M = 8.0  # of a taper's end, where the manual says how long it is: devices are set out by pacing
LATE_SHARE = 0.05  # of the lanes that end later than by any drawing of the manual


@dataclass(frozen=True, kw_only=True)
class Announcement:
    """The station [m] of a zone's first device, and what closes ahead of a lane: other lanes, a shoulder [lane widths]."""

    station: float
    lanes_before: int
    shoulder: float

    def density(self, ends: FloatArray, *, length: float) -> FloatArray:
        """Prior density [1/m] (n,) of the end of a lane's taper of some length [m], at stations `ends` (n,) [m]."""
        return self.as_drawn(ends, length=length) + self.late(ends, length=length)

    def as_drawn(self, ends: FloatArray, *, length: float) -> FloatArray:
        """The part of the density that is of lanes that end where the manual puts them.

        A zone begins with a merging taper, or with a taper of the shoulder ahead of it. That one is L/3 long, for the
        shoulder's own width (MUTCD 11th ed., Table 6B-3; ibid., TA-33 draws one); between two merging tapers lie 2 L (ibid.,
        TA-37) or less.
        """
        with_shoulder = MOST_WITH_SHOULDER if self.shoulder > LEAST_SHOULDER else 1 - MOST_WITH_SHOULDER
        tangents = ((0.0, 1.0),) if self.lanes_before == 0 else ((0.0, 0.3), (1.0, 0.2), (2.0, 0.5))
        density = np.zeros(len(ends))
        for shoulder, share in ((0.0, 1 - with_shoulder), (self.shoulder / 3, with_shoulder)):
            for tangent, weight in tangents:
                end = self.station + (shoulder + 1 + self.lanes_before * (1 + tangent)) * length
                bell = np.exp(-0.5 * ((ends - end) / ANNOUNCED_SD_M) ** 2) / (np.sqrt(2 * np.pi) * ANNOUNCED_SD_M)
                density += (1 - LATE_SHARE) * share * weight * bell
        return density

    def late(self, ends: FloatArray, *, length: float) -> FloatArray:
        """The part of the density that is of lanes that end later, anywhere."""
        beyond, mean = ends - self.station - length, 2 * length
        return np.asarray(np.where(beyond > 0, LATE_SHARE * np.exp(-np.maximum(beyond, 0.0) / mean) / mean, 0.0))


@dataclass(frozen=True, kw_only=True)
class Announced:
    """The stations [m] of a zone's first and last device, and the road's shoulders, right and left, in lane widths."""

    start: float
    end: float
    shoulders: tuple[float, float]

    @property
    def mirrored(self) -> "Announced":
        """The same zone with right and left exchanged."""
        return replace(self, shoulders=self.shoulders[::-1])

    def closing(self, lane: int, *, lanes_before: int) -> Announcement:
        """The announcement of the end of a lane on the right (below 0) or on the left."""
        return Announcement(station=self.start, lanes_before=lanes_before, shoulder=self.shoulders[lane > 0])

    def opening(self, *, lanes_before: int) -> Announcement:
        """The announcement of a lane's new beginning, seen against the direction of travel: no shoulder opens before it."""
        return Announcement(station=-self.end, lanes_before=lanes_before, shoulder=0.0)
