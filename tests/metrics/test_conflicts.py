from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import Polygon, affinity, box

from wzsumo.errors import InputError, TraceError
from wzsumo.frames import FloatArray
from wzsumo.metrics.conflicts import (
    CONFLICT_COLUMNS,
    box_approach,
    boxes_overlap,
    conflicts_with_traffic,
    post_encroachment_time,
)

CAR = (4.64, 1.86)
TRUCK = (16.5, 2.55)


Pose = Sequence[float] | FloatArray


def shapely_box(pose: Pose, size: tuple[float, float]) -> Polygon:
    length, width = size
    outline = box(-length / 2, -width / 2, length / 2, width / 2)
    turned: Polygon = affinity.rotate(outline, pose[2], origin=(0, 0), use_radians=True)
    return affinity.translate(turned, pose[0], pose[1])


def straight_track(*, start: tuple[float, float], heading: float, speed: float, n: int, dt: float) -> FloatArray:
    travelled = speed * dt * np.arange(n)
    return np.column_stack(
        [start[0] + travelled * np.cos(heading), start[1] + travelled * np.sin(heading), np.full(n, heading)]
    )


def trace_table(track: FloatArray, *, vehicle_id: str, speed: float, dt: float, first_time: float = 0.0) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "vehicle_id": vehicle_id, "time_s": first_time + dt * np.arange(len(track)),
            "x_m": track[:, 0], "y_m": track[:, 1], "heading_rad": track[:, 2],
            "speed_mps": speed, "length_m": CAR[0], "width_m": CAR[1],
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    ("gap_m", "rear", "front", "ttc", "drac"),
    [
        (20.0, 25.0, 15.0, 2.0, 2.5),  # 10 m/s too fast over 20 m: 20 / 10 s, 10^2 / (2 x 20) m/s2
        (20.0, 15.0, 15.0, np.inf, 0.0),
        (20.0, 10.0, 15.0, np.inf, 0.0),
        (0.0, 10.0, 5.0, 0.0, np.inf),
        (-1.0, 5.0, 5.0, 0.0, 0.0),  # in contact, at one speed
        (8.0, 4.0, 0.0, 2.0, 1.0),
    ],
)
def test_boxes_in_line_have_hayward_s_time_and_cooper_and_ferguson_s_deceleration(
    gap_m: float, rear: float, front: float, ttc: float, drac: float
) -> None:
    approach = box_approach((0, 0, 0), (4, 2), (4 + gap_m, 0, 0), (4, 2), speed_a=rear, speed_b=front)
    assert (float(approach.ttc), float(approach.drac)) == (ttc, drac)


def test_approaches_of_arrays_have_the_shape_of_the_arrays() -> None:
    gaps = np.array([[10.0, 20.0], [30.0, 40.0]])
    ahead = np.stack([gaps + 4, np.zeros((2, 2)), np.zeros((2, 2))], axis=-1)
    approach = box_approach((0, 0, 0), (4, 2), ahead, (4, 2), speed_a=12.0, speed_b=10.0)
    np.testing.assert_allclose(approach.ttc, gaps / 2)
    np.testing.assert_allclose(approach.drac, 2 / gaps)


@given(
    x=st.floats(-12, 12), y=st.floats(-12, 12), heading_a=st.floats(-4, 4), heading_b=st.floats(-4, 4),
    size_b=st.sampled_from([CAR, TRUCK, (0.6, 0.6)]),
)  # fmt: skip
def test_boxes_overlap_exactly_where_shapely_says_they_intersect(
    x: float, y: float, heading_a: float, heading_b: float, size_b: tuple[float, float]
) -> None:
    pose_a, pose_b = (1.0, -2.0, heading_a), (1.0 + x, -2.0 + y, heading_b)
    a, b = shapely_box(pose_a, CAR), shapely_box(pose_b, size_b)
    # On the edge itself rounding decides, so a hair's breadth either way is left out.
    touching = a.distance(b) < 1e-9 and a.intersection(b).area < 1e-9
    if not touching:
        assert bool(boxes_overlap(pose_a, CAR, pose_b, size_b)) == a.intersects(b)


def test_overlap_of_many_boxes_with_one_equals_shapely_for_each() -> None:
    rng = np.random.default_rng(7)
    poses = np.column_stack([rng.uniform(-10, 10, (2000, 2)), rng.uniform(-np.pi, np.pi, 2000)])
    truck = shapely_box((0.0, 0.0, 0.3), TRUCK)
    expected = [shapely_box(pose, CAR).intersects(truck) for pose in poses]
    np.testing.assert_array_equal(boxes_overlap(poses, CAR, (0.0, 0.0, 0.3), TRUCK), expected)
    assert 200 < sum(expected) < 1800


