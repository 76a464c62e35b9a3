import numpy as np
import pandas as pd
import pytest

from wzsumo.crowd_mapping.cleaning.station_table import percentile_85_speed, tabulate
from wzsumo.crowd_mapping.reference_line import axis_of
from wzsumo.errors import TraceError
from wzsumo.tables import check_traces

AXIS = axis_of(np.array([[0.0, 0.0], [1000.0, 0.0]]))
FIVE_STATIONS = np.arange(0.0, 50.0, 10.0)


def trace(vehicle_id: str, x_m: object, y_m: object = 0.0) -> pd.DataFrame:
    x = np.asarray(x_m, dtype=float)
    return pd.DataFrame({"vehicle_id": vehicle_id, "time_s": np.arange(len(x)) / 2, "x_m": x, "y_m": y_m})


def others() -> pd.DataFrame:
    """Five vehicles along the axis, from 0 to 400 m."""
    return pd.concat([trace(f"v{i}", np.arange(0.0, 401.0, 5.0)) for i in range(5)], ignore_index=True)


def reason_for(odd: pd.DataFrame) -> str | None:
    dropped = tabulate(check_traces(pd.concat([others(), odd]), source="test"), AXIS).dropped
    return dict(zip(dropped["vehicle_id"], dropped["reason"], strict=True)).get("odd")


def test_offset_at_a_station_is_the_mean_of_the_fixes_within_5_m_of_it() -> None:
    table = trace("a", [-4.9, 4.9, 5.1, 14.9, 19.0, 31.0], [1.0, 3.0, 7.0, 9.0, -2.0, 5.0])
    made = tabulate(table, AXIS, stations=FIVE_STATIONS)
    np.testing.assert_allclose(made.offsets, [[2.0, 8.0, -2.0, 5.0, np.nan]])
    assert made.vehicle_ids == ("a",)


def test_stations_are_10_m_apart_over_all_fixes_but_a_wild_one_in_a_thousand() -> None:
    parts = [trace(f"v{i}", np.linspace(0.0, 300.0, 301)) for i in range(5)]
    wild = trace("v5", [*np.linspace(0.0, 300.0, 301), 990.0])
    stations = tabulate(pd.concat([*parts, wild]), AXIS).stations
    np.testing.assert_allclose(np.diff(stations), 10.0)
    assert stations[0] == pytest.approx(0.0, abs=1.0)
    assert 300 <= stations[-1] < 310


@pytest.mark.parametrize(
    ("odd", "reason"),
    [
        (trace("odd", np.linspace(100, 129, 30)), "advances by 29 m only"),
        (trace("odd", np.linspace(100, 131, 30)), None),
        (trace("odd", np.linspace(300, 269, 30)), "runs 31 m against the others"),
        (trace("odd", np.linspace(300, 271, 30)), "advances by -29 m only"),
        (trace("odd", [100.0, 140.0]), "has fixes around 2 stations, fewer than 3"),
        (trace("odd", [100.0, 120.0, 140.0]), None),
        (trace("odd", np.arange(0.0, 400.0, 5.0), 16.0), "lies 16 m beside the others"),
        (trace("odd", np.arange(0.0, 400.0, 5.0), -14.0), None),
    ],
)
def test_trace_that_does_not_fit_the_others_is_dropped_with_the_reason(odd: pd.DataFrame, reason: str | None) -> None:
    assert reason_for(odd) == reason


@pytest.mark.parametrize(("fix_m", "mean_m"), [(149.0, 49.67), (151.0, 0.0)])
def test_fix_150_m_beside_the_others_counts_in_no_station(fix_m: float, mean_m: float) -> None:
    # Three fixes around the station at 20 m, one of them far away.
    odd = trace("odd", [*np.arange(0.0, 15.0, 2.0), 18.0, 20.0, 21.0, 31.0, 45.0], [0.0] * 10 + [fix_m] + [0.0] * 2)
    made = tabulate(check_traces(pd.concat([others(), odd]), source="test"), AXIS, stations=FIVE_STATIONS)
    assert made.offsets[made.vehicle_ids.index("odd"), 2] == pytest.approx(mean_m, abs=0.01)


def test_traces_that_are_left_out_later_are_named_among_the_dropped() -> None:
    made = tabulate(others(), AXIS).without(np.array([False, True, False, True, False]), reason="of no use")
    assert made.vehicle_ids == ("v0", "v2", "v4")
    assert len(made.offsets) == 3
    assert made.dropped.to_dict("records") == [
        {"vehicle_id": "v1", "reason": "of no use"},
        {"vehicle_id": "v3", "reason": "of no use"},
    ]


def test_table_without_any_usable_trace_is_refused() -> None:
    with pytest.raises(TraceError, match=r"none of 2 traces can be used: has fixes around 1 stations, fewer than 3 \(a\)"):
        tabulate(pd.concat([trace("a", np.full(9, 5.0)), trace("b", np.full(9, 5.0))]), AXIS, stations=FIVE_STATIONS)


def at_speeds(speeds_mps: list[float], *, n: int = 61) -> pd.DataFrame:
    """Vehicles at constant speeds, one fix a second."""
    time = np.arange(float(n))
    parts = [pd.DataFrame({"vehicle_id": i, "time_s": time, "x_m": v * time, "y_m": 0.0}) for i, v in enumerate(speeds_mps)]
    return pd.concat(parts, ignore_index=True)


def test_speed_of_the_traffic_is_the_85th_percentile_of_the_vehicles() -> None:
    speeds = [float(speed) for speed in range(10, 31)]
    assert percentile_85_speed(at_speeds(speeds)) == pytest.approx(27.0)  # of 21 values in steps of 1 the 18th


def test_speed_of_a_vehicle_is_its_own_85th_percentile() -> None:
    # A vehicle that waits in a queue for 80 % of its time reaches 20 m/s in the rest.
    table = at_speeds([20.0], n=120)
    table["x_m"] = np.cumsum(np.where(np.arange(120) < 96, 5.0, 20.0))
    assert percentile_85_speed(table) == pytest.approx(20.0)


def test_speed_is_taken_over_3_s() -> None:
    # Fixes that are off by 1.5 m to and fro, a second apart: 3 m/s between neighbours, 1 m/s over 3 s, nothing over 6 s.
    table = at_speeds([20.0])
    table["x_m"] += 1.5 * (-1.0) ** np.arange(len(table))
    assert percentile_85_speed(table) == pytest.approx(21.0)


@pytest.mark.parametrize(("slow_mps", "speed_mps"), [(2.9, 20.0), (3.1, 3.1)])
def test_vehicles_slower_than_3_mps_say_nothing_about_the_speed(slow_mps: float, speed_mps: float) -> None:
    assert percentile_85_speed(at_speeds([slow_mps] * 20 + [20.0])) == pytest.approx(speed_mps)


def test_speed_of_parked_vehicles_is_taken_for_60_mph() -> None:
    assert percentile_85_speed(at_speeds([0.0, 2.0])) == 26.8
