"""The generated kinds of analysis/lane_map: their roads, truths, drivers and receivers against closed forms."""

import numpy as np
import pandas as pd
import pytest
import shapely
from alignment import Alignment
from cases import Case
from kinds import KINDS
from layouts import Layout
from receivers import RECEIVERS, receiver_of

FOOT = 0.3048
CLOSED = ["left", "right", "middle", "double", "left_r400", "half_taper", "left_2_of_4", "left_shift", "narrowed", "crossover"]


def layout_of(case: Case) -> Layout:
    assert case.layout is not None
    return case.layout


def test_arc_follows_a_circle() -> None:
    quarter = Alignment(pieces=((50 * np.pi, 1 / 100.0),))
    places = quarter.to_xy(np.array([0.0, 50 * np.pi, 50 * np.pi + 7]), np.array([0.0, 10.0, 0.0]))
    assert places == pytest.approx(np.array([[0, 0], [90, 100], [100, 107]]), abs=1e-9)


def test_s_bend_comes_back_to_its_heading_beside_its_line() -> None:
    bend = Alignment(pieces=((30.0, 0.0), (100.0, 1 / 200), (100.0, -1 / 200), (30.0, 0.0)), pose=(5.0, 3.0, np.pi / 2))
    (x, y), heading = bend.to_xy(np.array([260.0]), np.zeros(1))[0], bend.heading(np.array([260.0]))
    assert heading == pytest.approx(np.pi / 2)
    assert x == pytest.approx(5.0 - 2 * 200 * (1 - np.cos(0.5)))
    assert y == pytest.approx(3.0 + 60 + 2 * 200 * np.sin(0.5))


@pytest.mark.parametrize(("name", "lanes", "count"), [("left", 2, 1), ("right", 2, 1), ("left_6", 6, 1), ("left_2_of_4", 4, 2)])
def test_truth_of_a_straight_zone_has_the_area_of_its_strips_and_tapers(name: str, lanes: int, count: int) -> None:
    case = KINDS[name].case(n=1, seed=4)
    layout = layout_of(case)
    begin, closed, end, opened = layout.closures[0].at
    assert closed - begin == pytest.approx(count * (layout.width / FOOT) * 60 * FOOT)  # W S of 60 mph, in feet
    assert opened - end == pytest.approx(count * 100 * FOOT)
    taken = count * layout.width * ((closed - begin) / 2 + (end - closed) + (opened - end) / 2)
    assert case.drivable.area == pytest.approx((1500 - 60) * lanes * layout.width - taken, rel=1e-6)


def test_tapers_of_half_and_double_length_are_so() -> None:
    halves, doubles = (layout_of(KINDS[name].case(n=1, seed=2)) for name in ("half_taper", "double_taper"))
    for layout, factor in ((halves, 0.5), (doubles, 2.0)):
        begin, closed, *_ = layout.closures[0].at
        assert closed - begin == pytest.approx(factor * layout.width * 60)


def test_second_taper_of_a_double_closure_deviates_from_the_manual() -> None:
    gaps = []
    for seed in range(1, 21):
        layout = layout_of(KINDS["double"].case(n=1, seed=seed))
        first, second = layout.closures
        gaps.append((second.at[0] - first.at[1]) / (layout.width * 60))
    assert min(gaps) < 0.5  # the manual asks for 2 L
    assert 1.2 < max(gaps) < 2


def test_middle_lane_that_is_closed_is_a_hole_in_the_truth() -> None:
    case = KINDS["middle"].case(n=1, seed=3)
    layout = layout_of(case)
    begin, closed, end, opened = layout.closures[0].at
    hole = layout.width * ((closed - begin) / 2 + (end - closed) + (opened - end) / 2)
    assert case.drivable.area == pytest.approx((1500 - 60) * 3 * layout.width - hole, rel=1e-6)
    assert len(shapely.get_parts(case.drivable.boundary)) == 2


def test_crossover_moves_its_lane_on_to_the_other_carriageway() -> None:
    case = KINDS["crossover"].case(n=1, seed=3)
    layout = layout_of(case)
    (move,) = layout.moves
    middle = np.array([(move.at[1] + move.at[2]) / 2])
    right, left = layout.edges(middle)
    assert 15 + layout.width < right[0] < 20 + layout.width
    assert left - right == pytest.approx(layout.width)
    assert left[0] > 2 * layout.width + 4 * FOOT  # beyond the left shoulder of before


@pytest.mark.parametrize(("name", "leaves"), [("on_ramp", False), ("off_ramp", True)])
def test_ramps_have_an_auxiliary_lane_of_200_m_with_a_taper_of_60_m(name: str, leaves: bool) -> None:
    case = KINDS[name].case(n=1, seed=5)
    layout = layout_of(case)
    assert layout.ramp is not None
    gore = layout.ramp.gore
    lane = (gore - 260, gore) if leaves else (gore, gore + 260)
    beside = case.before().road.strip(200 + lane[0], 200 + lane[1], -10.0, 0.0)
    assert case.drivable.intersection(beside).area == pytest.approx(layout.width * (200 + 60 / 2), rel=1e-3)
    # Beyond the gore the ramp runs away with a radius of 700 m to a slope of 0.1: 3.5 m after 70 m, then 0.1 a metre.
    far = gore + (120 if leaves else -120)
    expected = -(3.5 + 5.0 + layout.width / 2)
    x, y = layout.to_xy(
        np.full(3, far), np.array([expected, expected + layout.width / 2 + 0.05, expected - layout.width / 2 - 0.05])
    ).T
    assert list(shapely.contains_xy(case.drivable, x, y)) == [True, False, False]


