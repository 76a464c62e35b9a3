"""The lane map of a road with known lanes: its places, and that it does not depend on frames, order or names."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.crowd_mapping.lanes import lane_mapping
from wzsumo.crowd_mapping.lanes.lane_mapping import MappedLanes, map_lanes
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.frames import FloatArray
from wzsumo.road import RoadSpec

LANE = 3.6576  # 12 ft


END_UNSEEN = "alone, traffic hardly tells where a closure ends: P(open) rises to .4 within 100 m ahead of its end"


def crowd(
    *, lanes: int = 2, n: int = 8, length_m: float = 600.0, interval_s: float = 1.0, seed: int = 0, error_m: float = 0.2
) -> pd.DataFrame:
    """Vehicles at 25 m/s in turn in lanes whose middles are at 0, 3.66 m, ..., each with an error of its own that lasts."""
    random = np.random.default_rng(seed)
    parts = []
    for i in range(n):
        x = np.arange(5.0 * random.random(), length_m, 25.0 * interval_s)
        y = LANE * (i % lanes) + error_m * random.standard_normal() + 0.1 * random.standard_normal(len(x))
        parts.append(pd.DataFrame({"vehicle_id": f"v{i:02d}", "time_s": 3.0 * i + x / 25.0, "x_m": x, "y_m": y}))
    return pd.concat(parts, ignore_index=True)


def middles(made: MappedLanes) -> FloatArray:
    """World points (lanes, 20, 2) on the middles of lanes, evenly along the road."""
    lanes = made.lanes
    s = np.linspace(lanes.stations[0], lanes.stations[-1], 20)
    return np.stack([lanes.to_xy(s, np.interp(s, lanes.stations, lane.middle)) for lane in lanes.lanes])


@pytest.mark.parametrize("lanes", [1, 2, 3, 6])
def test_traces_alone_show_each_lane_where_it_is(lanes: int) -> None:
    made = map_lanes(crowd(lanes=lanes, n=4 * lanes))
    assert made.figures["open_lanes"] == made.figures["lanes"] == lanes
    for lane, line in enumerate(middles(made)):
        assert line[:, 1] == pytest.approx(LANE * lane, abs=0.4)
    assert made.figures["fixes_on_free_share"] == 1.0
    assert made.figures["odd_traces"] == []


@settings(max_examples=3, deadline=None, derandomize=True, phases=[Phase.generate])
@given(angle=st.floats(-3.1, 3.1), east=st.floats(-1e6, 1e6), north=st.floats(-1e6, 1e6))
def test_map_turns_and_moves_with_the_frame_of_the_traces(angle: float, east: float, north: float) -> None:
    table = crowd()
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    xy = table[["x_m", "y_m"]].to_numpy() @ turn + (east, north)
    moved = middles(map_lanes(table.assign(x_m=xy[:, 0], y_m=xy[:, 1])))
    assert moved == pytest.approx(middles(map_lanes(table)) @ turn + (east, north), abs=0.1)


@settings(max_examples=3, deadline=None, derandomize=True, phases=[Phase.generate])
@given(order=st.permutations(range(8)))
def test_order_and_names_of_the_traces_do_not_matter(order: list[int]) -> None:
    table = crowd()
    by_vehicle = [part for _, part in table.groupby("vehicle_id")]
    other = pd.concat([by_vehicle[i].assign(vehicle_id=f"w{k}") for k, i in enumerate(order)], ignore_index=True)
    made, again = map_lanes(table), map_lanes(other)
    assert middles(again) == pytest.approx(middles(made), abs=0.02)
    assert again.figures["p_closed"] == pytest.approx(made.figures["p_closed"], abs=0.01)


def test_clock_of_the_traces_does_not_matter() -> None:
    table = crowd()
    assert middles(map_lanes(table.assign(time_s=table["time_s"] + 1.78e9))) == pytest.approx(
        middles(map_lanes(table)), abs=1e-6
    )


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"interval_s": 0.02, "length_m": 150.0}, "50 Hz"),
        ({"interval_s": 10.0, "length_m": 2500.0}, "a fix in 250 m"),
        ({"length_m": 100.0, "interval_s": 0.5}, "100 m of road"),
        ({"length_m": 3000.0, "interval_s": 2.0}, "3 km of road"),
    ],
)
def test_any_sampling_and_length_shows_the_two_lanes(how: dict[str, Any], said: str) -> None:
    made = map_lanes(crowd(**how))
    assert made.figures["open_lanes"] == 2, said
    for lane, line in enumerate(middles(made)):
        assert line[:, 1] == pytest.approx(LANE * lane, abs=0.5)


def test_single_trace_is_one_lane_along_it() -> None:
    made = map_lanes(crowd(n=1))
    assert made.figures["lanes"] == 1
    assert middles(made)[0, :, 1] == pytest.approx(0.0, abs=0.8)


def before_of(*, closed: AnnouncedZone | None = None, lanes: int = 2) -> MapBefore:
    """A road from (0, -1.83) along x, so that the right lane's middle is at y = 0."""
    road = RoadSpec(
        lane_count=lanes, left_shoulder_ft=10, right_shoulder_ft=10,
        reference_points_m=((-200.0, LANE * (lanes - 1) / 2), (1400.0, LANE * (lanes - 1) / 2)),
    ).build()  # fmt: skip
    return MapBefore(road=road, announced=closed)


