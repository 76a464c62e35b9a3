"""LaneStructure: a model of the lanes as one value, from which maps are made and which further traces update (`lane_fit`)."""

from dataclasses import dataclass

from pydantic import Field

from wzsumo.crowd_mapping.closing.lane_ends import LaneEnds
from wzsumo.crowd_mapping.closing.lane_use import LaneUse
from wzsumo.crowd_mapping.closing.map_before import MapBefore
from wzsumo.crowd_mapping.course.common_path import CommonPath
from wzsumo.crowd_mapping.course.shifts import Shift
from wzsumo.crowd_mapping.course.station_table import StationTable
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.frames import FloatArray
from wzsumo.road import Road
from wzsumo.spec import Spec


class LaneStructureSpec(Spec):
    """What is known beforehand of the lanes. Everything may be left out."""

    posted_speed_mph: float | None = Field(None, ge=20, le=75)  # decides the tapers' length; None: from the traces' speeds
    open_lanes: int | None = Field(None, ge=1, le=4)  # lanes that are open all along; None: from the traces
    lane_width_m: float = Field(3.6, gt=2.4, lt=5)  # 12 ft on freeways (AASHTO Green Book), down to 10 in zones (MUTCD 6G)
    lane_width_sd_m: float = Field(0.12, gt=0, le=0.5)  # 11 and 12 ft lie within two of them
    vehicle_width_m: float = Field(1.86, gt=1, lt=3)  # see VehicleGeometry


@dataclass(frozen=True, kw_only=True, eq=False)
class TraceBasis:
    """What all hypotheses about the same traces have in common; stations and offsets [m] are in the frame of `axis`.

    `before` is the road before the zone where that is known, and then `axis` is its line. `weights` (traces,) are 1 for fresh
    traces and less for those that fade. `speed_mps` decides the tapers' lengths.
    """

    spec: LaneStructureSpec
    axis: Road
    before: MapBefore | None
    table: StationTable
    weights: FloatArray
    speed_mps: float
    path: CommonPath


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneStructure(TraceBasis):
    """The likeliest lanes for some traces, and less likely ones.

    `levels` and `use` are of the lanes that go through, `ends` of the lanes beside them. `chance` is the probability of these
    lanes; `alternatives` are other lanes that the same traces may have driven in, with theirs.
    """

    levels: LaneLevels
    shifts: tuple[Shift, ...]
    ends: LaneEnds
    use: LaneUse
    chance: float
    alternatives: tuple["LaneStructure", ...]

    @property
    def closed_side(self) -> str | None:
        """The closed side, "left" or "right", as the traces show it; None where no trace came from a closed lane beside."""
        return None if not self.levels.closed else ("left" if self.levels.closed[0] > 0 else "right")
