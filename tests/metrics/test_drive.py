import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest
from builders import bent_road

from wzsumo.ego import EgoRun, Outcome
from wzsumo.metrics.drive import measure_drive, on_clock
from wzsumo.tables import EGO_LOG_COLUMNS, TRACE_COLUMNS, TRACE_OPTIONAL_COLUMNS
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
STEP_S = 0.05
NO_TRAFFIC = pd.DataFrame(columns=[*TRACE_COLUMNS, *TRACE_OPTIONAL_COLUMNS])


def run_of(speed: npt.ArrayLike, *, curvature: float = 0.0, traffic: pd.DataFrame = NO_TRAFFIC) -> EgoRun:
    """A run along +x, or on a circle to the left, with speeds (n,) at steps of 0.05 s from t = 100 s."""
    speeds = np.asarray(speed, dtype=float)
    s = np.concatenate([[0.0], np.cumsum(speeds[:-1] * STEP_S)])
    heading = curvature * s
    x, y = (np.sin(heading) / curvature, (1 - np.cos(heading)) / curvature) if curvature else (s, 0 * s)
    log = pd.DataFrame(dict.fromkeys(EGO_LOG_COLUMNS, 0.0), index=range(len(speeds)))
    log = log.assign(time_s=100 + STEP_S * np.arange(len(speeds)), x_m=x, y_m=y, heading_rad=heading, speed_mps=speeds)
    return EgoRun(log=log, traffic=traffic, followers=NO_TRAFFIC, replans=(), outcome=Outcome.REACHED_GOAL, reason="")


def leader_trace(gap_m: float, *, speed: float, duration_s: float = 5.0) -> pd.DataFrame:
    """A 4.8 m car in front of the ego's bumper by gap_m at t = 100 s."""
    time = np.arange(0, duration_s, 0.1)
    x = CAR.axle_to_bumper_m + gap_m + 2.4 + speed * time
    rows = {"vehicle_id": "v1", "time_s": 100 + time, "x_m": x, "y_m": 0.0, "heading_rad": 0.0, "speed_mps": speed}
    return pd.DataFrame(rows | {"length_m": 4.8, "width_m": 1.85})


def test_lateral_acceleration_on_a_circle_is_speed_squared_over_the_radius() -> None:
    assert measure_drive(run_of(np.full(200, 10.0), curvature=1 / 80), CAR).max_lateral_acceleration_mps2 == pytest.approx(1.25)


def test_braking_at_a_constant_rate_is_that_rate_and_its_jerk_the_step_over_half_a_second() -> None:
    speed = np.concatenate([np.full(100, 10.0), 10 - 2 * STEP_S * np.arange(60), np.full(100, 4.0)])
    measures = measure_drive(run_of(speed), CAR)
    assert measures.max_braking_mps2 == pytest.approx(2.0)
    assert measures.max_jerk_mps3 == pytest.approx(2.0 / 0.5, rel=0.15)


def test_time_at_a_standstill_is_counted() -> None:
    speed = np.concatenate([np.full(20, 10.0), np.zeros(40), np.full(20, 5.0)])
    assert measure_drive(run_of(speed), CAR).stopped_s == pytest.approx(2.0)


def test_conflict_with_a_slower_leader_has_hayward_and_cooper_figures() -> None:
    measures = measure_drive(run_of(np.full(80, 10.0), traffic=leader_trace(30.0, speed=6.0)), CAR)
    # After 3.9 s the gap is 30 - 4 * 3.9 = 14.4 m: TTC 14.4 / 4 = 3.6 s, DRAC 16 / (2 * 14.4).
    assert measures.min_ttc_s == pytest.approx(3.6, abs=0.03)
    assert measures.max_drac_mps2 == pytest.approx(16 / 28.8, rel=0.01)


def test_following_at_the_same_speed_has_a_time_gap_and_no_collision_course() -> None:
    measures = measure_drive(run_of(np.full(80, 10.0), traffic=leader_trace(15.0, speed=10.0)), CAR)
    assert measures.min_ttc_s == np.inf
    assert measures.max_drac_mps2 == 0
    assert measures.min_pet_s == pytest.approx(1.5, abs=0.11)  # one step of the clock


