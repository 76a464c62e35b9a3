from typing import Any

import numpy as np
import pandas as pd
import pytest
from builders import paper_layout

from wzsumo.metrics.traffic import (
    MINUTE_COLUMNS,
    STATION_COLUMNS,
    VEHICLE_COLUMNS,
    TrafficMeasures,
    bottleneck_station,
    count_hard_brakes,
    measure_traffic,
)
from wzsumo.simulation.trips import TRIP_COLUMNS

LAYOUT = paper_layout()
DT = 0.5
LANE_1_M = 1.5 * 12 * 0.3048  # centre of the middle lane before the shift


def stream(*, n: int, headway_s: float, speed: float, offset: float = LANE_1_M) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A trace table of n cars on the whole road, one headway after the other at one speed, and their trips."""
    length = LAYOUT.road.length
    traces, trips = [], []
    for k in range(n):
        time = np.arange(0, length / speed, DT)
        x = speed * time
        row: dict[str, Any] = {
            "vehicle_id": f"v{k:03d}",
            "time_s": time + k * headway_s,
            "x_m": x,
            "y_m": offset,
            "heading_rad": 0.0,
        }
        traces.append(pd.DataFrame(row | {"speed_mps": speed, "length_m": 4.8, "width_m": 1.85}))
        trips.append((f"v{k:03d}", 2.0, True, True, length / speed, 7.0, 7.0, length, 300.0, 0.2, 100.0))
    return pd.concat(traces, ignore_index=True), pd.DataFrame(trips, columns=list(TRIP_COLUMNS))


def measure(traces: pd.DataFrame, trips: pd.DataFrame, *, warm_up_s: float = 120.0) -> TrafficMeasures:
    return measure_traffic(traces, trips, LAYOUT, dt=DT, warm_up_s=warm_up_s)


@pytest.fixture(scope="module")
def uniform() -> TrafficMeasures:
    return measure(*stream(n=200, headway_s=3.0, speed=25.0))


def test_tables_have_the_documented_columns(uniform: TrafficMeasures) -> None:
    for table, columns in (
        (uniform.vehicles, VEHICLE_COLUMNS), (uniform.minutes, MINUTE_COLUMNS), (uniform.stations, STATION_COLUMNS),
    ):  # fmt: skip
        assert list(table.columns) == list(columns)
        assert all(columns.values())


def test_uniform_stream_has_the_throughput_of_its_headway(uniform: TrafficMeasures) -> None:
    assert uniform.minutes["count"].iloc[2:9].tolist() == [20] * 7
    assert uniform.summary.throughput_vph == 1200


def test_stream_without_a_slow_vehicle_has_no_queue_no_breakdown_and_no_conflict(uniform: TrafficMeasures) -> None:
    summary = uniform.summary
    assert summary.max_queue_length_m == 0
    assert np.isnan(summary.breakdown_s)
    assert np.isnan(summary.queue_discharge_vph)
    assert (summary.n_ttc_conflicts, summary.n_drac_conflicts, summary.n_overlapping, summary.n_hard_braking) == (0, 0, 0, 0)
    assert summary.speed_sd_taper_mps == pytest.approx(0, abs=1e-6)


def test_delay_counts_the_wait_to_enter(uniform: TrafficMeasures) -> None:
    assert uniform.summary.mean_delay_s == 9.0  # 7 s lost on the road, 2 s before it
    assert uniform.summary.mean_departure_delay_s == 2.0
    assert uniform.summary.co2_g_per_vkm == pytest.approx(300 / (LAYOUT.road.length / 1000))


def test_post_encroachment_time_below_a_second_is_a_conflict_and_above_is_following() -> None:
    near, far = (measure(*stream(n=5, headway_s=h, speed=20.0), warm_up_s=0).summary for h in (0.5, 1.5))
    assert near.n_pet_conflicts == 5  # net gap 0.5 s - 4.8 m / 20 m/s = 0.26 s
    assert far.n_pet_conflicts == 0


def test_queue_ahead_of_the_taper_is_as_long_as_its_slow_stretch_and_breaks_the_flow_down() -> None:
    traces, trips = stream(n=700, headway_s=3.0, speed=25.0)
    end = bottleneck_station(LAYOUT)
    slow = traces["x_m"].between(end - 405, end) & (traces["time_s"] > 1080)
    traces.loc[slow, "speed_mps"] = 4.0
    found = measure(traces, trips).summary
    assert found.max_queue_length_m == pytest.approx(405, abs=20)  # cells of 20 m
    assert found.breakdown_s == pytest.approx(1080, abs=60)
    assert found.peak_flow_vph == 1200


def test_flow_of_15_minutes_leaves_out_the_filling_up_of_the_road() -> None:
    # 1,200 veh/h over 17 minutes: with the first two, in which the road fills up, 15 minutes are fewer.
    found = measure(*stream(n=340, headway_s=3.0, speed=25.0)).summary
    assert found.peak_flow_vph == found.throughput_vph == 1200
    shorter = measure(*stream(n=280, headway_s=3.0, speed=25.0)).summary
    assert np.isnan(shorter.peak_flow_vph)
    assert shorter.throughput_vph == 1200


def test_flows_count_up_to_a_lock_and_the_summary_tells_where_it_is() -> None:
    traces, trips = stream(n=340, headway_s=3.0, speed=25.0)
    assert np.isnan(measure(traces, trips).summary.locked_s)
    last = traces["vehicle_id"] == traces["vehicle_id"].iloc[-1]
    stuck = traces[last].assign(vehicle_id="stuck", x_m=traces["x_m"].min() + 90.0, y_m=-50.0, speed_mps=0.0)
    stuck["time_s"] = 600.0 + np.arange(len(stuck)) * 5.0
    found = measure(pd.concat([traces, stuck], ignore_index=True), trips).summary
    assert found.locked_s == 600.0
    assert found.locked_station_m == pytest.approx(stuck["x_m"].iloc[0])
    assert np.isnan(found.peak_flow_vph)  # 8 minutes from the warm-up to the lock
    assert found.throughput_vph == 1200


def test_merge_position_is_the_last_fix_in_the_closing_lane() -> None:
    traces, trips = stream(n=2, headway_s=10.0, speed=25.0)
    taper = LAYOUT.area("merging taper").start
    left_lane = 2.5 * 12 * 0.3048
    traces.loc[(traces["vehicle_id"] == "v001") & (traces["x_m"] < taper - 60), "y_m"] = left_lane
    found = measure(traces, trips, warm_up_s=0).vehicles.set_index("vehicle_id")["merge_position_m"]
    assert np.isnan(found["v000"])
    assert found["v001"] == pytest.approx(-60, abs=25 * DT)


def test_vehicle_that_never_entered_has_a_row_without_figures_of_the_road() -> None:
    traces, trips = stream(n=3, headway_s=10.0, speed=25.0)
    never = pd.DataFrame([["v003", 55.0, False, False, np.nan, np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]], columns=trips.columns)
    trips = pd.concat([trips, never], ignore_index=True)
    found = measure(traces, trips, warm_up_s=0)
    row = found.vehicles.set_index("vehicle_id").loc["v003"]
    assert (found.summary.n_vehicles, found.summary.n_waiting, found.summary.n_arrived) == (4, 1, 3)
    assert np.isnan([row["entered_s"], row["travel_time_s"], row["delay_s"]]).all()
    assert (row["departure_delay_s"], row["hard_brakes"], row["pet_s"], row["overlap"]) == (55.0, 0, np.inf, False)
    assert found.summary.mean_departure_delay_s == pytest.approx((3 * 2 + 55) / 4)


def test_hard_brakes_are_counted_once_an_event_and_not_across_vehicles() -> None:
    speed = np.array([25, 25, 22, 19, 19, 19, 16, 16, 16.0])  # two runs below -2.67 m/s in a second
    counts = count_hard_brakes(["a"] * 9 + ["b"] * 2, np.append(speed, [5.0, 4.0]), dt=1.0)
    assert counts.to_dict() == {"a": 2, "b": 0}


def test_hard_brake_needs_the_loss_of_a_whole_second() -> None:
    speed = 25 - 2.6 * np.arange(0, 3, 0.1)
    assert count_hard_brakes(["a"] * len(speed), speed, dt=0.1).sum() == 0
    assert count_hard_brakes(["a"] * len(speed), speed * 1.05, dt=0.1).sum() == 1


def test_stations_have_edie_s_flow_density_and_speed_after_the_warm_up(uniform: TrafficMeasures) -> None:
    begin = uniform.stations.iloc[:20].mean()  # a fix every 12.5 m: a cell of 20 m holds one or two of a vehicle
    # One vehicle every 3 s from 120 to 600 s, 160 in all, and those on the road at 120 s, in the time from 120 to 660 s.
    assert begin["flow_vph"] == pytest.approx(3600 * 162 / 540, rel=0.02)
    assert begin["density_vpkm"] == pytest.approx(begin["flow_vph"] / (25 * 3.6))
    assert uniform.stations["speed_mps"].dropna().unique() == pytest.approx([25.0])
    assert uniform.stations["station_m"].iloc[:3].tolist() == [0, 20, 40]


def test_deviation_of_speeds_is_that_of_the_fixes_after_the_warm_up() -> None:
    traces, trips = stream(n=60, headway_s=3.0, speed=25.0)
    taper = LAYOUT.area("merging taper").start
    cell = traces["x_m"].between(np.floor(taper / 20) * 20, np.floor(taper / 20) * 20 + 19.9)
    every_other = traces["vehicle_id"].isin([f"v{k:03d}" for k in range(0, 60, 2)])
    traces.loc[cell & every_other, "speed_mps"] = 15.0
    traces.loc[cell & (traces["time_s"] < 60), "speed_mps"] = 1.0
    assert measure(traces, trips, warm_up_s=60).summary.speed_sd_taper_mps == pytest.approx(5.0, abs=0.05)


def test_space_time_cells_are_ten_seconds_by_twenty_metres(uniform: TrafficMeasures) -> None:
    assert np.diff(uniform.grid.time_edges) == pytest.approx(10.0)
    assert np.diff(uniform.grid.station_edges) == pytest.approx(20.0)


def test_spread_of_two_speeds_is_half_their_difference() -> None:
    traces, trips = stream(n=2, headway_s=3.0, speed=25.0)
    traces.loc[traces["vehicle_id"] == "v001", "speed_mps"] = 15.0  # in a cell of 20 m eight fixes of each, 2.5 m apart
    assert measure(traces, trips, warm_up_s=0).stations["speed_sd_mps"].iloc[10] == pytest.approx(5.0, abs=1e-6)


@pytest.mark.parametrize(("ahead_m", "counts"), [(190.0, True), (230.0, False)])
def test_spread_of_speeds_counts_from_200_m_ahead_of_the_zone(ahead_m: float, counts: bool) -> None:
    traces, trips = stream(n=40, headway_s=3.0, speed=25.0)
    station = LAYOUT.start - ahead_m
    place = traces["x_m"].between(station - 10, station + 10) & traces["vehicle_id"].str.endswith("0")
    traces.loc[place, "speed_mps"] = 10.0
    assert (measure(traces, trips, warm_up_s=0).summary.speed_sd_taper_mps > 1) == counts


@pytest.mark.parametrize(("speed_mph", "queues"), [(29.9, True), (30.1, False)])
def test_vehicle_queues_below_half_the_posted_speed_of_60_mph(speed_mph: float, queues: bool) -> None:
    traces, trips = stream(n=40, headway_s=3.0, speed=25.0)
    end = bottleneck_station(LAYOUT)
    traces.loc[traces["x_m"].between(end - 100, end), "speed_mps"] = speed_mph * 0.44704
    assert (measure(traces, trips).summary.max_queue_length_m > 0) == queues


def test_mean_queue_is_over_the_time_after_the_warm_up() -> None:
    traces, trips = stream(n=100, headway_s=3.0, speed=25.0)  # cells up to 360 s
    end = bottleneck_station(LAYOUT)  # 536.448 m: the cell from 500 to 520 m is the last one ahead of it
    slow = traces["x_m"].between(500, 519.9) & ((traces["time_s"] < 100) | traces["time_s"].between(200, 299.9))
    traces.loc[slow, "speed_mps"] = 2.0
    found = measure(traces, trips, warm_up_s=120.0).summary
    assert found.max_queue_length_m == pytest.approx(end - 500)
    assert found.mean_queue_length_m == pytest.approx((end - 500) * 10 / 24)  # 10 of the 24 cells from 120 to 360 s


@pytest.mark.parametrize(("ahead_m", "slow"), [(410.0, False), (380.0, True), (320.0, True), (290.0, False)])
def test_minutes_hold_the_speed_300_to_400_m_ahead_of_the_bottleneck(ahead_m: float, slow: bool) -> None:
    traces, trips = stream(n=60, headway_s=3.0, speed=25.0)
    end = bottleneck_station(LAYOUT)
    traces.loc[traces["x_m"].between(end - ahead_m - 8, end - ahead_m + 8), "speed_mps"] = 5.0
    assert (measure(traces, trips).minutes["upstream_speed_mps"].iloc[1] < 24.9) == slow


def test_minutes_count_vehicles_that_pass_the_middle_of_the_activity_area_for_the_first_time() -> None:
    traces, trips = stream(n=30, headway_s=3.0, speed=25.0)  # at 1028.7 m after 41.1 s, every 3 s
    found = measure(traces, trips).minutes
    # k x 3 + 41.1484 s < 60, 120: k up to 6, 26.
    assert found["count"].tolist() == [7, 20]
    assert found["time_s"].tolist() == [0, 60]
    beyond = traces[traces["x_m"] > 1100]
    assert measure(beyond, trips).minutes["count"].sum() == 0


@pytest.mark.parametrize(("gap_s", "n_conflicts"), [(1.45, 2), (1.55, 0)])
def test_time_to_collision_below_1_5_s_is_a_conflict(gap_s: float, n_conflicts: int) -> None:
    traces, trips = pair(gap_m=10 * gap_s, closing=10.0)
    found = measure(traces, trips, warm_up_s=0).summary
    assert found.n_ttc_conflicts == n_conflicts


@pytest.mark.parametrize(("drac", "n_conflicts"), [(3.4, 2), (3.3, 0)])
def test_deceleration_to_avoid_a_crash_above_3_35_is_a_conflict(drac: float, n_conflicts: int) -> None:
    traces, trips = pair(gap_m=10.0**2 / (2 * drac), closing=10.0)
    assert measure(traces, trips, warm_up_s=0).summary.n_drac_conflicts == n_conflicts


@pytest.mark.parametrize(("headway_s", "n_conflicts"), [(0.5 + 4.8 / 20, 5), (1.0 + 4.8 / 20, 0)])
def test_post_encroachment_time_below_1_s_is_a_conflict(headway_s: float, n_conflicts: int) -> None:
    _, trips = stream(n=5, headway_s=10.0, speed=20.0)
    time = np.arange(0, 20, DT)
    traces = pd.concat([
        pd.DataFrame({
            "vehicle_id": f"v{k:03d}", "time_s": time, "x_m": 200 + 20 * (time - headway_s * k), "y_m": LANE_1_M,
            "heading_rad": 0.0, "speed_mps": 20.0, "length_m": 4.8, "width_m": 1.85,
        })
        for k in range(5)
    ])  # fmt: skip
    assert measure(traces, trips, warm_up_s=0).summary.n_pet_conflicts == n_conflicts


def pair(*, gap_m: float, closing: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A vehicle that closes in on another over a gap, seen at one moment only, and trips of both."""
    _, trips = stream(n=2, headway_s=10.0, speed=25.0)
    traces = pd.DataFrame({
        "vehicle_id": ["v000", "v001"], "time_s": 0.0, "x_m": [200.0, 200.0 + 4.8 + gap_m], "y_m": LANE_1_M, "heading_rad": 0.0,
        "speed_mps": [10.0 + closing, 10.0], "length_m": 4.8, "width_m": 1.85,
    })  # fmt: skip
    return traces, trips


