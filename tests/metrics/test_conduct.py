from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest
from builders import by_turns_layout, paper_layout

from wzsumo.ego import EgoRun, Outcome
from wzsumo.metrics.clearance import Clearance
from wzsumo.metrics.conduct import Conduct, ConductLimits, faults_of, measure_conduct
from wzsumo.tables import EGO_LOG_COLUMNS, TRACE_COLUMNS, TRACE_OPTIONAL_COLUMNS
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

CAR = VehicleGeometry()
LAYOUT = paper_layout(shift_ft=0, shifted_lane_width_ft=None)
STEP_S, MIDDLE = 0.05, 5.486  # the middle of lane 1
NOBODY = pd.DataFrame(columns=[*TRACE_COLUMNS, *TRACE_OPTIONAL_COLUMNS])
WIDE = Clearance(min_clearance_devices_m=1.0, min_clearance_road_edge_m=1.0, closed_area_share=0.0)


def run_of(speed: npt.ArrayLike, *others: pd.DataFrame, y: float = MIDDLE, start: float = 300.0) -> EgoRun:
    """A run along +x from a station with speeds (n,) at steps of 0.05 s from t = 100 s, among others."""
    speeds = np.asarray(speed, dtype=float)
    x = start + np.concatenate([[0.0], np.cumsum(speeds[:-1] * STEP_S)])
    log = pd.DataFrame(dict.fromkeys(EGO_LOG_COLUMNS, 0.0), index=range(len(speeds)))
    log = log.assign(time_s=100 + STEP_S * np.arange(len(speeds)), x_m=x, y_m=y, speed_mps=speeds)
    traffic = pd.concat(others, ignore_index=True) if others else NOBODY
    return EgoRun(log=log, traffic=traffic, followers=NOBODY, replans=(), outcome=Outcome.REACHED_GOAL, reason="")


def other(name: str, speed: npt.ArrayLike, *, ahead_m: float, y: float = MIDDLE, start: float = 300.0) -> pd.DataFrame:
    """A 4.8 m car, its centre `ahead_m` before the ego's rear axle at t = 100 s; a negative one is behind. Speeds at 10 Hz."""
    speeds = np.asarray(speed, dtype=float)
    x = start + ahead_m + np.concatenate([[0.0], np.cumsum(speeds[:-1] * 0.1)])
    rows = {"vehicle_id": name, "time_s": 100 + 0.1 * np.arange(len(speeds)), "x_m": x, "y_m": y, "heading_rad": 0.0}
    return pd.DataFrame(rows | {"speed_mps": speeds, "length_m": 4.8, "width_m": 1.85})


def braking(
    from_mps: float, rate: float, *, steps: int, dt: float, before: int = 100, after: int = 100
) -> npt.NDArray[np.float64]:
    """Speeds of a vehicle that brakes at a rate [m/s2] for some steps, and keeps its speed before and after."""
    slower = from_mps - rate * dt * np.arange(1, steps + 1)
    return np.concatenate([np.full(before, from_mps), slower, np.full(after, slower[-1])])


def conduct_of(run: EgoRun, layout: WorkZoneLayout = LAYOUT) -> Conduct:
    return measure_conduct(run, CAR, layout)


def test_steady_drive_alone_is_clean() -> None:
    conduct = conduct_of(run_of(np.full(800, 20.0)))
    assert faults_of(Outcome.REACHED_GOAL, conduct, WIDE) == ()
    assert (conduct.braking_unprompted_mps2, conduct.n_stops, conduct.over_line_share) == (0.0, 0, 0.0)
    assert conduct.min_time_gap_s == conduct.min_ttc_ahead_s == np.inf


@pytest.mark.parametrize(("rate", "clean"), [(3.3, True), (3.5, False)])
def test_braking_is_clean_up_to_aashtos_comfortable_rate(rate: float, clean: bool) -> None:
    conduct = conduct_of(run_of(braking(20.0, rate, steps=40, dt=STEP_S)))
    assert conduct.braking_unprompted_mps2 == pytest.approx(rate)
    assert any("braked" in fault for fault in faults_of(Outcome.REACHED_GOAL, conduct, WIDE)) != clean
    assert conduct.over_comfort_s == pytest.approx(2.0, abs=0.3)


