"""AnnouncedZone: where a work zone is said to be on a road, and how far each statement can be trusted.

An announcement is evidence, not truth: it comes from a scenario, a spec file or a WZDx feed. WZDx calls a position "verified"
if a GPS-equipped device measured it, otherwise "estimated" (WZDx 4.2, SpatialVerification); neither states a distance.
"""

from dataclasses import dataclass

from wzsumo.errors import SpecError
from wzsumo.work_zone import Side

# A receiver's 5 m, and the spacing of devices in a taper: the one that measures is among the first. Chosen by us.
VERIFIED_SD_M = 15.0
# Positions that nobody measured come from mileposts and cross streets, in steps of 0.1 mile (161 m). Chosen by us.
ESTIMATED_SD_M = 150.0


@dataclass(frozen=True, kw_only=True)
class AnnouncedZone:
    """A zone between two stations [m] of the road before, each with its standard deviation [m], as somebody announced it.

    `closed_lanes` counts from the right (0 = rightmost); None: not said, an empty tuple: said to be all open. `side` is that of
    the closure, `speed_mps` the limit within the zone; None where not said. `source` names what said it.
    """

    start_m: float
    end_m: float
    start_sd_m: float = ESTIMATED_SD_M
    end_sd_m: float = ESTIMATED_SD_M
    closed_lanes: tuple[int, ...] | None = None
    side: Side | None = None
    speed_mps: float | None = None
    source: str = "announcement"

    def __post_init__(self) -> None:
        if not self.start_m < self.end_m:
            raise SpecError(
                f"{self.source}: start_m={self.start_m:g} and end_m={self.end_m:g} must be in this order, along the road in "
                "the direction of travel"
            )
        if not (self.start_sd_m > 0 and self.end_sd_m > 0):
            raise SpecError(
                f"{self.source}: start_sd_m={self.start_sd_m:g} and end_sd_m={self.end_sd_m:g} must be above 0: nobody knows a "
                "zone's ends exactly"
            )
        if self.closed_lanes is not None and (min(self.closed_lanes, default=0) < 0 or self._repeats):
            raise SpecError(
                f"{self.source}: closed_lanes={self.closed_lanes} must be lanes of 0 (rightmost) or more, each once"
            )

    @property
    def _repeats(self) -> bool:
        lanes = self.closed_lanes or ()
        return len(set(lanes)) < len(lanes)
