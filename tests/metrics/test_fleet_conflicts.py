from typing import Any

import numpy as np
import pandas as pd
import pytest
from builders import bent_road
from hypothesis import given, settings
from hypothesis import strategies as st

from wzsumo.errors import InputError
from wzsumo.frames import FloatArray
from wzsumo.metrics.conflicts import box_approach, boxes_overlap, conflicts_with_traffic
from wzsumo.metrics.fleet_conflicts import fleet_conflicts
from wzsumo.road import Road

DT = 0.5


def car(
    vehicle_id: str, *, x: float = 0.0, y: float = 0.0, speed: float = 20.0, heading: float = 0.0, start: int = 0, n: int = 12,
    length: float = 4.8,
) -> pd.DataFrame:  # fmt: skip
    """One vehicle at constant speed, n rows from tick `start`."""
    time = (start + np.arange(n)) * DT
    way = speed * np.arange(n) * DT
    return pd.DataFrame({
        "vehicle_id": vehicle_id, "time_s": time, "x_m": x + way * np.cos(heading), "y_m": y + way * np.sin(heading),
        "heading_rad": heading, "speed_mps": speed, "length_m": length, "width_m": 1.85,
    })  # fmt: skip


def twin(traces: pd.DataFrame, *, ttc_horizon_s: float, pet_horizon_s: float) -> FloatArray:
    """The same figures, pair by pair and row by row."""
    worst: dict[str, list[float]] = {v: [False, np.inf, 0.0, np.inf] for v in traces["vehicle_id"].unique()}
    rows: list[Any] = list(traces.itertuples())  # rows with attributes named as the columns
    for a in rows:
        for b in rows:
            if a.vehicle_id == b.vehicle_id:
                continue
            poses = [(r.x_m, r.y_m, r.heading_rad) for r in (a, b)]
            sizes = [(r.length_m, r.width_m) for r in (a, b)]
            lag, mine = abs(a.time_s - b.time_s), worst[a.vehicle_id]
            if lag <= pet_horizon_s + 1e-9 and boxes_overlap(poses[0], sizes[0], poses[1], sizes[1]):
                mine[3] = min(mine[3], round(lag / DT) * DT)
                mine[0] |= lag < 1e-9
            if lag < 1e-9:
                near = box_approach(poses[0], sizes[0], poses[1], sizes[1], speed_a=a.speed_mps, speed_b=b.speed_mps)
                if near.ttc <= ttc_horizon_s:
                    mine[1], mine[2] = min(mine[1], float(near.ttc)), max(mine[2], float(near.drac))
    table = pd.DataFrame([(v, *row) for v, row in worst.items()], columns=["vehicle_id", "o", "ttc", "drac", "pet"])
    return table.sort_values("vehicle_id").iloc[:, 1:].to_numpy(dtype=float)


def to_the_millimetre(value: float) -> float:
    """What logs hold; a speed of 1e-248 m/s divides differently here and there."""
    return round(value, 3)


drivers = st.lists(
    st.tuples(
        st.floats(-60, 60).map(to_the_millimetre), st.sampled_from([0.0, 1.5, 3.66, 7.3]),
        st.floats(0, 30).map(to_the_millimetre),
        st.sampled_from([0.0, 0.05, -0.3, 1.2, np.pi]), st.integers(0, 4), st.sampled_from([4.8, 12.0]),
    ),
    min_size=2, max_size=4,
)  # fmt: skip


@settings(max_examples=20)
@given(drivers)
def test_fleet_conflicts_equal_the_pairwise_twin(cars: list[tuple[float, float, float, float, int, float]]) -> None:
    traces = pd.concat(
        car(f"v{k}", x=x, y=y, speed=v, heading=h, start=start, n=4, length=length)
        for k, (x, y, v, h, start, length) in enumerate(cars)
    )
    found = fleet_conflicts(traces, dt=DT, ttc_horizon_s=4.0, pet_horizon_s=1.5)
    expected = twin(traces, ttc_horizon_s=4.0, pet_horizon_s=1.5)
    np.testing.assert_allclose(found.iloc[:, 1:].to_numpy(dtype=float), expected, rtol=1e-6, atol=1e-9)


def test_following_car_has_hayward_time_and_cooper_deceleration() -> None:
    traces = pd.concat([car("rear", x=0, speed=20, n=1), car("front", x=54.8, speed=10, n=1)])  # 50 m, closing at 10 m/s
    found = fleet_conflicts(traces, dt=DT).set_index("vehicle_id")
    assert found["min_ttc_s"].to_dict() == pytest.approx({"rear": 5.0, "front": 5.0})
    assert found["max_drac_mps2"].to_dict() == pytest.approx({"rear": 1.0, "front": 1.0})  # 10^2 / (2 x 50)


def test_post_encroachment_time_in_car_following_is_the_net_time_gap() -> None:
    traces = pd.concat([car("rear", x=0, n=20), car("front", x=20 * 1.5 + 4.8, n=20)])
    assert fleet_conflicts(traces, dt=DT)["pet_s"].tolist() == [1.5, 1.5]


