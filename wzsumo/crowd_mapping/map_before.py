"""MapBefore: the road as it was before the work zone, and where the zone is announced on it."""

from dataclasses import dataclass

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.road import Road


@dataclass(frozen=True, kw_only=True, eq=False)
class MapBefore:
    """The road, and the announced zone on it, None where none is announced: then work may be anywhere, or nowhere."""

    road: Road
    announced: AnnouncedZone | None = None

    @property
    def start(self) -> float:
        """Station [m] of the zone's announced beginning, the road's own where none is announced."""
        return 0.0 if self.announced is None else max(self.announced.start_m, 0.0)

    @property
    def end(self) -> float:
        """Station [m] of the zone's announced end, the road's own where none is announced."""
        return self.road.length if self.announced is None else min(self.announced.end_m, self.road.length)

    @property
    def lane_width(self) -> float:
        """Mean width [m] of the lanes of this direction."""
        return self.road.own_width / self.road.own_lanes