def test_emissions_and_hard_brakes_are_counted_by_the_distance_of_all_vehicles() -> None:
    traces, trips = stream(n=4, headway_s=10.0, speed=20.0)
    braking = (traces["vehicle_id"] == "v001") & (traces["x_m"] > 600)
    traces.loc[braking, "speed_mps"] = 10.0
    trips["distance_m"] = 500.0  # 2 vehicle-kilometres
    found = measure(traces, trips, warm_up_s=0).summary
    assert (found.n_hard_braking, found.hard_brakes_per_1000_vkm) == (1, 500)
    assert (found.co2_g_per_vkm, found.nox_g_per_vkm, found.fuel_g_per_vkm) == pytest.approx((600, 0.4, 200))


def test_delays_are_the_mean_and_the_95th_percentile_of_those_that_came_through() -> None:
    traces, trips = stream(n=21, headway_s=3.0, speed=25.0)
    trips["time_loss_s"] = np.arange(21.0)
    found = measure(traces, trips, warm_up_s=0).summary
    assert (found.mean_delay_s, found.p95_delay_s) == pytest.approx((2 + 10, 2 + 19))
    assert found.mean_travel_time_s == pytest.approx(LAYOUT.road.length / 25)
    assert found.n_merges == 0


def test_bottleneck_is_the_end_of_the_last_merging_taper_or_the_start_of_a_zone_that_closes_no_lane() -> None:
    assert bottleneck_station(LAYOUT) == pytest.approx(536.448)
    shoulder = paper_layout(closed_lanes=(), shift_ft=0, shifted_lane_width_ft=None)
    assert bottleneck_station(shoulder) == pytest.approx(243.84)
    two_lanes = paper_layout(closed_lanes=(1, 2), shift_ft=0, shifted_lane_width_ft=None, work_length_ft=200)
    tapers = [area for area in two_lanes.areas if area.name.startswith("merging taper")]
    assert len(tapers) == 2
    assert bottleneck_station(two_lanes) == tapers[1].end


