import numpy as np
import pandas as pd
import pytest
from builders import paper_layout

from wzsumo.metrics.fleet import merge_positions, passages, summarise_fleet

# Shoulder taper from 243.84 m, merging taper from 316.99 to 536.45 m, activity area from 929.64 to 1127.76 m, end at 1267.97 m.
LAYOUT = paper_layout()
FOOT_M = 0.3048
RIGHT_M, LEFT_M = -4.5 * FOOT_M, 6.5 * FOOT_M  # centres of the two open lanes beside the work, 11 ft wide, from -10 ft on
CLOSING_M = 30 * FOOT_M  # centre of the left lane before its taper


def trace(
    name: str, x: tuple[float, float], y: tuple[float, float] | float, *, speed: float = 20.0, length: float = 4.8
) -> pd.DataFrame:
    """Fixes every metre on a straight line between two points, in the order of time."""
    n = round(abs(x[1] - x[0])) + 1
    ends = (y, y) if isinstance(y, float) else y
    return pd.DataFrame({
        "vehicle_id": name, "time_s": np.arange(n) / speed, "x_m": np.linspace(*x, n), "y_m": np.linspace(*ends, n),
        "heading_rad": 0.0 if x[1] > x[0] else np.pi, "speed_mps": speed, "length_m": length, "width_m": 1.85,
    })  # fmt: skip


def beside_the_work(offsets: dict[str, float]) -> pd.DataFrame:
    """One trace a vehicle through the whole zone that keeps to one offset."""
    return pd.concat([trace(name, (200.0, 1300.0), y) for name, y in offsets.items()], ignore_index=True)


def test_vehicle_has_passed_if_first_seen_before_the_zone_and_last_beyond_it() -> None:
    traces = pd.concat([
        trace("passed", (243.0, 1269.0), 1.0), trace("late", (244.5, 1300.0), 1.0), trace("not_yet", (200.0, 1267.0), 1.0),
        trace("opposing", (1300.0, 200.0), 1.0),
    ])  # fmt: skip
    assert passages(traces, LAYOUT).tolist() == ["passed"]
    summary = summarise_fleet(traces, LAYOUT)
    assert (summary.n_vehicles, summary.n_passed) == (4, 1)


def test_lateral_spread_is_the_scaled_median_deviation_from_the_median_of_each_lane() -> None:
    right = {f"r{n}": RIGHT_M + off for n, off in enumerate((-0.3, 0.0, 0.1, 0.2, 0.4))}  # median 0.1
    left = {f"l{n}": LEFT_M + off for n, off in enumerate((-0.2, 0.0, 0.6))}  # median 0.0
    deviations = [0.4, 0.1, 0.0, 0.1, 0.3, 0.2, 0.0, 0.6]
    summary = summarise_fleet(beside_the_work(right | left), LAYOUT)
    assert summary.lateral_sd_m == pytest.approx(1.4826 * np.median(deviations))


def test_spread_and_speed_count_fixes_of_the_activity_area_alone() -> None:
    steady = trace("v", (200.0, 1300.0), RIGHT_M, speed=20.0)
    there = steady["x_m"].between(929.64, 1127.76)
    steady.loc[~there, ["y_m", "speed_mps"]] = (1.0, 30.0)
    other = trace("w", (200.0, 1300.0), RIGHT_M + 0.4, speed=10.0)
    other.loc[~there, ["y_m", "speed_mps"]] = (1.0, 30.0)
    summary = summarise_fleet(pd.concat([steady, other]), LAYOUT)
    assert summary.mean_speed_activity_mps == pytest.approx(15.0)
    assert summary.lateral_sd_m == pytest.approx(1.4826 * 0.2)


def test_fleet_that_never_reached_the_activity_area_has_no_spread() -> None:
    summary = summarise_fleet(trace("v", (0.0, 300.0), 1.0), LAYOUT)
    assert np.isnan(summary.lateral_sd_m)
    assert np.isnan(summary.mean_speed_activity_mps)
    assert summary.merge_position_m == {}


@pytest.mark.parametrize(
    ("y", "n"),
    [
        (12 * FOOT_M - 1.85 / 2 - 0.01, 0),  # the left side 1 cm beside the line of devices
        (12 * FOOT_M - 1.85 / 2 + 0.0005, 0),  # half a millimetre over it: SUMO's coordinates are good to one
        (12 * FOOT_M - 1.85 / 2 + 0.01, 1),
    ],
)
def test_vehicle_counts_in_the_closed_area_by_its_outline(y: float, n: int) -> None:
    assert summarise_fleet(trace("v", (950.0, 1100.0), y), LAYOUT).n_in_closed_area == n


@pytest.mark.parametrize(("length", "n"), [(27.4, 0), (27.9, 1)])
def test_outline_of_a_long_vehicle_before_the_zone_reaches_into_it(length: float, n: int) -> None:
    # On the left shoulder, whose taper begins at 243.84 m: the last centre is at 230 m, half a length behind the front.
    traces = trace("v", (200.0, 230.0), 47 * FOOT_M, length=length)
    assert summarise_fleet(traces, LAYOUT).n_in_closed_area == n


def test_merge_position_is_the_last_station_in_the_closing_lane_from_the_start_of_its_taper() -> None:
    merging = trace("m", (200.0, 800.0), CLOSING_M)
    merging.loc[merging["x_m"] > 350.0, "y_m"] = 18 * FOOT_M
    never = trace("n", (200.0, 800.0), 18 * FOOT_M)
    beside = trace("s", (200.0, 300.0), 37 * FOOT_M)  # on the shoulder, beyond the lane's left line
    traces = pd.concat([merging, never, beside], ignore_index=True)
    found = merge_positions(traces.assign(s=traces["x_m"], d=traces["y_m"]), LAYOUT)
    assert found.to_dict() == {"m": pytest.approx(350.0 - 316.992)}


def test_reopened_lane_beyond_the_zone_is_no_closing_lane() -> None:
    traces = trace("v", (1268.0, 1500.0), CLOSING_M)
    assert merge_positions(traces.assign(s=traces["x_m"], d=traces["y_m"]), LAYOUT).empty


def test_merge_quantiles_count_vehicles_that_passed() -> None:
    traces = []
    for number in range(11):
        merging = trace(f"v{number}", (200.0, 1300.0), CLOSING_M)
        merging.loc[merging["x_m"] > 300.0 + 10 * number, "y_m"] = 1.0
        traces.append(merging)
    stuck = trace("stuck", (200.0, 500.0), CLOSING_M)
    found = summarise_fleet(pd.concat([*traces, stuck]), LAYOUT).merge_position_m
    expected = {f"q{q}": pytest.approx(300 + q - 316.992) for q in (10, 50, 90)}
    assert found == expected


def test_zone_that_closes_no_lane_to_merge_from_has_no_merge_positions() -> None:
    shoulder = paper_layout(closed_lanes=(), shift_ft=0, shifted_lane_width_ft=None)
    assert not any(area.name.startswith("merging taper") for area in shoulder.areas)
    assert summarise_fleet(trace("v", (200.0, 800.0), 1.0), shoulder).merge_position_m == {}