def test_braking_for_an_emergency_of_the_one_ahead_is_prompted() -> None:
    leader = other("v1", braking(20.0, 6.0, steps=20, dt=0.1, before=50), ahead_m=40.0)
    own = braking(20.0, 5.0, steps=40, dt=STEP_S, before=105)
    assert conduct_of(run_of(own, leader)).braking_unprompted_mps2 < 1
    beside = leader.assign(y_m=MIDDLE - 3.658)
    assert conduct_of(run_of(own, beside)).braking_unprompted_mps2 == pytest.approx(5.0)


def test_braking_for_who_cuts_in_too_closely_is_prompted() -> None:
    cutting = other("v1", np.full(200, 10.0), ahead_m=3.72 + 2.4 + 55.0)  # 55 m ahead at 10 m/s less: comes near
    cutting["y_m"] = np.where(cutting["time_s"] < 104.0, MIDDLE - 3.658, MIDDLE)  # at 104 s the gap is 15 m
    own = braking(20.0, 4.5, steps=40, dt=STEP_S, before=82)
    # 10^2 / (2 x 15) = 3.3 is asked for by 104.0 s, and more than 3.4 a step later; it was there only from then on.
    nearer = cutting.assign(x_m=cutting["x_m"] - 3.0)
    assert conduct_of(run_of(own, nearer)).braking_unprompted_mps2 < 2  # all but the last quarter of a second
    farther = cutting.assign(x_m=cutting["x_m"] + 15.0)
    assert conduct_of(run_of(own, farther)).braking_unprompted_mps2 == pytest.approx(4.5)


def test_stop_with_an_empty_road_ahead_is_one_in_a_live_lane() -> None:
    speed = np.concatenate([np.full(100, 10.0), np.zeros(60), np.full(100, 10.0)])
    conduct = conduct_of(run_of(speed))
    assert (conduct.n_stops, conduct.n_unprompted_stops) == (1, 1)
    assert conduct.unprompted_stop_s == pytest.approx(3.0, abs=0.1)
    assert "stopped in a live lane for 3.0 s (limit 0)" in faults_of(Outcome.REACHED_GOAL, conduct, WIDE)


def test_stop_behind_a_queue_is_prompted_and_one_behind_a_far_vehicle_is_not() -> None:
    speed = np.concatenate([np.full(100, 10.0), np.zeros(60), np.full(100, 10.0)])
    stands = np.zeros(130)
    at_stop = 50.0 + 3.72 + 2.4  # where the ego stops, from its rear axle at the start to the centre of one at no gap
    assert conduct_of(run_of(speed, other("v1", stands, ahead_m=at_stop + 5.0))).n_unprompted_stops == 0
    assert conduct_of(run_of(speed, other("v1", stands, ahead_m=at_stop + 40.0))).n_unprompted_stops == 1


def test_stop_before_a_stop_line_is_prompted() -> None:
    layout = by_turns_layout()
    assert layout.taking_turns is not None
    speed = np.concatenate([np.full(100, 10.0), np.zeros(60), np.full(20, 1.0)])
    at_line = layout.taking_turns.start - 3.72 - 50.0
    assert conduct_of(run_of(speed, y=1.829, start=at_line - 2.0), layout).n_unprompted_stops == 0
    assert conduct_of(run_of(speed, y=1.829, start=at_line - 60.0), layout).n_unprompted_stops == 1


@pytest.mark.parametrize(("rate", "clean"), [(3.8, True), (4.3, False)])
def test_braking_of_the_one_behind_for_an_ego_that_brakes_is_clean_up_to_mobils_safe_rate(rate: float, clean: bool) -> None:
    behind = other("v1", braking(20.0, rate, steps=20, dt=0.1, before=60), ahead_m=-30.0)
    conduct = conduct_of(run_of(braking(20.0, 2.5, steps=40, dt=STEP_S, before=110), behind))
    assert conduct.braking_behind_mps2 == conduct.braking_asked_behind_mps2 == pytest.approx(rate)
    assert any("had to brake" in fault for fault in faults_of(Outcome.REACHED_GOAL, conduct, WIDE)) != clean


def test_braking_of_one_behind_who_has_had_room_all_along_is_its_own_choice() -> None:
    behind = other("v1", braking(20.0, 4.5, steps=20, dt=0.1, before=60), ahead_m=-90.0)
    for own in (np.full(400, 11.0), braking(12.0, 1.8, steps=40, dt=STEP_S, before=110)):  # 9 m/s closing in at 84 m: 0.5 m/s2
        conduct = conduct_of(run_of(own, behind))
        assert conduct.braking_behind_mps2 == pytest.approx(4.5)
        assert conduct.braking_asked_behind_mps2 == 0


