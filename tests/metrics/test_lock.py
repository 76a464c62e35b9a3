import numpy as np
import pandas as pd
import pytest
from builders import by_turns_layout, paper_layout

from wzsumo.metrics.lock import Lock, find_lock
from wzsumo.work_zone import WorkZoneLayout

PAPER, BY_TURNS = paper_layout(), by_turns_layout()


def standing(vehicle: str, *, from_s: float, to_s: float, station: float, until_s: float = 400.0) -> pd.DataFrame:
    """A vehicle that drives 10 m/s but for the time from `from_s` to `to_s`, where it stands at `station`."""
    time = np.arange(0.0, until_s, 0.5)
    stands = (time >= from_s) & (time <= to_s)
    s = station + 10 * np.where(time < from_s, time - from_s, np.maximum(time - to_s, 0.0))
    return pd.DataFrame({"vehicle_id": vehicle, "time_s": time, "s": s, "speed_mps": np.where(stands, 0.0, 10.0)})


def lock_of(*vehicles: pd.DataFrame, layout: WorkZoneLayout = PAPER) -> Lock | None:
    table = pd.concat(vehicles, ignore_index=True)
    return find_lock(table, table["s"].to_numpy(), layout)


def test_vehicle_that_stands_for_three_minutes_locks_the_traffic_from_when_it_stopped() -> None:
    assert lock_of(standing("a", from_s=100, to_s=281, station=350)) == Lock(began_s=100.0, station_m=350.0)
    assert lock_of(standing("a", from_s=100, to_s=279, station=350)) is None


def test_vehicle_that_stands_until_the_run_ends_locks_it_and_the_earliest_one_tells_where() -> None:
    head = standing("b", from_s=120, to_s=400, station=500)
    behind = standing("a", from_s=150, to_s=400, station=480)
    assert lock_of(behind, head) == Lock(began_s=120.0, station_m=500.0)


def test_stops_of_two_vehicles_one_after_the_other_are_no_lock() -> None:
    one = standing("a", from_s=270, to_s=400, station=500)
    other = standing("b", from_s=0, to_s=130, station=500)
    assert lock_of(one, other) is None


def test_stop_and_go_is_no_lock() -> None:
    rows = standing("a", from_s=20, to_s=390, station=300)
    assert lock_of(rows) is not None
    rows.loc[rows["time_s"].isin([150.0, 300.0]), "speed_mps"] = 0.5
    assert lock_of(rows) is None


@pytest.mark.parametrize(("stands_s", "locked"), [(200.0, False), (290.0, True)])
def test_vehicle_may_wait_longer_for_its_turn_on_a_shared_lane_by_twice_the_time_that_clears_it(
    stands_s: float, locked: bool
) -> None:
    turns = BY_TURNS.taking_turns
    assert turns is not None
    assert 400 < turns.end - turns.start < 500  # m: 80 to 100 s more at 10 m/s
    found = lock_of(standing("a", from_s=50, to_s=50 + stands_s, station=200), layout=BY_TURNS)
    assert (found is not None) == locked
