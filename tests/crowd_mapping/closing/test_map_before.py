from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from crowd_mapping.zone_traces import drive, noisy, zone_layout

from wzsumo.crowd_mapping.belief import occupied
from wzsumo.crowd_mapping.closing.lane_ends import fit_lane_ends
from wzsumo.crowd_mapping.closing.map_before import MapBefore, anchored, with_level_ends
from wzsumo.crowd_mapping.closing.taper_line import fit_taper_line
from wzsumo.crowd_mapping.course.common_path import CommonPath, TraceErrors
from wzsumo.crowd_mapping.course.shifts import Shift
from wzsumo.crowd_mapping.course.station_table import StationTable
from wzsumo.crowd_mapping.hypotheses.announcement import Announcement
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.crowd_mapping.lane_fit import fit_lane_structure, update
from wzsumo.crowd_mapping.lane_model import LaneStructureSpec
from wzsumo.errors import TraceError
from wzsumo.road import RoadSpec


def before_of(layout):
    return MapBefore(road=layout.road, start=layout.start, end=layout.end)


def edge_miss(model, layout):
    """Offset [m] of the model's right edge from the true one in the middle of the activity area."""
    area = layout.area("activity area")
    s = np.array([(area.start + area.end) / 2])
    middle_xy = layout.road.to_xy(s, np.zeros(1))
    along, _ = model.axis.to_sd(middle_xy)
    right = np.interp(along, model.table.stations, model.path.course) + model.levels.right - model.levels.width / 2
    _, edge = layout.road.to_sd(model.axis.to_xy(along, right))
    return float(edge[0] - layout.drivable_right(s)[0])


def zone_whose_closing_lane_nobody_drove():
    """The layout of a zone of three lanes of which the left one closes, and the model of those who came in the others."""
    layout = zone_layout(lanes=3, closed=(2,))
    zone = drive(layout, 16, seed=4)
    s, d = layout.road.to_sd(zone.traces[["x_m", "y_m"]])
    came_from_closed_lane = zone.traces["vehicle_id"][(d > layout.road.lane_span(2)[0] + 0.5) & (s < layout.start)].unique()
    others = zone.traces[~zone.traces["vehicle_id"].isin(came_from_closed_lane)]
    return layout, fit_lane_structure(others, spec=LaneStructureSpec(), before=before_of(layout))


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


def test_drivers_still_on_their_way_back_behind_the_last_device_do_not_shift_the_lanes() -> None:
    # One lane past the work over the opposing one; 30 of the 50 m known behind it are taken up by the way back.
    spec = RoadSpec(
        lane_count=1, lane_width_ft=12, opposing_lane_count=1, left_shoulder_ft=6, right_shoulder_ft=6, length_ft=3600
    )
    road, width = spec.build(), 3.6576
    time = np.arange(0.0, 42.0, 0.1)
    x = 500.0 + 10.0 * time
    y = road.lane_centre(0) + width * np.interp(x, [550.0, 608.0, 820.0, 900.0], [0.0, 1.0, 1.0, 0.0])
    traces = pd.concat(
        pd.DataFrame({
            "vehicle_id": str(i), "time_s": time, "x_m": x, "y_m": y + habit,
            "heading_rad": np.arctan2(np.gradient(y), np.gradient(x)), "speed_mps": 10.0,
        })
        for i, habit in enumerate(np.linspace(-0.3, 0.3, 10))
    )  # fmt: skip
    model = fit_lane_structure(traces, spec=LaneStructureSpec(), before=MapBefore(road=road, start=550.0, end=870.0))
    beside = np.interp(715.0, model.table.stations, model.path.course) + model.levels.right
    assert beside == pytest.approx(road.lane_centre(0) + width, abs=0.05)


