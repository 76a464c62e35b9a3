import numpy as np
import pandas as pd
import pytest
from builders import bent_road

from wzsumo.ego import EgoRun, Outcome
from wzsumo.metrics.drive import measure_drive
from wzsumo.tables import EGO_LOG_COLUMNS, TRACE_COLUMNS, TRACE_OPTIONAL_COLUMNS
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
STEP_S = 0.05
NOBODY = pd.DataFrame(columns=[*TRACE_COLUMNS, *TRACE_OPTIONAL_COLUMNS])


def run_of(speed, *, curvature=0.0, traffic=NOBODY):
    """A run along +x, or on a circle to the left, with speeds (n,) at steps of 0.05 s from t = 100 s."""
    speed = np.asarray(speed, dtype=float)
    s = np.concatenate([[0.0], np.cumsum(speed[:-1] * STEP_S)])
    heading = curvature * s
    x, y = (np.sin(heading) / curvature, (1 - np.cos(heading)) / curvature) if curvature else (s, 0 * s)
    log = pd.DataFrame(dict.fromkeys(EGO_LOG_COLUMNS, 0.0), index=range(len(speed)))
    log = log.assign(time_s=100 + STEP_S * np.arange(len(speed)), x_m=x, y_m=y, heading_rad=heading, speed_mps=speed)
    return EgoRun(log=log, traffic=traffic, followers=NOBODY, replans=(), outcome=Outcome.REACHED_GOAL, reason="")


def leader_trace(gap_m, *, speed, duration_s=5.0):
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


def test_slower_vehicle_in_the_next_lane_of_a_bend_is_on_no_collision_course_with_who_follows_the_bend() -> None:
    road = bent_road(1000)  # to the left
    time = 100 + 0.1 * np.arange(50)
    stations = {"ego": 400 + 27 * (time - 100), "v1": 440 + 20 * (time - 100)}
    places = {name: road.to_xy(s, road.lane_centre(lane)) for (name, s), lane in zip(stations.items(), (1, 0), strict=True)}
    headings = {name: road.heading_at(s) for name, s in stations.items()}
    log = pd.DataFrame(dict.fromkeys(EGO_LOG_COLUMNS, 0.0), index=range(50))
    log = log.assign(time_s=time, x_m=places["ego"][:, 0], y_m=places["ego"][:, 1], heading_rad=headings["ego"], speed_mps=27.0)
    rows = {"vehicle_id": "v1", "time_s": time, "x_m": places["v1"][:, 0], "y_m": places["v1"][:, 1]}
    other = pd.DataFrame(rows | {"heading_rad": headings["v1"], "speed_mps": 20.0, "length_m": 4.8, "width_m": 1.85})
    run = EgoRun(log=log, traffic=other, followers=NOBODY, replans=(), outcome=Outcome.REACHED_GOAL, reason="")
    assert measure_drive(run, CAR).min_ttc_s < 5  # the trap: both taken to leave the bend
    assert measure_drive(run, CAR, road=road).min_ttc_s == np.inf


def test_drive_on_an_empty_road_has_no_conflict() -> None:
    measures = measure_drive(run_of(np.full(40, 10.0)), CAR)
    assert (measures.min_ttc_s, measures.max_drac_mps2, measures.min_pet_s) == (np.inf, 0.0, np.inf)
    assert measures.mean_speed_mps == 10
