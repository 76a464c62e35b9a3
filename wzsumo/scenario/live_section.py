"""The section [live] of a scenario: the zone changes at a stated time, and a live map tells the ego."""

from typing import Any, Self

from pydantic import Field, model_validator

from wzsumo.errors import SpecError
from wzsumo.mutcd.layout import lay_out
from wzsumo.mutcd.other_states import with_devices_pushed, with_road_closed, without_zone
from wzsumo.road import MAX_ROAD_FT, Road
from wzsumo.spec import Spec
from wzsumo.units import METRES_PER_FOOT
from wzsumo.work_zone import Side, WorkZone, WorkZoneLayout

_OF_WORK_ZONE = (
    "start_ft", "work_length_ft", "closed_lanes", "closed_shoulder", "shift_ft", "shifted_lane_width_ft",
)  # fmt: skip


class ZoneState(Spec):
    """The zone as it stands for a time. Keys of [work_zone] that are left out are as they are there."""

    stands: bool = True  # false: all lanes are open
    start_ft: float | None = Field(None, ge=0, le=MAX_ROAD_FT)  # as in work_zone; None: the value there
    work_length_ft: float | None = Field(None, gt=0, le=MAX_ROAD_FT)  # as in work_zone; None: the value there
    closed_lanes: tuple[int, ...] | None = None  # as in work_zone; None: those there
    closed_shoulder: Side | None = None  # as in work_zone; None: the one there
    shift_ft: float | None = Field(None, ge=0, le=100)  # as in work_zone; None: the value there
    shifted_lane_width_ft: float | None = Field(None, ge=10, le=16)  # as in work_zone; None: the value there
    pushed_from_ft: float | None = Field(None, ge=0, le=MAX_ROAD_FT)  # station from which devices stand in the open lane
    pushed_to_ft: float | None = Field(None, ge=0, le=MAX_ROAD_FT)  # station up to which they do
    pushed_by_ft: float = Field(3.0, gt=0, le=4)  # how far into it; a car still passes in a lane of 12 ft
    road_closed_ft: float | None = Field(None, gt=0, le=MAX_ROAD_FT)  # station of devices across all lanes

    @model_validator(mode="after")
    def _pushed_stretch_is_whole(self) -> Self:
        if (self.pushed_from_ft is None) != (self.pushed_to_ft is None):
            raise ValueError("pushed_from_ft and pushed_to_ft belong together; give both or none")
        if self.pushed_from_ft is not None and not (self.stands and self.pushed_from_ft < (self.pushed_to_ft or 0)):
            raise ValueError("pushed_from_ft must be ahead of pushed_to_ft, in a zone that stands")
        return self

    def layout_on(self, road: Road, work_zone: WorkZone) -> WorkZoneLayout:
        """The layout of the zone in this state. Raises SpecError where it cannot be laid out."""
        layout = lay_out(self.zone_of(work_zone), road)
        if not self.stands:
            layout = without_zone(layout)
        if self.pushed_from_ft is not None and self.pushed_to_ft is not None:
            first, last, by = (METRES_PER_FOOT * ft for ft in (self.pushed_from_ft, self.pushed_to_ft, self.pushed_by_ft))
            layout = with_devices_pushed(layout, first, last, by=by)
        if self.road_closed_ft is not None:
            layout = with_road_closed(layout, METRES_PER_FOOT * self.road_closed_ft)
        return layout

    def zone_of(self, work_zone: WorkZone) -> WorkZone:
        """The work zone with the keys that are otherwise in this state."""
        other: dict[str, Any] = {key: value for key in _OF_WORK_ZONE if (value := getattr(self, key)) is not None}
        if not other:
            return work_zone
        return WorkZone.model_validate(work_zone.model_dump(exclude={"typical_application"}) | other)


class LiveSection(Spec):
    """When the zone changes, from what to what, when the ego sets out, and how it heeds doubts.

    A vehicle drives through the zone as it stands when the vehicle enters the road. Those that enter before the change
    stand for earlier days: all of them report, and their times are stretched so that traces come as often as after it.
    """

    changed_at_s: float = Field(gt=0)  # time of the simulation at which the zone changes
    ego_after_s: float = Field(ge=0)  # time from the change until the ego asks to enter the road
    before: ZoneState = ZoneState(stands=False)  # the zone until it changes; None: all lanes are open
    after: ZoneState = ZoneState()  # the zone from then on; None: as [work_zone] has it
    mapped_traces: int = Field(40, ge=5, le=1000)  # traces that make the first map, before others settle it; chosen by us
    doubtful_share: float = Field(0.5, gt=0, le=1)  # share of an alarm's evidence that makes a place doubtful; chosen by us
    doubtful_speed_share: float = Field(0.7, gt=0, le=1)  # share of the target speed that is driven there; chosen by us

    @model_validator(mode="after")
    def _states_differ(self) -> Self:
        if self.before == self.after:
            raise ValueError("before and after are the same; say in [live.before] or [live.after] what changes")
        return self

    @property
    def ego_sets_out_s(self) -> float:
        """Time [s] at which the ego asks to enter the road."""
        return self.changed_at_s + self.ego_after_s

    def check_times(self, *, warm_up_s: float, duration_s: float) -> None:
        """Raise SpecError where the change comes before the road is full, or the ego sets out after the simulation."""
        if self.changed_at_s <= warm_up_s:
            raise SpecError(
                f"live.changed_at_s={self.changed_at_s:g} must be later than simulation.demand.warm_up_s={warm_up_s:g}"
            )
        if self.ego_sets_out_s >= duration_s:
            raise SpecError(
                f"live: the ego sets out at {self.ego_sets_out_s:g} s; simulation.demand.duration_s={duration_s:g} must be "
                "longer"
            )