def test_lane_that_closes_and_nobody_drove_is_open_up_to_the_taper_and_not_beyond() -> None:
    layout, model = zone_whose_closing_lane_nobody_drove()
    taper = layout.area("merging taper")
    along = np.array([taper.start - 10.0, taper.start, taper.end + 60.0])
    p = occupied(model, along, np.full(3, layout.road.lane_centre(2)))
    assert p[0] < 0.2
    assert p[2] >= 0.5


def test_trace_mistaken_to_drive_in_the_closed_lane_beside_the_work_does_not_hold_its_taper_open() -> None:
    _, model = zone_whose_closing_lane_nobody_drove()
    assert model.levels.closed == ()
    mistaken = model.levels.lanes.copy()
    mistaken[0], mistaken[0, -20:] = 2.0, 1.0
    lines = [
        fit_lane_ends(
            model.table, model.weights, replace(model.levels, lanes=lanes), lanes=(2,), announced=model.before.announced,
            shifts=model.shifts, speed_mps=model.speed_mps, vehicle_width_m=1.86,
        ).closing[2]
        for lanes in (model.levels.lanes, mistaken)
    ]  # fmt: skip
    np.testing.assert_array_equal(lines[1].stations, lines[0].stations)
    np.testing.assert_array_equal(lines[1].probability, lines[0].probability)


def test_course_that_most_traces_leave_for_good_becomes_their_change_of_lanes() -> None:
    stations = np.arange(0.0, 1000.0, 10.0)
    road = RoadSpec(lane_count=3, lane_width_ft=12, left_shoulder_ft=10, right_shoulder_ft=10, length_ft=4000).build()
    before = MapBefore(road=road, start=100.0, end=900.0)
    moved = 3.6576 * np.clip((stations - 400) / 100, 0, 1)
    # Six of seven traces move over; the one that stays seems to change lanes to the right.
    lanes = np.vstack([np.zeros((6, 100)), -moved / 3.6576])
    errors = TraceErrors(drift_m=0.03, noise_m=0.12, bias_m=0.0)
    path = CommonPath(course=moved, lanes=lanes, levels=np.full(7, 5.0), errors=errors, bias_effect=None, cost=0.0)
    level = with_level_ends(path, stations, before)
    assert np.abs(level.course).max() < 0.05
    np.testing.assert_allclose(level.lanes[-1], 0.0, atol=0.02)
    np.testing.assert_allclose(level.lanes[0], moved / 3.6576, atol=0.02)
    offsets = path.course + 3.6576 * path.lanes + path.levels[:, None]
    np.testing.assert_allclose(level.course + 3.6576 * level.lanes + level.levels[:, None], offsets, atol=1e-9)


def test_closed_lane_opens_where_the_zone_is_announced_to_end() -> None:
    layout = zone_layout()
    model = fit_lane_structure(drive(layout, 8, seed=2).traces, spec=LaneStructureSpec(), before=before_of(layout))
    middle = np.full(2, layout.road.lane_centre(1))
    p = occupied(model, np.array([layout.end - 60.0, layout.end + 5.0]), middle)
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


# MUTCD 11th ed., Table 6B-3: a shoulder's taper is a third of L for its own width. Ahead of lanes without a shoulder: none.
@pytest.mark.parametrize(("shoulder", "end_m"), [(0.0, 700.0), (1.0, 700.0 + 200.0 / 3)])
def test_line_of_an_announced_zone_ends_where_the_manual_puts_it(shoulder: float, end_m: float) -> None:
    announcement = Announcement(station=500.0, lanes_before=0, shoulder=shoulder)
    nobody = np.empty((0, 100))
    line = fit_taper_line(
        np.arange(0.0, 1000.0, 10.0), nobody, length=200.0, half_vehicle=0.25, kink=None, announcement=announcement
    )
    median = line.stations[np.searchsorted(np.cumsum(line.probability[1]), 0.5)]
    assert median == pytest.approx(end_m, abs=6)