@pytest.mark.parametrize(("room_m", "asked"), [(8.0, 4.5), (16.0, 0.0)])
def test_ego_that_comes_before_another_asks_for_braking_where_room_lacks(room_m: float, asked: float) -> None:
    # 20 m/s behind 10 m/s: 100 / (2 x 4) = 12.5 m is the room for 4 m/s2.
    behind = other("v1", braking(20.0, 4.5, steps=20, dt=0.1, before=1), ahead_m=3.72 - 4.64 - 2.4 - room_m)
    conduct = conduct_of(run_of(np.full(200, 10.0), behind))
    assert conduct.braking_asked_behind_mps2 == pytest.approx(asked)


def test_braking_of_one_that_is_second_behind_or_in_the_next_lane_is_not_the_egos_doing() -> None:
    hard = braking(20.0, 6.0, steps=20, dt=0.1, before=60)
    second = other("v2", hard, ahead_m=-60.0)
    first = other("v1", np.full(200, 19.0), ahead_m=-20.0)
    beside = other("v3", hard, ahead_m=-30.0, y=MIDDLE - 3.658)
    assert conduct_of(run_of(np.full(400, 19.0), first, second, beside)).braking_behind_mps2 == pytest.approx(0, abs=0.01)


def test_jerk_limit_falls_from_5_at_low_speed_to_2_5_at_high_speed() -> None:
    limits = ConductLimits().jerk_at(np.array([0.0, 5.0, 12.5, 20.0, 30.0]))
    np.testing.assert_allclose(limits, [5.0, 5.0, 3.75, 2.5, 2.5])  # ISO 15622
    # From 0 to -3 m/s2 within a step: 3 m/s3 over a second, too much at 25 m/s and not at 8 m/s.
    fast = conduct_of(run_of(braking(25.0, 3.0, steps=60, dt=STEP_S)))
    slow = conduct_of(run_of(braking(10.0, 3.0, steps=40, dt=STEP_S)))
    assert fast.max_jerk_1s_mps3 == pytest.approx(3.0, rel=0.05)
    assert (fast.over_jerk_s > 0, slow.over_jerk_s) == (True, 0.0)


def test_time_gap_is_that_to_one_who_has_been_ahead_for_five_seconds() -> None:
    near = other("v1", np.full(200, 20.0), ahead_m=3.72 + 2.4 + 10.0)  # 10 m at 20 m/s: half a second
    assert conduct_of(run_of(np.full(400, 20.0), near)).min_time_gap_s == pytest.approx(0.5)
    just_in = near.assign(y_m=np.where(near["time_s"] < 112.0, MIDDLE - 3.658, MIDDLE)).query("time_s < 116.5")
    assert conduct_of(run_of(np.full(330, 20.0), just_in)).min_time_gap_s == np.inf


def test_time_to_collision_is_gap_over_closing_speed() -> None:
    slower = other("v1", np.full(100, 15.0), ahead_m=3.72 + 2.4 + 60.0)  # after 9.9 s the gap is 60 - 5 x 9.9
    assert conduct_of(run_of(np.full(200, 20.0), slower)).min_ttc_ahead_s == pytest.approx((60 - 49.5) / 5, abs=0.05)


def test_each_limit_that_is_broken_is_named_with_its_figure() -> None:
    conduct = conduct_of(run_of(np.full(800, 20.0)))
    broken: dict[str, tuple[Any, str]] = {
        "n_lane_changes": (2, "changed lanes 2 times where 0 were needed (limit 0)"),
        "over_line_share": (0.07, "over a line for 7% of the zone (limit 0.06)"),
        "sd_off_middle_m": (0.36, "wove by 0.36 m about its lane's middle (limit 0.35)"),
        "min_ttc_ahead_s": (1.4, "time to collision 1.4 s (limit 1.5)"),
        "min_time_gap_s": (0.7, "time gap 0.7 s (limit 0.8)"),
    }
    for field, (value, words) in broken.items():
        assert faults_of(Outcome.REACHED_GOAL, replace(conduct, **{field: value}), WIDE) == (words,)
    close = replace(WIDE, min_clearance_devices_m=0.2)
    assert faults_of(Outcome.REACHED_GOAL, conduct, close) == ("0.20 m beside a device (limit 0.23)",)
    assert faults_of(Outcome.REACHED_GOAL, conduct, replace(WIDE, min_clearance_road_edge_m=0.1)) != ()
    assert faults_of(Outcome.TIMED_OUT, conduct, WIDE) == ("TIMED_OUT",)