def closing(
    *, n: int = 12, stay: int = 0, error_m: float = 0.2, offset_m: float = 0.0, interval_s: float = 1.0, seed: int = 0
) -> pd.DataFrame:
    """Vehicles on 1200 m; those in the left lane move over between 300 and 400 m but for `stay`, and back behind 900 m."""
    table = crowd(n=n, length_m=1200.0, error_m=error_m, interval_s=interval_s, seed=seed)
    number = table["vehicle_id"].str[1:].astype(int)
    leaves = (number % 2 == 1) & (number > 2 * stay)
    x = table["x_m"] - 12.0 * (number % 5)
    aside = np.clip((x - 250) / 80, 0, 1) * np.clip((1000 - x) / 80, 0, 1)
    return table.assign(y_m=table["y_m"] + offset_m - leaves * LANE * aside)


ZONE = AnnouncedZone(start_m=450.0, end_m=1100.0, start_sd_m=60.0, end_sd_m=60.0)  # from x = 250 m to 900 m


def closed_at(made: MappedLanes, x: float, lane: int) -> float:
    """P(closed) in the middle of a lane at x [m]."""
    lanes = made.lanes
    return float(1 - np.interp(x + 200.0, lanes.stations, lanes.lanes[lane].p_open_middle))


@pytest.mark.parametrize("joined", [pytest.param(False, marks=pytest.mark.xfail(strict=True, reason=END_UNSEEN)), True])
def test_lane_that_everybody_leaves_is_closed_between_and_open_before_and_after(joined: bool) -> None:
    made = map_lanes(closing(), before=before_of(closed=ZONE) if joined else None)
    assert made.figures["open_lanes"] == 1
    assert made.figures["lanes"] == 2
    s = made.lanes.stations - (200.0 if joined else 0.0)
    p = made.lanes.lanes[1].p_open_middle
    assert p[(s > 550) & (s < 800)].max() < 0.2
    assert p[s < 150].min() > 0.804
    assert p[s > 1100].min() > 0.804
    assert made.lanes.lanes[0].p_open_middle.min() > 0.804


@pytest.mark.parametrize("interval_s", [3.0, 6.0])
@pytest.mark.parametrize("joined", [False, True])
def test_fixes_many_stations_apart_show_a_closure_too(joined: bool, interval_s: float) -> None:
    made = map_lanes(closing(n=24, interval_s=interval_s), before=before_of(closed=ZONE) if joined else None)
    lanes = made.lanes
    s = lanes.stations - (200.0 if joined else 0.0)
    assert lanes.lanes[1].p_open_middle[(s > 600) & (s < 700)].max() < 0.2
    assert lanes.lanes[0].p_open_middle.min() > 0.804


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_receivers_that_err_by_half_a_lane_all_along_do_not_open_a_closed_lane(seed: int) -> None:
    made = map_lanes(closing(n=30, error_m=1.3, seed=seed), before=before_of(closed=ZONE))
    assert closed_at(made, 650.0, 1) > 0.9
    assert closed_at(made, 650.0, 0) < 0.1


def test_lane_in_which_three_of_six_go_on_is_open() -> None:
    made = map_lanes(closing(stay=3), before=before_of(closed=ZONE))
    assert made.lanes.closed_intervals(1) == ()
    assert made.figures["fixes_on_occupied_share"] == 0.0
    assert made.figures["open_lanes"] == 2


def test_road_without_an_announcement_and_with_traces_in_all_lanes_is_open() -> None:
    made = map_lanes(crowd(n=10, length_m=1200.0), before=before_of())
    assert made.figures["open_lanes"] == 2
    assert max(made.figures["p_closed"]) < 0.05


