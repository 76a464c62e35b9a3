"""LaneStructure: a model of the open lanes and of the lanes that end, as a value that further traces update (`lane_fit`)."""

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
    open_lanes: int | None = Field(None, ge=1, le=4)
    lane_width_m: float = Field(3.6, gt=2.4, lt=5)  # 12 ft on freeways (AASHTO Green Book), down to 10 in zones (MUTCD 6G)
    lane_width_sd_m: float = Field(0.12, gt=0, le=0.5)  # covers 11 and 12 ft within two of them
    vehicle_width_m: float = Field(1.86, gt=1, lt=3)  # see VehicleGeometry


@dataclass(frozen=True, kw_only=True, eq=False)
class TraceBasis:
    """What all lanes that the traces leave possible have in common; stations and offsets are in the frame of `axis`."""

    spec: LaneStructureSpec
    axis: Road
    before: MapBefore | None  # the road before the zone, where it is known: `axis` is its line then
    table: StationTable
    weights: FloatArray  # (traces,) 1 for a fresh trace, less for one that fades
    speed_mps: float
    path: CommonPath


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneStructure(TraceBasis):
    """A fitted model of the open lanes."""

    levels: LaneLevels
    shifts: tuple[Shift, ...]
    ends: LaneEnds  # of the lanes beside those that go through
    use: LaneUse  # of the lanes that go through
    chance: float  # that the lanes are these
    alternatives: tuple["LaneStructure", ...]  # other lanes that the same traces may have driven in, less likely

    @property
    def closed_side(self) -> str | None:
        """The side that is closed, "left" or "right", as the traffic shows it; None where nobody came from a closed lane."""
        return None if not self.levels.closed else ("left" if self.levels.closed[0] > 0 else "right")