def test_absent_vehicle_overlaps_none_and_is_on_no_collision_course() -> None:
    absent = (np.nan, np.nan, np.nan)
    assert not boxes_overlap(absent, CAR, (0, 0, 0), CAR)
    approach = box_approach(absent, CAR, (0, 0, 0), CAR, speed_a=np.nan, speed_b=1.0)
    assert (approach.ttc.item(), approach.drac.item()) == (np.inf, 0.0)


@given(gap=st.floats(0.1, 200), rear=st.floats(0, 40), front=st.floats(0, 40), heading=st.floats(-3.1, 3.1))
def test_approach_of_boxes_in_one_lane_is_ttc_and_drac_of_the_bumper_gap(
    gap: float, rear: float, front: float, heading: float
) -> None:
    apart = gap + CAR[0]
    ahead = (apart * np.cos(heading), apart * np.sin(heading), heading)
    approach = box_approach((0, 0, heading), CAR, ahead, CAR, speed_a=rear, speed_b=front)
    if rear - front > 1e-3:  # at equal speeds rounding of the heading decides the sign
        np.testing.assert_allclose(approach.ttc, gap / (rear - front), rtol=1e-6)
        np.testing.assert_allclose(approach.drac, (rear - front) ** 2 / (2 * gap), rtol=1e-6)
    elif front - rear > 1e-3:
        assert (approach.ttc.item(), approach.drac.item()) == (np.inf, 0.0)


def test_approach_at_a_right_angle_is_the_time_at_which_the_front_reaches_the_others_side() -> None:
    crossing = box_approach((-30.0, 0, 0), CAR, (0, -20.0, np.pi / 2), CAR, speed_a=15.0, speed_b=10.0)
    # a's front needs (30 - 2.32 - 0.93) / 15 s to b's lane; b's front is in a's lane from (20 - 2.32 - 0.93) / 10 s on.
    assert crossing.ttc == pytest.approx(max(26.75 / 15, 16.75 / 10))
    assert crossing.drac == pytest.approx(np.hypot(15, 10) / (2 * 26.75 / 15))


def test_approach_side_by_side_in_parallel_lanes_never_meets() -> None:
    beside = box_approach((0, 0, 0), CAR, (10.0, 3.6, 0), CAR, speed_a=30.0, speed_b=10.0)
    assert (beside.ttc.item(), beside.drac.item()) == (np.inf, 0.0)


@given(
    x=st.floats(-60, 60), y=st.floats(-60, 60), heading=st.floats(-3.1, 3.1),
    speed_a=st.floats(0, 30), speed_b=st.floats(0, 30),
)  # fmt: skip
def test_boxes_first_touch_at_the_time_to_collision(x: float, y: float, heading: float, speed_a: float, speed_b: float) -> None:
    pose_b = (x, y, heading)
    ttc = float(box_approach((0, 0, 0), CAR, pose_b, TRUCK, speed_a=speed_a, speed_b=speed_b).ttc)

    def distance(time: float) -> float:
        moved = (x + speed_b * time * np.cos(heading), y + speed_b * time * np.sin(heading), heading)
        return shapely_box((speed_a * time, 0, 0), CAR).distance(shapely_box(moved, TRUCK))

    if ttc == 0:
        assert distance(0) < 1e-6
    elif ttc < 1e3:
        assert distance(ttc) < 1e-6
        assert all(distance(share * ttc) > 0 for share in (0.0, 0.3, 0.6, 0.9))
    else:
        assert all(distance(time) > 0 for time in np.linspace(0, 20, 9))


def test_pet_in_car_following_is_the_net_time_gap() -> None:
    leader = straight_track(start=(24.64, 0.0), heading=0.0, speed=10.0, n=400, dt=0.05)
    follower = straight_track(start=(0.0, 0.0), heading=0.0, speed=10.0, n=400, dt=0.05)
    assert post_encroachment_time(follower, CAR, leader, CAR, dt=0.05, horizon_s=5.0) == pytest.approx(2.0, abs=0.05)