def test_slower_vehicle_in_the_next_lane_of_a_bend_is_on_no_collision_course_with_an_ego_that_follows_the_bend() -> None:
    road = bent_road(1000)  # to the left
    time = 100 + 0.1 * np.arange(50)
    stations = {"ego": 400 + 27 * (time - 100), "v1": 440 + 20 * (time - 100)}
    places = {name: road.to_xy(s, road.lane_centre(lane)) for (name, s), lane in zip(stations.items(), (1, 0), strict=True)}
    headings = {name: road.heading_at(s) for name, s in stations.items()}
    log = pd.DataFrame(dict.fromkeys(EGO_LOG_COLUMNS, 0.0), index=range(50))
    log = log.assign(time_s=time, x_m=places["ego"][:, 0], y_m=places["ego"][:, 1], heading_rad=headings["ego"], speed_mps=27.0)
    rows = {"vehicle_id": "v1", "time_s": time, "x_m": places["v1"][:, 0], "y_m": places["v1"][:, 1]}
    other = pd.DataFrame(rows | {"heading_rad": headings["v1"], "speed_mps": 20.0, "length_m": 4.8, "width_m": 1.85})
    run = EgoRun(log=log, traffic=other, followers=NO_TRAFFIC, replans=(), outcome=Outcome.REACHED_GOAL, reason="")
    assert measure_drive(run, CAR).min_ttc_s < 5  # the trap: both taken to leave the bend
    assert measure_drive(run, CAR, road=road).min_ttc_s == np.inf


def test_drive_on_an_empty_road_has_no_conflict() -> None:
    measures = measure_drive(run_of(np.full(40, 10.0)), CAR)
    assert (measures.min_ttc_s, measures.max_drac_mps2, measures.min_pet_s) == (np.inf, 0.0, np.inf)
    assert measures.mean_speed_mps == 10


@pytest.mark.parametrize(("speed_mps", "stopped_s"), [(0.09, 2.0), (0.11, 0.0)])
def test_ego_stands_below_a_tenth_of_a_metre_a_second(speed_mps: float, stopped_s: float) -> None:
    speed = np.concatenate([np.full(20, 10.0), np.full(40, speed_mps), np.full(20, 5.0)])
    assert measure_drive(run_of(speed), CAR).stopped_s == pytest.approx(stopped_s)


def test_braking_is_a_mean_over_half_a_second() -> None:
    # 3 m/s2 for 0.25 s: over the half second around it a mean of 1.5 m/s2.
    speed = np.concatenate([np.full(100, 10.0), 10 - 3 * STEP_S * np.arange(1, 6), np.full(100, 10 - 0.75)])
    assert measure_drive(run_of(speed), CAR).max_braking_mps2 == pytest.approx(1.5)


def test_drive_that_only_speeds_up_has_no_braking() -> None:
    assert measure_drive(run_of(5 + 0.05 * np.arange(100)), CAR).max_braking_mps2 == 0


def test_heading_that_passes_half_a_turn_is_no_jump() -> None:
    speed = np.full(400, 10.0)
    run = run_of(speed, curvature=1 / 20)
    wrapped = run.log.assign(heading_rad=np.angle(np.exp(1j * run.log["heading_rad"].to_numpy())))
    assert wrapped["heading_rad"].min() < -3
    turning = EgoRun(log=wrapped, traffic=NO_TRAFFIC, followers=NO_TRAFFIC, replans=(), outcome=Outcome.REACHED_GOAL, reason="")
    assert measure_drive(turning, CAR).max_lateral_acceleration_mps2 == pytest.approx(10**2 / 20)


def test_conflict_is_measured_from_the_outline_whose_centre_is_ahead_of_the_rear_axle() -> None:
    # In contact with the front bumper from the first moment on: 4.64 / 2 m ahead of the centre, 3.72 m ahead of the axle.
    touching, apart = (
        measure_drive(run_of(np.full(20, 10.0), traffic=leader_trace(gap, speed=10.0, duration_s=1.0)), CAR)
        for gap in (-0.01, 0.01)
    )
    assert (touching.min_ttc_s, touching.min_pet_s) == (0, 0)
    assert (apart.min_ttc_s, apart.min_pet_s) == (np.inf, 0.1)


def test_clock_of_the_surrounding_traffic_ticks_ten_times_a_second() -> None:
    assert on_clock([0.0, 0.05, 0.1, 0.1 + 5e-4, 0.1 + 2e-3, 7.3, 120.05]).tolist() == [
        True, False, True, True, False, True, False,
    ]  # fmt: skip
