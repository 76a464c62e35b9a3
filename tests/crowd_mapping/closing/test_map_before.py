import numpy as np
import pandas as pd
import pytest
from crowd_mapping.lane_values import STATIONS, common_path, lane_levels, station_table
from crowd_mapping.zone_traces import drive, noisy, zone_layout

from wzsumo.crowd_mapping.closing.map_before import Anchor, MapBefore, anchor_levels, closing_lanes, course_in_one_lane
from wzsumo.crowd_mapping.course.shifts import Shift
from wzsumo.crowd_mapping.lane_fit import fit_lane_structure, update
from wzsumo.crowd_mapping.lane_model import LaneStructure, LaneStructureSpec
from wzsumo.crowd_mapping.occupancy import p_occupied
from wzsumo.errors import TraceError
from wzsumo.road import Road, RoadSpec
from wzsumo.work_zone import WorkZoneLayout

WIDTH_M = 3.6576  # 12 ft


def before_of(layout: WorkZoneLayout) -> MapBefore:
    return MapBefore(road=layout.road, start=layout.start, end=layout.end)


def edge_miss(model: LaneStructure, layout: WorkZoneLayout) -> float:
    """Offset [m] of the model's right edge from the true one in the middle of the activity area."""
    area = layout.area("activity area")
    s = np.array([(area.start + area.end) / 2])
    middle_xy = layout.road.to_xy(s, np.zeros(1))
    along, _ = model.axis.to_sd(middle_xy)
    right = np.interp(along, model.table.stations, model.path.course) + model.levels.right - model.levels.width / 2
    _, edge = layout.road.to_sd(model.axis.to_xy(along, right))
    return float(edge[0] - layout.drivable_right(s)[0])


def test_lanes_before_and_after_the_zone_take_most_of_the_common_error_away() -> None:
    # 20 traces of 2 m leave the mean of their biases, 0.4 m, in a map without an anchor; 350 m of known lanes tell it.
    layout, alone, joined = zone_layout(), [], []
    for seed in range(4):
        traces = noisy(drive(layout, 20, seed=seed), 2.0, seed=seed, interval_s=1.0)
        spec = LaneStructureSpec()
        alone.append(edge_miss(fit_lane_structure(traces, spec=spec), layout))
        joined.append(edge_miss(fit_lane_structure(traces, spec=spec, before=before_of(layout)), layout))
    assert np.sqrt(np.mean(np.square(joined))) < 0.3
    assert np.sqrt(np.mean(np.square(joined))) < 0.75 * np.sqrt(np.mean(np.square(alone)))


def one_lane_past_the_work() -> tuple[Road, LaneStructure]:
    """A road of one lane of 12 ft that leads over the opposing one past the work, and the model of ten drivers."""
    spec = RoadSpec(
        lane_count=1, lane_width_ft=12, opposing_lane_count=1, left_shoulder_ft=6, right_shoulder_ft=6, length_ft=3600
    )
    road = spec.build()
    time = np.arange(0.0, 42.0, 0.1)
    x = 500.0 + 10.0 * time
    y = road.lane_centre(0) + WIDTH_M * np.interp(x, [550.0, 608.0, 820.0, 900.0], [0.0, 1.0, 1.0, 0.0])
    traces = pd.concat(
        pd.DataFrame({
            "vehicle_id": str(i), "time_s": time, "x_m": x, "y_m": y + habit,
            "heading_rad": np.arctan2(np.gradient(y), np.gradient(x)), "speed_mps": 10.0,
        })
        for i, habit in enumerate(np.linspace(-0.3, 0.3, 10))
    )  # fmt: skip
    before = MapBefore(road=road, start=550.0, end=870.0)
    return road, fit_lane_structure(traces, spec=LaneStructureSpec(), before=before)


def test_drivers_still_on_their_way_back_behind_the_last_device_do_not_shift_the_lanes() -> None:
    # 30 of the 50 m known behind the last device are taken up by the way back.
    road, model = one_lane_past_the_work()
    beside = np.interp(715.0, model.table.stations, model.path.course) + model.levels.right
    assert beside == pytest.approx(road.lane_centre(0) + WIDTH_M, abs=0.05)


