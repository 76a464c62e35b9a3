import numpy as np
import pandas as pd
import pytest
from builders import paper_road

from wzsumo.frames import FloatArray
from wzsumo.metrics.delay_behind import DelayBehind, delay_behind
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
ROAD = paper_road()


def trace(name: str, start_m: float, *, speed: float, times: FloatArray) -> pd.DataFrame:
    """A vehicle's centre along the middle of the road; a negative speed comes the other way."""
    x, y = ROAD.to_xy(start_m + speed * (times - times[0]), np.full_like(times, 5.0)).T
    return pd.DataFrame({"vehicle_id": name, "time_s": times, "x_m": x, "y_m": y})


def ego_log(start_m: float, *, speed: float, times: FloatArray) -> pd.DataFrame:
    rows = trace("ego", start_m, speed=speed, times=times)
    return rows.assign(heading_rad=0.0, x_m=rows["x_m"] - CAR.axle_to_centre_m)


def delay(ego: pd.DataFrame, *followers: pd.DataFrame) -> DelayBehind:
    undisturbed = trace("before", 0.0, speed=25.0, times=np.arange(0.0, 60.0, 0.1))  # 25 m/s from 0 to 1,500 m
    return delay_behind(ego, pd.concat(followers), undisturbed, road=ROAD, vehicle=CAR)


TIMES = np.arange(100.0, 131.0)


def test_follower_at_the_egos_speed_loses_its_time_less_what_the_same_distance_takes_without_it() -> None:
    measured = delay(ego_log(300, speed=10.0, times=TIMES), trace("a", 250, speed=10.0, times=TIMES))
    assert measured.n_behind == 1
    assert measured.delay_behind_s == pytest.approx(30 - 300 / 25)


def test_vehicles_ahead_of_the_ego_and_those_that_come_the_other_way_lose_nothing_by_it() -> None:
    ahead = trace("ahead", 400, speed=10.0, times=TIMES)
    oncoming = trace("oncoming", 290, speed=-10.0, times=TIMES)
    measured = delay(ego_log(300, speed=10.0, times=TIMES), ahead, oncoming)
    assert (measured.n_behind, measured.delay_behind_s) == (0, 0.0)


def test_vehicle_that_overtakes_the_ego_counts_until_then() -> None:
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


def test_delay_is_the_sum_over_the_vehicles_and_the_mean_over_those_behind() -> None:
    followers = [trace(f"v{n}", 100 + 30 * n, speed=10.0, times=TIMES) for n in range(4)]
    ahead = trace("ahead", 500, speed=10.0, times=TIMES)
    measured = delay(ego_log(300, speed=10.0, times=TIMES), *followers, ahead)
    assert measured.n_behind == 4
    assert measured.delay_behind_s == pytest.approx(4 * 18)
    assert measured.delay_behind_per_vehicle_s == pytest.approx(18)


def test_vehicle_is_behind_while_its_centre_is_behind_the_egos_centre() -> None:
    at_ego = (trace("v", 300 + off, speed=10.0, times=TIMES) for off in (-0.1, 0.1))
    assert [delay(ego_log(300, speed=10.0, times=TIMES), table).n_behind for table in at_ego] == [1, 0]


def test_times_before_and_after_the_ego_drove_do_not_count() -> None:
    times = np.arange(80.0, 151.0)  # the ego drives from 100 to 130 s
    measured = delay(ego_log(900, speed=10.0, times=TIMES), trace("a", 50, speed=10.0, times=times))
    # 31 intervals begin while it drives, those at 100 and at 130 s included.
    assert measured.delay_behind_s == pytest.approx(31 - 310 / 25)


def test_gap_in_a_vehicles_fixes_does_not_count() -> None:
    whole = trace("a", 250, speed=10.0, times=TIMES)
    gappy = whole[~whole["time_s"].between(109.5, 114.5)]  # without 110 to 114 s: the interval that begins at 109 s is 6 s long
    other = trace("b", 400, speed=10.0, times=TIMES)  # ahead of the ego; it tells the interval
    measured = delay(ego_log(300, speed=10.0, times=TIMES), gappy, other)
    assert measured.delay_behind_s == pytest.approx((30 - 6) * (1 - 10 / 25))


def test_pace_without_the_ego_is_that_of_each_bin_of_25_m() -> None:
    # 25 m/s up to 500 m and 10 m/s beyond; the follower drives from 450 to 550 m in 30 s.
    fast, slow = np.arange(0.0, 20.0, 0.1), np.arange(20.0, 70.0, 0.1)
    undisturbed = pd.concat([
        trace("before", 0.0, speed=25.0, times=fast), trace("before", 500.0, speed=10.0, times=slow),
    ])  # fmt: skip
    ego, follower = ego_log(700, speed=10.0, times=TIMES), trace("a", 450, speed=100 / 30, times=TIMES)
    measured = delay_behind(ego, follower, undisturbed, road=ROAD, vehicle=CAR)
    assert measured.delay_behind_s == pytest.approx(30 - (50 / 25 + 50 / 10), abs=0.02)


def test_pace_of_a_bin_without_traces_lies_between_those_of_its_neighbours() -> None:
    # Traces from 300 to 400 m at 20 m/s and from 500 to 600 m at 10 m/s: paces of 0.05 and 0.1 s/m, half way in between.
    undisturbed = pd.concat([
        trace("u", 300.0, speed=20.0, times=np.arange(0.0, 5.01, 0.05)),
        trace("w", 500.0, speed=10.0, times=np.arange(0.0, 10.01, 0.1)),
    ])  # fmt: skip
    ego, follower = ego_log(700, speed=10.0, times=TIMES), trace("a", 425, speed=50 / 30, times=TIMES)
    measured = delay_behind(ego, follower, undisturbed, road=ROAD, vehicle=CAR)
    assert measured.delay_behind_s == pytest.approx(30 - 50 * 0.075, abs=0.2)


def test_standing_time_counts_in_the_pace_and_backward_jumps_do_not() -> None:
    # 10 s of standing at 500 m on a drive at 20 m/s: the bin of 25 m there takes 11.25 s.
    undisturbed = pd.concat([
        trace("u", 0.0, speed=20.0, times=np.arange(0.0, 25.0, 0.1)),
        trace("u", 500.0, speed=0.0, times=np.arange(25.0, 35.0, 0.1)),
        trace("u", 500.0, speed=20.0, times=np.arange(35.0, 60.0, 0.1)),
        trace("back", 520.0, speed=-5.0, times=np.arange(0.0, 20.0, 0.1)),
    ])  # fmt: skip
    ego, follower = ego_log(700, speed=10.0, times=TIMES), trace("a", 450, speed=100 / 30, times=TIMES)
    measured = delay_behind(ego, follower, undisturbed, road=ROAD, vehicle=CAR)
    assert measured.delay_behind_s == pytest.approx(30 - (10 + 100 / 20), abs=0.5)  # a bin holds 24 or 26 m of steps of 2 m