@pytest.mark.parametrize(("loss_mps", "n_brakes"), [(2.66, 0), (2.68, 1)])
def test_hard_brake_is_a_loss_of_2_67_metres_a_second_within_a_second(loss_mps: float, n_brakes: int) -> None:
    speed = [25.0, 25.0, 25.0 - loss_mps, 25.0 - loss_mps]
    assert count_hard_brakes(["a"] * 4, speed, dt=1.0).sum() == n_brakes


def test_speed_is_compared_with_that_of_a_second_before_on_any_clock() -> None:
    # 2.5 m/s2 for two seconds: 2.5 m/s a second, 5 m/s over two.
    for dt in (0.1, 0.25, 0.5):
        speed = 25 - 2.5 * np.clip(np.arange(0, 6, dt) - 2, 0, 2)
        assert count_hard_brakes(["a"] * len(speed), speed, dt=dt).sum() == 0
        assert count_hard_brakes(["a"] * len(speed), 1.1 * speed, dt=dt).sum() == 1
    assert count_hard_brakes(["a"] * 4, [25.0, 25.0, 19.0, 19.0], dt=2.0).sum() == 1  # 3 m/s2
    assert count_hard_brakes(["a"] * 4, [25.0, 25.0, 20.0, 20.0], dt=2.0).sum() == 0  # 2.5 m/s2