def test_width_of_a_single_lane_is_that_of_the_road_to_3_cm_but_for_a_narrowing_of_8_cm() -> None:
    _, model = one_lane_past_the_work()
    assert model.levels.n_lanes == 1
    assert model.levels.width == pytest.approx(WIDTH_M)
    assert model.levels.width_sd == pytest.approx(np.hypot(0.03, 0.08), rel=1e-3)


def test_lane_that_closes_and_nobody_drove_is_open_up_to_the_taper_and_not_beyond() -> None:
    layout = zone_layout(lanes=3, closed=(2,))
    zone = drive(layout, 16, seed=4)
    s, d = layout.road.to_sd(zone.traces[["x_m", "y_m"]].to_numpy())
    came_from_closed_lane = zone.traces["vehicle_id"][(d > layout.road.lane_span(2)[0] + 0.5) & (s < layout.start)].unique()
    others = zone.traces[~zone.traces["vehicle_id"].isin(came_from_closed_lane)]
    model = fit_lane_structure(others, spec=LaneStructureSpec(), before=before_of(layout))
    taper = layout.area("merging taper")
    along = np.array([taper.start - 10.0, taper.start, taper.end + 60.0])
    p = p_occupied(model, along, np.full(3, layout.road.lane_centre(2)))
    assert model.levels.closed == ()
    assert p[0] < 0.2
    assert p[2] >= 0.5


def test_course_that_most_traces_leave_for_good_becomes_their_change_of_lanes() -> None:
    before = MapBefore(road=three_lanes(), start=100.0, end=900.0)
    moved = WIDTH_M * np.clip((STATIONS - 400) / 100, 0, 1)
    # Six of seven traces move over; the one that stays seems to change lanes to the right.
    path = common_path(np.vstack([np.zeros((6, 100)), -moved / WIDTH_M]), np.full(7, 5.0), course=moved)
    level = course_in_one_lane(path, STATIONS, before)
    assert np.abs(level.course).max() < 0.05
    np.testing.assert_allclose(level.lanes[-1], 0.0, atol=0.02)
    np.testing.assert_allclose(level.lanes[0], moved / WIDTH_M, atol=0.02)
    offsets = path.course + WIDTH_M * path.lanes + path.levels[:, None]
    np.testing.assert_allclose(level.course + WIDTH_M * level.lanes + level.levels[:, None], offsets, atol=1e-9)


def test_closed_lane_opens_where_the_zone_is_announced_to_end() -> None:
    layout = zone_layout()
    model = fit_lane_structure(drive(layout, 8, seed=2).traces, spec=LaneStructureSpec(), before=before_of(layout))
    middle = np.full(2, layout.road.lane_centre(1))
    p = p_occupied(model, np.array([layout.end - 60.0, layout.end + 5.0]), middle)
    assert p[0] >= 0.5
    assert p[1] < 0.2


def test_update_keeps_what_was_known_of_the_road() -> None:
    layout = zone_layout()
    traces = drive(layout, 12, seed=1).traces
    late = traces["vehicle_id"].isin(["v10", "v11"])
    model = fit_lane_structure(traces[~late], spec=LaneStructureSpec(), before=before_of(layout))
    updated = update(model, traces[late], keep=1.0)
    assert updated.before is model.before
    assert updated.ends.closing.keys() == model.ends.closing.keys()


def test_announced_zone_that_ends_before_it_begins_is_refused() -> None:
    road = RoadSpec(lane_count=2, left_shoulder_ft=10, right_shoulder_ft=10, length_ft=3000).build()
    with pytest.raises(TraceError, match="must begin before it ends"):
        MapBefore(road=road, start=500.0, end=400.0)


def three_lanes() -> Road:
    return RoadSpec(lane_count=3, lane_width_ft=12, left_shoulder_ft=10, right_shoulder_ft=10, length_ft=4000).build()


