import numpy as np
import pandas as pd
import pytest
from builders import paper_layout

from wzsumo.metrics.traffic import (
    MINUTE_COLUMNS,
    STATION_COLUMNS,
    VEHICLE_COLUMNS,
    bottleneck_station,
    count_hard_brakes,
    measure_traffic,
)
from wzsumo.simulation.trips import TRIP_COLUMNS

LAYOUT = paper_layout()
DT = 0.5
LANE_1_M = 1.5 * 12 * 0.3048  # centre of the middle lane before the shift


def stream(*, n, headway_s, speed, offset=LANE_1_M):
    """A trace table of n cars on the whole road, one headway after the other at one speed, and their trips."""
    length = LAYOUT.road.length
    traces, trips = [], []
    for k in range(n):
        time = np.arange(0, length / speed, DT)
        x = speed * time
        row = {"vehicle_id": f"v{k:03d}", "time_s": time + k * headway_s, "x_m": x, "y_m": offset, "heading_rad": 0.0}
        traces.append(pd.DataFrame(row | {"speed_mps": speed, "length_m": 4.8, "width_m": 1.85}))
        trips.append((f"v{k:03d}", 2.0, True, True, length / speed, 7.0, length, 300.0, 0.2, 100.0))
    return pd.concat(traces, ignore_index=True), pd.DataFrame(trips, columns=list(TRIP_COLUMNS))


def measure(traces, trips, *, warm_up_s=120.0):
    return measure_traffic(traces, trips, LAYOUT, dt=DT, warm_up_s=warm_up_s)


@pytest.fixture(scope="module")
def uniform():
    return measure(*stream(n=200, headway_s=3.0, speed=25.0))


def test_tables_have_the_documented_columns(uniform) -> None:
    for table, columns in (
        (uniform.vehicles, VEHICLE_COLUMNS), (uniform.minutes, MINUTE_COLUMNS), (uniform.stations, STATION_COLUMNS),
    ):  # fmt: skip
        assert list(table.columns) == list(columns)
        assert all(columns.values())


def test_uniform_stream_has_the_throughput_of_its_headway(uniform) -> None:
    assert uniform.minutes["count"].iloc[2:9].tolist() == [20] * 7
    assert uniform.summary.throughput_vph == 1200


def test_stream_without_a_slow_vehicle_has_no_queue_no_breakdown_and_no_conflict(uniform) -> None:
    summary = uniform.summary
    assert summary.max_queue_length_m == 0
    assert np.isnan(summary.breakdown_s)
    assert np.isnan(summary.queue_discharge_vph)
    assert (summary.n_ttc_conflicts, summary.n_drac_conflicts, summary.n_overlapping, summary.n_hard_braking) == (0, 0, 0, 0)
    assert summary.speed_sd_taper_mps == pytest.approx(0, abs=1e-6)


def test_delay_counts_the_wait_to_enter(uniform) -> None:
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
    slow = traces["x_m"].between(end - 405, end) & (traces["time_s"] > 960)
    traces.loc[slow, "speed_mps"] = 4.0
    found = measure(traces, trips).summary
    assert found.max_queue_length_m == pytest.approx(405, abs=20)  # cells of 20 m
    assert found.breakdown_s == pytest.approx(960, abs=60)
    assert found.peak_flow_vph == 1200


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
    trips.loc[3] = ["v003", 55.0, False, False, np.nan, np.nan, 0.0, 0.0, 0.0, 0.0]
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
