"""The zone that is to be placed, as its file says it: keys as in scenarios, but the place and, where left out, the speed."""

from typing import Any, Self

from pydantic import Field

from wzsumo.errors import PlacementError
from wzsumo.spec import Spec, parse_spec
from wzsumo.tapers import STOPPING_SIGHT_DISTANCE_FT
from wzsumo.units import METRES_PER_FOOT, mph_from_mps
from wzsumo.work_zone import Side, WorkZone

POSTED_STEP_MPH = 5  # speeds are posted in multiples of it: MUTCD 11th ed., Section 2B.21
FREEWAY_MPH = 45  # below that, a road whose zone names no type is hardly a freeway; chosen by us
_PLACEHOLDER = {"start_ft": 0.0}  # the place says where the zone begins


class Shoulders(Spec):
    """Paved shoulders of the road; a SUMO network has none."""

    left_shoulder_ft: float = Field(0.0, ge=0, le=30)
    right_shoulder_ft: float = Field(0.0, ge=0, le=30)

    @property
    def widths(self) -> tuple[float, float]:
        """(left, right) [m]."""
        return self.left_shoulder_ft * METRES_PER_FOOT, self.right_shoulder_ft * METRES_PER_FOOT


class ZoneToPlace(Spec):
    """The sections of a zone's file: [work_zone] without a station, and the shoulders in [road]."""

    work_zone: dict[str, Any]
    road: Shoulders = Shoulders()

    @classmethod
    def of_content(cls, content: dict[str, Any], *, source: str) -> Self:
        """The zone of the content of a TOML file. Raises SpecError: file, key, value, rule."""
        if set(content) <= set(WorkZone.model_fields):  # the keys of the zone alone
            content = {"work_zone": content}
        zone = parse_spec(cls, content, source=source)
        parse_spec(WorkZone, {"posted_speed_mph": 45.0} | zone.work_zone | _PLACEHOLDER, source=f"{source}: work_zone")
        return zone

    def at_speed(self, speed: float) -> tuple[WorkZone, list[str]]:
        """The zone with the net's speed [m/s] posted where the file posts none, and what there is to doubt in that."""
        given = dict(self.work_zone)
        doubts = []
        if "posted_speed_mph" not in given:
            lowest, highest = min(STOPPING_SIGHT_DISTANCE_FT), max(STOPPING_SIGHT_DISTANCE_FT)
            nearest = POSTED_STEP_MPH * round(mph_from_mps(speed) / POSTED_STEP_MPH)
            given["posted_speed_mph"] = min(max(nearest, lowest), highest)
            if nearest != given["posted_speed_mph"]:
                doubts.append(
                    f"the net's speed, {speed:.1f} m/s, is {nearest} mph, outside the manual's tables: the zone is laid out "
                    f"for {given['posted_speed_mph']} mph"
                )
        zone = WorkZone.model_validate(given | _PLACEHOLDER)
        if "road_type" not in given and zone.posted_speed_mph < FREEWAY_MPH:
            doubts.append(
                f"road_type is left out: signs and arrow boards are those of a freeway, at {zone.posted_speed_mph:g} mph; give "
                'road_type = "urban_low_speed", "urban_high_speed" or "rural" on another road'
            )
        return zone, doubts


def on_side(zone: WorkZone, side: Side | None, *, n_lanes: int) -> WorkZone:
    """The zone with as many lanes closed, but on this side of a carriageway of `n_lanes`; None leaves it as it is."""
    if zone.one_lane_two_way:
        raise PlacementError(
            f'work_zone.one_lane_two_way="{zone.one_lane_two_way}" needs signals of its own and cannot be placed in a network; '
            "close lanes that leave one open in their own direction"
        )
    if side is None:
        return zone
    count = len(zone.closed_lanes)
    closed = tuple(range(n_lanes - count, n_lanes) if side == "left" else range(count))
    shoulder = side if zone.closed_shoulder or not count else None
    return zone.model_copy(update={"closed_lanes": closed, "closed_shoulder": shoulder})