def anchor(
    n_lanes: int,
    *,
    right: float,
    closed: tuple[int, ...] = (),
    shifts: tuple[Shift, ...] = (),
    zone: tuple[float, float] = (100.0, 900.0),
    sd_m: float = 0.1,
) -> Anchor:
    """The anchor of so many open lanes, the first at `right` [m], on a road of three lanes, by four traces over 990 m."""
    n_traces, lanes = 4, np.zeros((4, 100))
    levels = lane_levels(
        lanes, n_lanes=n_lanes, closed=closed, right=right, width=WIDTH_M, covariance=sd_m**2 * np.eye(2), spread=0.3
    )
    path, table = common_path(lanes, np.full(n_traces, right)), station_table(np.full((n_traces, 100), right))
    before = MapBefore(road=three_lanes(), start=zone[0], end=zone[1])
    return anchor_levels(levels, path, table, before, weights=np.ones(n_traces), shifts=shifts)


LANE_0_M, LANE_1_M, LANE_2_M = 1.8288, 5.4864, 9.144  # middles of three lanes of 12 ft


def test_lanes_are_those_of_the_road_that_lie_nearest() -> None:
    assert [anchor(1, right=at + 0.4).first_lane for at in (LANE_0_M, LANE_1_M, LANE_2_M)] == [0, 1, 2]


@pytest.mark.parametrize(("start_m", "first_lane"), [(5.0, None), (15.0, 1)])
def test_nothing_is_anchored_to_a_single_station_outside_the_zone(start_m: float, first_lane: int | None) -> None:
    assert anchor(1, right=LANE_1_M, zone=(start_m, 2000.0)).first_lane == first_lane


# Noise 0.12 m at 19 stations outside the zone, drift 0.03 m over 81 inside, of 4 traces; drivers keep the middle to 0.05 m.
def test_level_moves_to_the_roads_lane_as_far_as_it_is_known_less_well_than_that() -> None:
    moved = anchor(1, right=LANE_1_M + 0.4, sd_m=0.1)
    variance = (np.pi / 2 * 0.12**2 / 19 + 0.03**2 * 81 / 6) / 4 + 0.05**2
    gain = 0.1**2 / (0.1**2 + variance)
    assert moved.levels.right == pytest.approx(LANE_1_M + 0.4 - gain * 0.4)
    assert moved.levels.level_sd(0.0) == pytest.approx(np.sqrt((1 - gain) * 0.1**2))


def test_open_lanes_beyond_the_roads_are_impossible() -> None:
    assert anchor(3, right=LANE_0_M, closed=(3,)).log_fit == -np.inf
    assert anchor(4, right=LANE_0_M).log_fit == -np.inf


def test_lanes_that_close_are_all_of_the_road_that_do_not_go_through() -> None:
    before = MapBefore(road=three_lanes(), start=100.0, end=900.0)
    assert closing_lanes(anchor(1, right=LANE_1_M), before) == (-1, 1)
    assert closing_lanes(anchor(1, right=LANE_0_M), before) == (1, 2)


def test_announced_zone_is_unlikely_to_leave_all_lanes_of_the_road_open() -> None:
    # One of MUTCD's six drawings of stationary work on a freeway does. The middle of three lanes is known less well than that
    # of two: its variance is 1 + 1 of a hundredth instead of 1 + 1/4.
    variance = (np.pi / 2 * 0.12**2 / 19 + 0.03**2 * 81 / 6) / 4 + 0.05**2
    of_levels = np.sqrt((0.0125 + variance) / (0.02 + variance))
    ratio = np.exp(anchor(3, right=LANE_0_M).log_fit - anchor(2, right=LANE_0_M).log_fit)
    assert ratio == pytest.approx(0.2 * of_levels)


def test_lanes_close_on_both_sides_with_a_chance_of_a_twentieth() -> None:
    ratio = np.exp(anchor(1, right=LANE_1_M).log_fit - anchor(1, right=LANE_0_M).log_fit)
    assert ratio == pytest.approx(0.05)


def test_lanes_shift_first_towards_the_closed_one_with_a_chance_of_a_twentieth() -> None:
    right = (Shift(start=300.0, end=400.0, size=-3.0), Shift(start=700.0, end=800.0, size=3.0))
    ratio = np.exp(anchor(2, right=LANE_1_M, shifts=right).log_fit - anchor(2, right=LANE_0_M, shifts=right).log_fit)
    assert ratio == pytest.approx(0.05)