def beyond_the_announced_line(n, *, doubt):
    """The line of a lane announced to end at 700 m that n vehicles seem to have used up to 850 m."""
    stations = np.arange(0.0, 1200.0, 10.0)
    late = np.repeat(np.where(stations < 850.0, 1.0, 0.0)[None], n, axis=0)
    return fit_taper_line(
        stations, late, length=200.0, half_vehicle=0.25, kink=None, doubts=np.full(n, doubt),
        announcement=Announcement(station=500.0, lanes_before=0, shoulder=0.0),
    )  # fmt: skip


def test_vehicles_that_drove_on_beyond_the_announced_line_move_it() -> None:
    assert beyond_the_announced_line(4, doubt=0.0).end > 950.0


def test_line_that_many_vehicles_moved_lies_just_beyond_the_last_of_them() -> None:
    # Twenty who leave the lane one after the other over 300 m: a line 200 m beyond them all would be a coincidence.
    stations = np.arange(0.0, 1400.0, 10.0)
    leave = np.linspace(550.0, 850.0, 20)
    line = fit_taper_line(
        stations, np.where(stations < leave[:, None], 1.0, 0.0), length=200.0, half_vehicle=0.25, kink=None,
        doubts=np.full(20, 0.05), announcement=Announcement(station=500.0, lanes_before=0, shoulder=0.0),
    )  # fmt: skip
    # Body's outer side at 3/4 of the lane: clear of lines of 200 m that end 150 m on.
    assert 960 < line.end < 1060


def test_vehicle_that_may_have_been_in_another_lane_does_not_move_the_announced_line() -> None:
    assert beyond_the_announced_line(1, doubt=0.3).end == pytest.approx(700, abs=40)


def anchored_with(n_lanes, *, right, closed=(), shifts=()):
    """How well so many open lanes, the first at `right` [m], suit an announced zone on a road of three lanes of 12 ft."""
    road = RoadSpec(lane_count=3, lane_width_ft=12, left_shoulder_ft=10, right_shoulder_ft=10, length_ft=4000).build()
    stations = np.arange(0.0, 1000.0, 10.0)
    offsets = np.full((4, 100), right)
    errors = TraceErrors(drift_m=0.03, noise_m=0.12, bias_m=0.0)
    path = CommonPath(
        course=np.zeros(100), lanes=np.zeros((4, 100)), levels=np.full(4, right), errors=errors, bias_effect=None, cost=0.0
    )  # fmt: skip
    table = StationTable(stations=stations, offsets=offsets, vehicle_ids=("a", "b", "c", "d"), dropped=pd.DataFrame())
    levels = LaneLevels(
        n_lanes=n_lanes, closed=closed, interior=(), closes=0, opens=0, right=right, width=3.6576, covariance=0.01 * np.eye(2),
        outer_width=3.6576, outer_width_sd=0.03, spread=0.3, lanes=np.zeros((4, 100)), hypothesis=None,
    )  # fmt: skip
    before = MapBefore(road=road, start=100.0, end=900.0)
    return anchored(levels, path, table, before, weights=np.ones(4), shifts=shifts).log_fit


LANE_1_M, LANE_2_M = 1.8288, 5.4864  # middles of three lanes of 12 ft


def test_announced_zone_is_unlikely_to_leave_all_lanes_of_the_road_open() -> None:
    # One of MUTCD's six drawings of stationary work on a freeway does.
    ratio = np.exp(anchored_with(3, right=LANE_1_M) - anchored_with(2, right=LANE_1_M))
    assert ratio == pytest.approx(0.2, rel=0.6)


def test_lanes_are_unlikely_to_close_on_both_sides() -> None:
    assert anchored_with(1, right=LANE_2_M) < anchored_with(1, right=LANE_1_M) - 2


def test_lanes_that_shift_to_the_right_are_unlikely_to_pass_a_lane_that_is_closed_there() -> None:
    right = (Shift(start=300.0, end=400.0, size=-3.0), Shift(start=700.0, end=800.0, size=3.0))
    assert anchored_with(2, right=LANE_2_M, shifts=right) < anchored_with(2, right=LANE_1_M, shifts=right) - 2