@pytest.mark.parametrize("name", ["on_ramp", "off_ramp", "exit_in_zone"])
def test_drivers_of_ramps_keep_on_the_open_ground(name: str) -> None:
    case = KINDS[name].case(n=40, seed=6, receivers="0")
    x, y = case.traces[["x_m", "y_m"]].to_numpy().T
    inside = shapely.contains_xy(case.scored, x, y)
    _, offset = case.before().road.to_sd(np.column_stack([x, y]))
    assert (offset[inside] < -2).sum() > 30
    assert shapely.contains_xy(case.drivable, x[inside], y[inside]).all()


@pytest.mark.parametrize("name", ["left", "right_r900", "left_s_bend", "on_ramp", "shift", "crossover_2"])
def test_truth_lies_where_the_road_file_says(name: str) -> None:
    case = KINDS[name].case(n=2, seed=5)
    layout, before = layout_of(case), case.before()
    s = np.linspace(60, 1400, 200)
    right, left = layout.edges(s)
    for d in (right, left):
        station, offset = before.road.to_sd(layout.to_xy(s, d))
        assert offset == pytest.approx(d, abs=0.02)
        assert station - 200 == pytest.approx(s, abs=0.4)  # stations of chords of arcs
    assert before.start - 200 == pytest.approx(layout.announced[0], abs=0.4)
    assert before.end - 200 == pytest.approx(layout.announced[1], abs=0.4)


def test_no_side_of_road_or_map_is_parallel_to_an_axis() -> None:
    for seed in range(1, 6):
        heading = layout_of(KINDS["none"].case(n=1, seed=seed)).alignment.pose[2]
        assert 0.02 < abs((heading + np.pi / 4) % (np.pi / 2) - np.pi / 4) < 0.15


def test_shifted_announcement_and_road_are_off_by_what_was_asked_for() -> None:
    exact = KINDS["left"].case(n=2, seed=5)
    late = KINDS["left"].case(n=2, seed=5, announced_shift_m=300.0).before()
    beside = KINDS["left"].case(n=2, seed=5, road_offset_m=5.0).before()
    _, true = exact.before().road.to_sd(exact.traces[["x_m", "y_m"]].to_numpy())
    _, drawn = beside.road.to_sd(exact.traces[["x_m", "y_m"]].to_numpy())
    moved = KINDS["left"].case(n=2, seed=5, common_offset_m=1.5)
    _, seen = exact.before().road.to_sd(moved.traces[["x_m", "y_m"]].to_numpy())
    assert late.start - exact.before().start == pytest.approx(300, abs=0.1)
    assert true - drawn == pytest.approx(5.0, abs=0.002)  # points of road files have millimetres
    assert seen - true == pytest.approx(1.5, abs=0.002)


@pytest.mark.parametrize("name", CLOSED)
def test_drivers_keep_on_the_open_ground_and_clear_of_devices(name: str) -> None:
    case = KINDS[name].case(n=30, seed=6, receivers="0", interval_s=0.5)
    layout = layout_of(case)
    points = case.traces[["x_m", "y_m"]].to_numpy()
    inside = shapely.contains_xy(case.scored, *points.T)
    assert inside.mean() > 0.9
    assert shapely.contains_xy(case.drivable, *points[inside].T).all()
    station, offset = case.before().road.to_sd(points)
    s = station - 200
    closed_lines = {
        "left": layout.edges(s)[1] - offset,
        "right": offset - layout.edges(s)[0],
        "middle": np.maximum(layout.hole(s)[0] - offset, offset - layout.hole(s)[1]),
    }
    for closure in layout.closures:
        beside = (s > closure.at[0]) & (s < closure.at[3])
        assert (closed_lines[closure.side][beside] > 0.93).all()  # half of a vehicle


def test_some_drivers_leave_the_closing_lane_as_late_as_in_its_taper_and_some_early() -> None:
    case = KINDS["left"].case(n=150, seed=7, receivers="0")
    layout = layout_of(case)
    station, offset = case.before().road.to_sd(case.traces[["x_m", "y_m"]].to_numpy())
    fixes = case.traces.assign(s=station - 200, inside=offset > layout.width)
    begin, closed, *_ = layout.closures[0].at
    last = fixes[fixes["inside"] & (fixes["s"] < closed)].groupby("vehicle_id")["s"].max()
    assert len(last) > 20
    assert 0.02 < (last > begin).mean() < 0.5
    assert (last < begin - 100).mean() > 0.2
    assert ((fixes["s"] > closed + 5) & (fixes["s"] < layout.closures[0].at[2]) & fixes["inside"]).sum() == 0