@pytest.mark.parametrize("offset_m", [-1.5, 1.0])
def test_common_offset_of_all_receivers_is_found_on_the_known_road_and_removed(offset_m: float) -> None:
    made = map_lanes(closing(n=20, offset_m=offset_m), before=before_of(closed=AnnouncedZone(start_m=480.0, end_m=1000.0)))
    assert made.figures["common_shift_m"] == pytest.approx(offset_m, abs=0.3)
    assert any(f"to the {'left' if offset_m > 0 else 'right'}" in word for word in made.figures["warnings"])
    assert middles(made)[0, :, 1] == pytest.approx(0.0, abs=0.4)


def test_lane_that_nobody_drove_is_not_free_in_the_announced_zone_and_is_named() -> None:
    table = crowd(lanes=1, n=6, length_m=1200.0)
    made = map_lanes(table, before=before_of(closed=ZONE))
    assert closed_at(made, 600.0, 1) > 0.196
    assert any("no trace drove in lane 1" in word for word in made.figures["warnings"])
    assert closed_at(made, 600.0, 0) < 0.05


def test_street_that_turns_at_a_corner_is_a_lane_where_one_vehicle_drove() -> None:
    """A street of 100 m, a corner of 12 m radius and 300 m more in wide bends, driven once at 8 m/s with a fix each second."""
    bends = np.r_[np.zeros(100), np.full(19, 1 / 12), np.zeros(80), np.full(80, -1 / 120), np.full(80, 1 / 120), np.zeros(60)]
    heading = np.cumsum(bends)
    line = np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    fixes = line[::8] + 0.3 * np.random.default_rng(4).standard_normal((len(line[::8]), 2))
    table = pd.DataFrame({"vehicle_id": "one", "time_s": np.arange(len(fixes)) * 1.0, "x_m": fixes[:, 0], "y_m": fixes[:, 1]})
    made = map_lanes(table)
    assert made.figures["lanes"] == made.figures["open_lanes"] == 1
    assert made.figures["fixes_on_free_share"] == 1.0
    assert made.figures["odd_traces"] == []


def test_lanes_laid_through_poor_drives_that_no_lanes_explain_are_in_doubt() -> None:
    """Ten vehicles of poor receivers, three of which leave by a ramp behind 900 m."""
    table = crowd(lanes=2, n=10, length_m=1500.0, error_m=4.0, seed=3)
    number = table["vehicle_id"].str[1:].astype(int)
    drift = 3.0 * np.sin(table["x_m"] / 150.0 + 2.1 * number)
    away = np.where(number % 3 == 0, 0.1 * np.clip(table["x_m"] - 900.0, 0, None), 0.0)
    made = map_lanes(table.assign(y_m=table["y_m"] + drift - away))
    assert any(word.startswith("lanes explain") for word in made.figures["warnings"])
    assert max(lane.p_open.max() for lane in made.lanes.lanes) < 0.804


def test_queue_in_an_open_lane_is_not_taken_for_vehicles_of_the_work() -> None:
    """Half of ten crawl through the announced zone at 3 m/s, in both lanes: a work vehicle is slow alone."""
    table = crowd(n=10, length_m=1500.0)
    number, x = table["vehicle_id"].str[1:].astype(int), table["x_m"]
    queued = (number % 4 < 2).to_numpy() & (x > 250).to_numpy()
    lost = np.where(queued, (np.minimum(x, 900) - 250) * (1 / 3 - 1 / 25), 0.0)
    made = map_lanes(table.assign(time_s=table["time_s"] + lost), before=before_of(closed=ZONE))
    assert made.figures["open_lanes"] == 2
    assert made.figures["odd_traces"] == []


def test_traces_beyond_those_that_lanes_are_fitted_to_count_for_closures(monkeypatch: pytest.MonkeyPatch) -> None:
    every = map_lanes(closing(n=60), before=before_of(closed=ZONE))
    monkeypatch.setattr(lane_mapping, "FITTED_TRACES", 20)
    some = map_lanes(closing(n=60), before=before_of(closed=ZONE))
    assert middles(some) == pytest.approx(middles(every), abs=0.15)
    assert [lane.n_traces for lane in some.lanes.lanes] == [lane.n_traces for lane in every.lanes.lanes]
    for one, other in zip(some.lanes.lanes, every.lanes.lanes, strict=True):
        assert one.p_open_middle == pytest.approx(other.p_open_middle, abs=0.1)
    assert some.figures["fixes_on_free_share"] > 0.97