def test_pet_at_a_crossing_is_arrival_of_the_second_less_departure_of_the_first() -> None:
    # Crossing area |x|, |y| < 0.93. a leaves it at (30 + 0.93 + 2.32) / 10 s, b comes to it at (80 - 0.93 - 2.32) / 16 s.
    a = straight_track(start=(-30.0, 0.0), heading=0.0, speed=10.0, n=800, dt=0.01)
    b = straight_track(start=(0.0, -80.0), heading=np.pi / 2, speed=16.0, n=800, dt=0.01)
    expected = 76.75 / 16 - 33.25 / 10
    assert post_encroachment_time(a, CAR, b, CAR, dt=0.01, horizon_s=5.0) == pytest.approx(expected, abs=0.01)
    assert post_encroachment_time(b, CAR, a, CAR, dt=0.01, horizon_s=5.0) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(("lateral_m", "expected"), [(1.9, np.inf), (1.8, 0.0)])
def test_pet_counts_outlines_and_not_centres(lateral_m: float, expected: float) -> None:
    a = straight_track(start=(0.0, 0.0), heading=0.0, speed=10.0, n=100, dt=0.1)
    b = straight_track(start=(30.0, lateral_m), heading=np.pi, speed=10.0, n=100, dt=0.1)
    assert post_encroachment_time(a, CAR, b, CAR, dt=0.1, horizon_s=5.0) == expected


def test_pet_equals_the_least_lag_of_all_pairs_of_rows_that_overlap() -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        turn = np.cumsum(rng.normal(0, 0.08, (2, 60)), axis=1) + rng.uniform(-3, 3, (2, 1))
        a, b = (
            np.column_stack([np.cumsum(np.cos(h)) + rng.uniform(-8, 8), np.cumsum(np.sin(h)) + rng.uniform(-8, 8), h])
            for h in turn
        )
        lags = [
            abs(i - j)
            for i in range(60)
            for j in range(60)
            if shapely_box(a[i], CAR).intersects(shapely_box(b[j], CAR)) and abs(i - j) <= 20
        ]
        expected = min(lags) * 0.1 if lags else np.inf
        assert post_encroachment_time(a, CAR, b, CAR, dt=0.1, horizon_s=2.0) == pytest.approx(expected)


def test_conflicts_of_a_vehicle_closing_in_on_a_leader_and_passing_another_lane() -> None:
    dt = 0.1
    ego = trace_table(straight_track(start=(0, 0), heading=0, speed=20.0, n=30, dt=dt), vehicle_id="ego", speed=20.0, dt=dt)
    ahead = straight_track(start=(54.64, 0), heading=0, speed=10.0, n=30, dt=dt)
    beside = straight_track(start=(20, 3.6), heading=0, speed=15.0, n=40, dt=dt)
    traffic = pd.concat(
        [
            trace_table(ahead, vehicle_id="b_ahead", speed=10.0, dt=dt),
            trace_table(beside, vehicle_id="a_beside", speed=15.0, dt=dt, first_time=1.0),
        ]
    )
    table = conflicts_with_traffic(ego, traffic, dt=dt)
    assert tuple(table.columns) == CONFLICT_COLUMNS
    assert table["vehicle_id"].tolist() == ["a_beside", "b_ahead"]
    last_gap = 50.0 - 10.0 * 2.9
    assert table["min_ttc_s"].tolist() == pytest.approx([np.inf, last_gap / 10.0])
    assert table["max_drac_mps2"].tolist() == pytest.approx([0.0, 10.0**2 / (2 * last_gap)])
    # The ego's front comes at 2.9 s, the end of its track, to 58 m, where the leader's tail was at (58 - 50) / 10 s.
    assert table["pet_s"].tolist() == pytest.approx([np.inf, 2.1], abs=1.01 * dt)
    assert table["overlap"].tolist() == [False, False]


def test_conflicts_with_no_traffic_are_an_empty_table_only_if_the_traffic_table_says_who_drove() -> None:
    ego = trace_table(straight_track(start=(0, 0), heading=0, speed=20.0, n=3, dt=0.1), vehicle_id="ego", speed=20.0, dt=0.1)
    with pytest.raises(TraceError, match="no fixes"):
        conflicts_with_traffic(ego, ego.iloc[:0], dt=0.1)


def test_conflicts_refuse_traces_off_the_clock() -> None:
    ego = trace_table(straight_track(start=(0, 0), heading=0, speed=20.0, n=3, dt=0.1), vehicle_id="ego", speed=20.0, dt=0.1)
    with pytest.raises(InputError, match=r"traffic: time_s must be multiples of dt=0.1"):
        conflicts_with_traffic(ego, ego.assign(time_s=ego["time_s"] + 0.03), dt=0.1)