def test_overlap_of_a_fleet_is_what_each_vehicle_finds_against_the_rest() -> None:
    traces = pd.concat([car("a"), car("b", x=9, speed=15), car("c", x=-40, y=3.66, speed=25)])
    found = fleet_conflicts(traces, dt=DT, pet_horizon_s=5.0).set_index("vehicle_id")
    assert found["overlap"].to_dict() == {"a": True, "b": True, "c": False}
    ego = conflicts_with_traffic(traces[traces["vehicle_id"] == "a"], traces[traces["vehicle_id"] != "a"], dt=DT)
    assert found.loc["a", "min_ttc_s"] == ego["min_ttc_s"].min()
    assert found.loc["a", "pet_s"] == ego["pet_s"].min()


def car_on(road: Road, vehicle_id: str, *, station: float, offset: float, speed: float) -> pd.DataFrame:
    """One vehicle that follows the road at a constant offset."""
    table = car(vehicle_id, x=station, speed=speed)
    xy = road.to_xy(table["x_m"], offset)
    return table.assign(x_m=xy[:, 0], y_m=xy[:, 1], heading_rad=road.heading_at(table["x_m"]))


@pytest.mark.parametrize(("radius_ft", "inner", "outer"), [(1000, 1, 0), (-1000, 0, 1)])
def test_vehicle_that_passes_another_in_a_bend_is_on_a_collision_course_only_if_it_does_not_follow_the_bend(
    radius_ft: int, inner: int, outer: int
) -> None:
    road = bent_road(radius_ft)
    passing = car_on(road, "passing", station=400, offset=road.lane_centre(inner), speed=27)
    slower = car_on(road, "slower", station=440, offset=road.lane_centre(outer), speed=20)
    traces = pd.concat([passing, slower])
    assert fleet_conflicts(traces, dt=DT)["min_ttc_s"].max() < 5
    found = fleet_conflicts(traces, dt=DT, road=road)
    assert found["min_ttc_s"].tolist() == [np.inf, np.inf]
    assert found["max_drac_mps2"].tolist() == [0, 0]
    assert conflicts_with_traffic(passing, slower, dt=DT)["min_ttc_s"].max() < 5
    (to_ego,) = conflicts_with_traffic(passing, slower, dt=DT, road=road).itertuples(index=False)
    assert (to_ego.min_ttc_s, to_ego.max_drac_mps2) == (np.inf, 0)


@pytest.mark.parametrize("radius_ft", [1000, -1000, 3000])
def test_follower_on_a_bend_has_hayward_s_time_of_the_gap_along_it(radius_ft: int) -> None:
    road = bent_road(radius_ft)
    middle = road.travelled_width / 2
    a, b = (car_on(road, name, station=s, offset=middle, speed=v) for name, s, v in (("a", 400, 25), ("b", 440, 20)))
    hayward_s = (40 - 4.8 - 5 * a["time_s"].max()) / 5
    found = fleet_conflicts(pd.concat([a, b]), dt=DT, road=road)
    assert found["min_ttc_s"].tolist() == pytest.approx([hayward_s] * 2, rel=0.03)
    assert conflicts_with_traffic(a, b, dt=DT, road=road)["min_ttc_s"].tolist() == pytest.approx([hayward_s], rel=0.03)


def test_vehicle_alone_on_the_road_has_no_conflict() -> None:
    (row,) = fleet_conflicts(car("a"), dt=DT).itertuples(index=False)
    assert tuple(row) == ("a", False, np.inf, 0.0, np.inf)


def test_times_off_the_clock_are_refused() -> None:
    with pytest.raises(InputError, match=r"multiples of dt=0\.3 s"):
        fleet_conflicts(car("a"), dt=0.3)


@pytest.mark.parametrize(("gap_m", "ttc_s"), [(49.9, 4.99), (50.1, np.inf)])
def test_time_to_collision_is_looked_for_up_to_5_s(gap_m: float, ttc_s: float) -> None:
    traces = pd.concat([car("rear", x=0, speed=20, n=1), car("front", x=gap_m + 4.8, speed=10, n=1)])
    found = fleet_conflicts(traces, dt=DT)
    assert found["min_ttc_s"].tolist() == pytest.approx([ttc_s] * 2)
    assert found["max_drac_mps2"].tolist() == pytest.approx([10 / (2 * ttc_s)] * 2)


@pytest.mark.parametrize(("gap_s", "pet_s"), [(2.0, 2.0), (2.01, np.inf)])
def test_post_encroachment_time_is_looked_for_up_to_2_s(gap_s: float, pet_s: float) -> None:
    traces = pd.concat([car("rear", x=0, n=20), car("front", x=20 * gap_s + 4.8, n=20)])
    assert fleet_conflicts(traces, dt=DT)["pet_s"].tolist() == [pet_s, pet_s]