def test_some_drivers_are_back_in_the_lane_that_was_closed_soon_after_it_opens() -> None:
    case = KINDS["right"].case(n=150, seed=7, receivers="0")
    layout = layout_of(case)
    station, offset = case.before().road.to_sd(case.traces[["x_m", "y_m"]].to_numpy())
    s, opened = station - 200, layout.closures[0].at[3]
    share_before, share_after = ((offset < layout.width)[(s > at) & (s < at + 60)].mean() for at in (0.0, opened + 200))
    # Half of them go back, by 200 m behind the opening 1 - exp(-200 / 300) of those, less those still changing lanes.
    assert 0.1 * share_before < share_after < 0.4 * share_before


def test_first_of_more_vehicles_are_the_same_vehicles() -> None:
    few, many = (KINDS["right"].case(n=n, seed=8, receivers="mixed").traces for n in (4, 9))
    pd.testing.assert_frame_equal(few, many[many["vehicle_id"].isin(few["vehicle_id"].unique())])


def test_other_carriageway_is_driven_the_other_way_beside_the_road() -> None:
    case = KINDS["both_directions"].case(n=5, seed=2, receivers="0")
    station, offset = case.before().road.to_sd(case.traces[["x_m", "y_m"]].to_numpy())
    fixes = case.traces.assign(s=station, d=offset)
    along = fixes.groupby("vehicle_id")["s"].agg(lambda s: s.iloc[-1] - s.iloc[0])
    assert (along > 0).sum() == 5
    assert (along < 0).sum() == 3
    beside = fixes[fixes["vehicle_id"].isin(along.index[along < 0])]["d"]
    assert beside.min() > 2 * layout_of(case).width + 12


@pytest.mark.parametrize("name", ["0.5", "1", "2", "2_drift"])
def test_receivers_err_by_their_standard_deviation_and_forget_within_their_time(name: str) -> None:
    ((_, receiver),) = RECEIVERS[name]
    t = np.array([0.0, 40.0])
    drawn = np.array([receiver.errors(t, np.random.default_rng(seed)) for seed in range(4000)])
    assert np.sqrt(np.mean(drawn**2)) == pytest.approx(receiver.error, rel=0.03)
    correlation = np.mean(drawn[:, 0] * drawn[:, 1]) / np.mean(drawn**2)
    constant, drifting = (0.0, 1.0) if name == "2_drift" else (0.5, 0.45)
    assert correlation == pytest.approx(constant + drifting / np.e, abs=0.03)


def test_mixed_crowd_has_half_good_three_tenths_middling_and_a_fifth_bad_receivers() -> None:
    errors = [receiver_of("mixed", seed=1, number=number).error for number in range(4000)]
    shares = {error: errors.count(error) / 4000 for error in (0.5, 1.5, 4.0)}
    assert shares == pytest.approx({0.5: 0.5, 1.5: 0.3, 4.0: 0.2}, abs=0.03)


def test_stated_accuracy_is_that_of_each_receiver() -> None:
    silent, stated = (KINDS["left"].case(n=6, seed=3, receivers="mixed", states_accuracy=said).traces for said in (False, True))
    assert list(silent) == ["vehicle_id", "time_s", "x_m", "y_m"]
    pd.testing.assert_frame_equal(stated[list(silent)], silent)
    by_vehicle = stated.groupby("vehicle_id")["position_sd_m"].unique()
    assert [list(errors) for errors in by_vehicle] == [[receiver_of("mixed", seed=3, number=k).error] for k in range(6)]


def test_one_vehicle_jumps_by_3_6_m_for_7_s() -> None:
    calm, jumps = (KINDS["left"].case(n=5, seed=3, receivers="0", faults=faults).traces for faults in ((), ("jump",)))
    moved = np.hypot(*(jumps[["x_m", "y_m"]] - calm[["x_m", "y_m"]]).to_numpy().T)
    assert jumps["vehicle_id"][moved > 1].nunique() == 1
    assert (moved > 1).sum() in (6, 7, 8)
    assert moved.max() == pytest.approx(3.6, abs=0.01)


def test_work_truck_stands_for_five_minutes_in_the_closed_lane() -> None:
    case = KINDS["left"].case(n=6, seed=3, receivers="0", faults=("truck2",))
    station, offset = case.before().road.to_sd(case.traces[["x_m", "y_m"]].to_numpy())
    layout = layout_of(case)
    begin, end = layout.closures[0].at[1:3]
    closed = (station - 200 > begin) & (station - 200 < end) & (offset > layout.width)
    fixes = case.traces[closed].groupby("vehicle_id").size()
    assert len(fixes) == 2
    assert (fixes > 300).all()


@pytest.mark.parametrize(("interval_s", "per_second"), [(0.01, 100), (30.0, 1 / 30)])
def test_sampling_is_what_was_asked_for(interval_s: float, per_second: float) -> None:
    traces = KINDS["none"].case(n=2, seed=1, interval_s=interval_s).traces
    steps = traces.groupby("vehicle_id")["time_s"].diff().dropna()
    assert steps.to_numpy() == pytest.approx(1 / per_second)
    assert traces.groupby("vehicle_id").size().min() >= 1