def test_conflicts_refuse_traces_without_a_heading() -> None:
    ego = trace_table(straight_track(start=(0, 0), heading=0, speed=20.0, n=3, dt=0.1), vehicle_id="ego", speed=20.0, dt=0.1)
    with pytest.raises(InputError, match="heading_rad missing"):
        conflicts_with_traffic(ego, ego.drop(columns="heading_rad"), dt=0.1)


def test_pet_refuses_tracks_of_different_clocks() -> None:
    with pytest.raises(InputError, match="on one clock"):
        post_encroachment_time(np.zeros((3, 3)), CAR, np.zeros((4, 3)), CAR, dt=0.1, horizon_s=5.0)


@pytest.mark.parametrize("dt", [0.0, -0.1, np.inf])
def test_pet_refuses_a_step_that_is_none(dt: float) -> None:
    with pytest.raises(InputError, match="above 0"):
        post_encroachment_time(np.zeros((3, 3)), CAR, np.zeros((3, 3)), CAR, dt=dt, horizon_s=5.0)


@pytest.mark.parametrize(("horizon_s", "expected"), [(2.0, 2.0), (1.9, np.inf)])
def test_pet_is_looked_for_up_to_the_horizon_and_no_further(horizon_s: float, expected: float) -> None:
    # A gap of 19.95 m at 10 m/s: the follower's outline first overlaps the leader's after 2.0 s, on a clock of 0.1 s.
    leader = straight_track(start=(4.64 + 19.95, 0.0), heading=0.0, speed=10.0, n=60, dt=0.1)
    follower = straight_track(start=(0.0, 0.0), heading=0.0, speed=10.0, n=60, dt=0.1)
    assert post_encroachment_time(follower, CAR, leader, CAR, dt=0.1, horizon_s=horizon_s) == pytest.approx(expected)


@pytest.mark.parametrize(("gap_s", "expected"), [(4.95, 5.0), (5.05, np.inf)])
def test_ego_s_post_encroachment_time_is_looked_for_up_to_5_s(gap_s: float, expected: float) -> None:
    dt = 0.1
    own = straight_track(start=(0, 0), heading=0, speed=10.0, n=80, dt=dt)
    ahead = straight_track(start=(4.64 + 10 * gap_s, 0), heading=0, speed=10.0, n=80, dt=dt)
    ego, leader = (trace_table(track, vehicle_id=name, speed=10.0, dt=dt) for track, name in ((own, "ego"), (ahead, "leader")))
    assert conflicts_with_traffic(ego, leader, dt=dt)["pet_s"].tolist() == [pytest.approx(expected)]


@pytest.mark.parametrize(("off_s", "refused"), [(0.0008, False), (0.0012, True)])
def test_time_may_be_off_the_clock_by_a_hundredth_of_a_step(off_s: float, refused: bool) -> None:
    ego = trace_table(straight_track(start=(0, 0), heading=0, speed=20.0, n=3, dt=0.1), vehicle_id="ego", speed=20.0, dt=0.1)
    late = ego.assign(time_s=ego["time_s"] + off_s)
    if refused:
        with pytest.raises(InputError, match="multiples"):
            conflicts_with_traffic(ego, late, dt=0.1)
    else:
        assert conflicts_with_traffic(ego, late, dt=0.1)["overlap"].tolist() == [True]


def test_two_fixes_of_a_vehicle_at_one_time_are_refused() -> None:
    ego = trace_table(straight_track(start=(0, 0), heading=0, speed=20.0, n=3, dt=0.1), vehicle_id="ego", speed=20.0, dt=0.1)
    twice = pd.concat([ego, ego.assign(time_s=ego["time_s"] + 1e-4)])
    with pytest.raises(InputError, match="one row a vehicle and time"):
        conflicts_with_traffic(ego, twice, dt=0.1)


def test_vehicles_seen_at_different_times_conflict_by_their_encroachment_alone() -> None:
    dt = 0.1
    first = straight_track(start=(0, 0), heading=0, speed=20.0, n=10, dt=dt)
    ego = trace_table(first, vehicle_id="ego", speed=20.0, dt=dt)
    later = trace_table(first, vehicle_id="later", speed=20.0, dt=dt, first_time=2.0)
    (found,) = conflicts_with_traffic(ego, later, dt=dt).itertuples(index=False)
    assert (found.overlap, found.min_ttc_s, found.max_drac_mps2) == (False, np.inf, 0.0)
    # At 20 m/s a car of 4.64 m passes a place in 0.232 s: the later one comes 1.768 s after the ego has left.
    assert found.pet_s == pytest.approx(1.8)
