import numpy as np
import pandas as pd
import pytest
from builders import paper_road

from wzsumo.metrics.delay_behind import delay_behind
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
ROAD = paper_road()


def trace(name, start_m, *, speed, times):
    """A vehicle's centre along the middle of the road; a negative speed comes the other way."""
    x, y = ROAD.to_xy(start_m + speed * (times - times[0]), np.full_like(times, 5.0)).T
    return pd.DataFrame({"vehicle_id": name, "time_s": times, "x_m": x, "y_m": y})


def ego_log(start_m, *, speed, times):
    rows = trace("ego", start_m, speed=speed, times=times)
    return rows.assign(heading_rad=0.0, x_m=rows["x_m"] - CAR.axle_to_centre_m)


def delay(ego, *followers):
    undisturbed = trace("before", 0.0, speed=25.0, times=np.arange(0.0, 60.0, 0.1))  # 25 m/s from 0 to 1,500 m
    return delay_behind(ego, pd.concat(followers), undisturbed, road=ROAD, vehicle=CAR)


TIMES = np.arange(100.0, 131.0)


def test_follower_at_the_egos_speed_loses_what_the_same_way_takes_less_without_it() -> None:
    measured = delay(ego_log(300, speed=10.0, times=TIMES), trace("a", 250, speed=10.0, times=TIMES))
    assert measured.n_behind == 1
    assert measured.delay_behind_s == pytest.approx(30 - 300 / 25)


def test_vehicles_ahead_of_the_ego_and_those_that_come_the_other_way_lose_nothing_by_it() -> None:
    ahead = trace("ahead", 400, speed=10.0, times=TIMES)
    oncoming = trace("oncoming", 290, speed=-10.0, times=TIMES)
    measured = delay(ego_log(300, speed=10.0, times=TIMES), ahead, oncoming)
    assert (measured.n_behind, measured.delay_behind_s) == (0, 0.0)


def test_who_overtakes_the_ego_is_counted_until_then() -> None:
    # From 100 m behind at 20 m/s beside an ego of 10 m/s: alongside after 10 s; 200 m take 8 s at 25 m/s.
    measured = delay(ego_log(300, speed=10.0, times=TIMES), trace("a", 200, speed=20.0, times=TIMES))
    assert measured.delay_behind_s == pytest.approx(10 - 200 / 25, abs=0.2)


def test_beyond_the_traces_without_the_ego_their_fastest_pace_holds() -> None:
    slow = trace("before", 500.0, speed=20.0, times=np.arange(0.0, 30.0, 0.1))
    ego, follower = ego_log(300, speed=10.0, times=TIMES[:11]), trace("a", 250, speed=10.0, times=TIMES[:11])
    measured = delay_behind(ego, follower, slow, road=ROAD, vehicle=CAR)
    assert measured.delay_behind_per_vehicle_s == pytest.approx(10 - 100 / 20)


def test_same_drivers_at_their_own_speed_behind_a_fast_ego_lose_nothing() -> None:
    followers = [trace(f"v{n}", 100 + 30 * n, speed=25.0, times=TIMES) for n in range(5)]
    measured = delay(ego_log(300, speed=25.0, times=TIMES), *followers)
    assert measured.n_behind == 5
    assert measured.delay_behind_s == pytest.approx(0, abs=1e-9)
