import pytest

from wzsumo.capacity import SiteSpec, ZoneCapacity, lane_closure_severity_index, zone_capacity
from wzsumo.errors import SpecError
from wzsumo.spec import parse_spec


def capacity(total: int, open_: int, *, speed: float = 60, trucks: float = 0.0, **site: object) -> ZoneCapacity:
    place = SiteSpec.model_validate(site)
    return zone_capacity(total_lanes=total, open_lanes=open_, posted_speed_mph=speed, truck_share=trucks, site=place)


@pytest.mark.parametrize(
    ("total", "open_", "index"),
    [(3, 3, 0.33), (2, 2, 0.50), (4, 3, 0.44), (3, 2, 0.75), (4, 2, 1.00), (2, 1, 2.00), (3, 1, 2.00)],
)
def test_lane_closure_severity_index_equals_the_manuals_exhibit(total: int, open_: int, index: float) -> None:
    assert round(lane_closure_severity_index(total_lanes=total, open_lanes=open_), 2) == index


def test_two_lanes_past_a_hard_barrier_discharge_2070_pc() -> None:
    # 2093 - 154 x 0.5 + 9 x 6, worked by hand from Eq. 10-8.
    assert capacity(2, 2, barrier="hard", lateral_distance_ft=6).queue_discharge_pcphpl == 2070


def test_rural_two_to_one_closure_at_night_discharges_1353_pc() -> None:
    zone = capacity(2, 1, area="rural", light="night")
    assert zone.queue_discharge_pcphpl == 1353


def test_three_to_two_closure_at_night_has_capacity_2053_7_and_factor_0_893() -> None:
    zone = capacity(3, 2, light="night", lateral_distance_ft=6, free_flow_speed_mph=60)
    assert zone.queue_discharge_pcphpl == 1778.5
    assert round(zone.capacity_pcphpl, 1) == 2053.7
    assert round(zone.capacity_adjustment_factor, 3) == 0.893  # of 2,300 pc/h at 60 mph, Eq. 12-6


def test_free_flow_speed_in_the_zone_is_61_09_mph_where_the_sum_by_hand_says_so() -> None:
    # 9.95 + 33.49 + 0.53 x 55 - 5.60 x 0.5 - 8.7 x 1
    zone = capacity(2, 2, speed=55, barrier="hard", free_flow_speed_mph=70, total_ramp_density_per_mile=1)
    assert zone.free_flow_speed_mph == pytest.approx(61.09)
    assert zone.speed_adjustment_factor == pytest.approx(61.09 / 70)


def test_zone_is_never_better_than_the_road_without_it() -> None:
    zone = capacity(2, 2, barrier="hard", lateral_distance_ft=12, free_flow_speed_mph=55)  # 2124 / 0.866 = 2453 pc
    assert zone.capacity_pcphpl == 2250  # 2200 + 10 x 5, Eq. 12-6
    assert zone.capacity_adjustment_factor == 1
    assert zone.free_flow_speed_mph == 55  # 9.95 + 33.49 + 31.8 - 2.8 = 72.4 mph without the cap


def test_limit_lowered_by_more_than_a_fifth_counts_as_a_fifth() -> None:
    assert capacity(2, 1, speed=50, normal_speed_limit_mph=60).free_flow_speed_mph == pytest.approx(
        capacity(2, 1, speed=50, normal_speed_limit_mph=70).free_flow_speed_mph
    )


def test_ten_percent_trucks_cost_an_eleventh_of_the_vehicles() -> None:
    zone = capacity(3, 2, trucks=0.1)
    assert zone.queue_discharge_pcphpl == 1783.5
    assert zone.queue_discharge_all_lanes_vph == pytest.approx(2 * 1783.5 / 1.1)


@pytest.mark.parametrize(
    ("total", "open_", "changes", "says"),
    [
        (1, 1, {}, "road.lane_count=1: .* 2 or more lanes"),
        (2, 0, {}, "0 open lanes must be 1 to 2"),
        (2, 1, {"speed": 40}, "free-flow speed of 45 mph .* 55 to 75 mph"),
        (2, 1, {"normal_speed_limit_mph": 50}, "normal_speed_limit_mph=50 must be at least posted_speed_mph=60"),
        (2, 1, {"free_flow_speed_mph": 80}, "free-flow speed of 80 mph"),
    ],
)
def test_zone_that_the_model_does_not_cover_is_refused(total: int, open_: int, changes: dict[str, float], says: str) -> None:
    with pytest.raises(SpecError, match=says):
        capacity(total, open_, **changes)


@pytest.mark.parametrize(
    ("site", "says"),
    [
        ({"lateral_distance_ft": 13}, "lateral_distance_ft=13"),
        ({"area": "suburban"}, "area='suburban': .*'urban' or 'rural'"),
        ({"night": True}, "night: unknown key .*light"),
    ],
)
def test_site_that_is_impossible_is_refused_with_its_key(site: dict[str, object], says: str) -> None:
    with pytest.raises(SpecError, match=says):
        parse_spec(SiteSpec, site, source="site")
