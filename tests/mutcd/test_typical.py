"""Each typical application of the manual with a zone that is one, and zones that differ from it in one point."""

from typing import Any

import pytest
from builders import paper_road, paper_work_zone

from wzsumo.errors import SpecError
from wzsumo.mutcd.closure import closure_of
from wzsumo.mutcd.typical import refuse_mismatch, refuse_too_narrow

UNSHIFTED: dict[str, Any] = {"shift_ft": 0, "shifted_lane_width_ft": None}
SHOULDER: dict[str, Any] = {"closed_lanes": (), **UNSHIFTED}
LEFT_LANE: dict[str, Any] = {"closed_lanes": (2,), **UNSHIFTED}
RIGHT_LANE: dict[str, Any] = {"closed_lanes": (0,), "closed_shoulder": "right", **UNSHIFTED}
MIDDLE_LANE: dict[str, Any] = {"closed_lanes": (1,), **UNSHIFTED}
TWO_LANES: dict[str, Any] = {"closed_lanes": (1, 2), **UNSHIFTED}
SHIFT: dict[str, Any] = {"closed_lanes": (), "shift_ft": 0.5, "shifted_lane_width_ft": None}
SIGNAL: dict[str, Any] = {"posted_speed_mph": 45, **RIGHT_LANE, "one_lane_two_way": "signal"}
FLAGGERS: dict[str, Any] = SIGNAL | {"one_lane_two_way": "flaggers"}
SLOW_LEFT_LANE: dict[str, Any] = {"posted_speed_mph": 40, **LEFT_LANE}
BARRIER: dict[str, Any] = {"work_space_device": "barrier"}


def check(name: str, zone: dict[str, Any], *, lane_count: int) -> None:
    by_turns = "one_lane_two_way" in zone
    road = paper_road(lane_count=lane_count, opposing_lane_count=1 if by_turns else 0)
    spec = paper_work_zone(typical_application=name, **zone)
    refuse_too_narrow(spec, road)
    refuse_mismatch(spec, closure_of(spec, road))


ACCEPTED: list[tuple[str, dict[str, Any], int]] = [
    ("TA-3", SHOULDER, 3), ("TA-3", SHOULDER, 1), ("TA-5", SHOULDER, 3), ("TA-10", FLAGGERS, 1), ("TA-12", SIGNAL, 1),
    ("TA-30", SLOW_LEFT_LANE, 3), ("TA-33", LEFT_LANE, 3), ("TA-33", RIGHT_LANE, 3), ("TA-33", RIGHT_LANE, 2),
    ("TA-34", LEFT_LANE | BARRIER, 3), ("TA-36", SHIFT, 3), ("TA-37", TWO_LANES, 3), ("TA-38", MIDDLE_LANE, 3),
]  # fmt: skip
REFUSED: list[tuple[str, dict[str, Any], int, str]] = [
    ("TA-3", LEFT_LANE, 3, "closed_shoulder, no closed_lanes, no shift"),
    ("TA-3", SHIFT, 3, "closed_shoulder, no closed_lanes, no shift"),
    ("TA-5", RIGHT_LANE, 3, "closed_shoulder, no closed_lanes, no shift"),
    ("TA-5", SHOULDER, 1, "needs 2 lanes"),
    ("TA-10", SIGNAL, 1, 'one_lane_two_way = "flaggers"'),
    ("TA-12", FLAGGERS, 1, 'one_lane_two_way = "signal"'),
    ("TA-30", LEFT_LANE, 3, "at 40 mph or less"),
    ("TA-30", {"posted_speed_mph": 40, **RIGHT_LANE}, 3, "beside the opposing ones"),
    ("TA-30", {"posted_speed_mph": 40, **TWO_LANES}, 3, "beside the opposing ones"),
    ("TA-33", TWO_LANES, 3, "one outer lane closed, no shift"),
    ("TA-33", MIDDLE_LANE, 3, "one outer lane closed, no shift"),
    ("TA-33", SHOULDER, 3, "one outer lane closed, no shift"),
    ("TA-33", {"shift_ft": 4}, 3, "one outer lane closed, no shift"),
    ("TA-34", LEFT_LANE, 3, 'work_space_device = "barrier"'),
    ("TA-34", TWO_LANES | BARRIER, 3, "one outer lane closed"),
    ("TA-36", SHOULDER, 3, "shift_ft above 0"),
    ("TA-36", {"shift_ft": 4}, 3, "no closed_lanes"),
    ("TA-37", LEFT_LANE, 3, "two outer lanes"),
    ("TA-37", {"closed_lanes": (1, 2), **UNSHIFTED}, 4, "two outer lanes"),
    ("TA-37", {"closed_lanes": (1,), "closed_shoulder": "left", **UNSHIFTED}, 2, "needs 3 lanes"),
    ("TA-38", LEFT_LANE, 3, "open lanes on both sides"),
    ("TA-38", {"closed_lanes": (1,), **UNSHIFTED}, 2, "needs 3 lanes"),
]


@pytest.mark.parametrize(("name", "zone", "lane_count"), ACCEPTED)
def test_zone_that_the_manual_draws_under_the_name_is_accepted(name: str, zone: dict[str, Any], lane_count: int) -> None:
    check(name, zone, lane_count=lane_count)


@pytest.mark.parametrize(("name", "zone", "lane_count", "rule"), REFUSED)
def test_zone_unlike_the_typical_application_is_refused_with_its_rule(
    name: str, zone: dict[str, Any], lane_count: int, rule: str
) -> None:
    with pytest.raises(SpecError, match=rf'typical_application="{name}".*{rule}'):
        check(name, zone, lane_count=lane_count)


def test_zone_without_a_name_is_no_typical_application() -> None:
    road, zone = paper_road(lane_count=1), paper_work_zone(**SHOULDER)
    refuse_too_narrow(zone, road)
    refuse_mismatch(zone, closure_of(zone, road))


@pytest.mark.parametrize("name", ["TA-30", "TA-33", "TA-34", "TA-36"])
def test_road_with_one_lane_is_too_narrow_for_a_multi_lane_application(name: str) -> None:
    with pytest.raises(SpecError, match=r"needs 2 lanes in the direction of travel, the road has lane_count=1"):
        refuse_too_narrow(paper_work_zone(typical_application=name), paper_road(lane_count=1))
