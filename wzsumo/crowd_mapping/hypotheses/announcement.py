"""AnnouncedZone: where a zone's devices are said to stand, and the prior of where its lanes end and begin again.

The MUTCD fixes where the merging taper of a lane ends, counted from the zone's first device:

    end = first device + b L / 3 + (1 + m (1 + t)) L

with the merging taper's length L [m], the shoulder's width b [lane widths] where the shoulder is closed by a taper of its own
(0 otherwise), the number m of lanes that close before this one, and the tangent t L between two tapers. The prior is a mixture
of normal distributions about these ends; a small part of it lies anywhere farther on. Source: MUTCD 11th ed., Table 6B-3
(lengths), TA-33 (a shoulder's taper ahead of a merging taper), TA-37 (2 L between two merging tapers).
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.frames import FloatArray

WIDE_SHOULDER_LANES = 0.6  # [lane widths]: shoulders of 8 ft and more; chosen by us
P_TAPER_ON_WIDE_SHOULDER = 0.9  # that a shoulder wider than this has a taper of its own; a narrower one: 1 - 0.9. Chosen by us
TAPER_END_SD_M = 8.0  # of a taper's end about the manual's: devices are set out by pacing. Chosen by us
P_LATE_END = 0.05  # that a lane ends later than in any drawing of the manual; chosen by us
MEAN_LATE_TAPERS = 2.0  # mean distance of such an end beyond the first taper, in taper lengths; chosen by us
# Probability of each tangent, in taper lengths, between two merging tapers: the manual's 2 L, or less. Chosen by us
TANGENT_PROBABILITIES = ((0.0, 0.3), (1.0, 0.2), (2.0, 0.5))


@dataclass(frozen=True, kw_only=True)
class TaperEndPrior:
    """Prior of the station at which a closed lane's taper ends.

    `first_device` is the station [m] of the zone's first device, `lanes_before` the number of lanes that close ahead of this
    one, `shoulder_lanes` the width [lane widths] of the shoulder beside it.
    """

    first_device: float
    lanes_before: int
    shoulder_lanes: float

    def density(self, ends: FloatArray, *, length: float) -> FloatArray:
        """Density [1/m] (n,) at stations `ends` (n,) [m] for a taper of a length [m]."""
        return self.density_as_drawn(ends, length=length) + self.density_late(ends, length=length)

    def density_as_drawn(self, ends: FloatArray, *, length: float) -> FloatArray:
        """The part (n,) [1/m] of the density that belongs to ends as the manual draws them."""
        has_taper = P_TAPER_ON_WIDE_SHOULDER if self.shoulder_lanes > WIDE_SHOULDER_LANES else 1 - P_TAPER_ON_WIDE_SHOULDER
        tangents = ((0.0, 1.0),) if self.lanes_before == 0 else TANGENT_PROBABILITIES
        density = np.zeros(len(ends))
        for shoulder, share in ((0.0, 1 - has_taper), (self.shoulder_lanes / 3, has_taper)):
            for tangent, weight in tangents:
                end = self.first_device + (shoulder + 1 + self.lanes_before * (1 + tangent)) * length
                normal = np.exp(-0.5 * ((ends - end) / TAPER_END_SD_M) ** 2) / (np.sqrt(2 * np.pi) * TAPER_END_SD_M)
                density += (1 - P_LATE_END) * share * weight * normal
        return density

    def density_late(self, ends: FloatArray, *, length: float) -> FloatArray:
        """The part (n,) [1/m] of the density that belongs to ends anywhere beyond the first taper: an exponential."""
        beyond, mean = ends - self.first_device - length, MEAN_LATE_TAPERS * length
        return np.asarray(np.where(beyond > 0, P_LATE_END * np.exp(-np.maximum(beyond, 0.0) / mean) / mean, 0.0))


@dataclass(frozen=True, kw_only=True)
class AnnouncedZone:
    """Stations [m] of a zone's first and last device, and widths [lane widths] of the road's right and left shoulder."""

    first_device: float
    last_device: float
    shoulders_lanes: tuple[float, float]

    @property
    def mirrored(self) -> "AnnouncedZone":
        """The same zone with right and left exchanged."""
        return replace(self, shoulders_lanes=self.shoulders_lanes[::-1])

    def closing_prior(self, lane: int, *, lanes_before: int) -> TaperEndPrior:
        """The prior of where a lane ends; lanes below 0 lie on the right of the open ones, others on the left."""
        return TaperEndPrior(
            first_device=self.first_device, lanes_before=lanes_before, shoulder_lanes=self.shoulders_lanes[lane > 0]
        )

    def opening_prior(self, *, lanes_before: int) -> TaperEndPrior:
        """The prior of where a lane begins again, with stations counted against the direction of travel.

        No shoulder is opened by a taper of its own.
        """
        return TaperEndPrior(first_device=-self.last_device, lanes_before=lanes_before, shoulder_lanes=0.0)
