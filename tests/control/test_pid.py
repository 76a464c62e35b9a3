from typing import Literal

import numpy as np
import pytest
from control.drives import drive, straight_path
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.control.pid import PaperPidMemory, PaperPidSpec, TunedPidMemory, TunedPidSpec, paper_pid, tuned_pid
from wzsumo.control.plant import PlantSpec
from wzsumo.control.speed_profile import Pace
from wzsumo.scenario.sections import ControlSection

Unit = Literal["m/s", "km/h"]
TimeBase = Literal["seconds", "steps"]


def slow_paper_pid(errors: list[float], *, dt: float, unit: Unit, time_base: TimeBase) -> float:
    """u_k = K_P e_k + K_I (e_{k-9} + ... + e_k) h + K_D (e_k - e_{k-1}) / h, written out for the last of the errors [m/s]."""
    scale = {"m/s": 1.0, "km/h": 3.6}[unit]
    h = {"seconds": dt, "steps": 1.0}[time_base]
    e = [scale * error for error in errors]
    total = 0.0
    for k in range(max(0, len(e) - 10), len(e)):
        total += e[k]
    derivative = (e[-1] - e[-2]) / h if len(e) > 1 else 0.0
    return max(-1.0, min(1.0, 0.5 * e[-1] + 0.018 * total * h + 0.4 * derivative))


@given(
    errors=st.lists(st.floats(-2, 2), min_size=1, max_size=30),
    dt=st.sampled_from([0.02, 0.05, 0.1]),
    unit=st.sampled_from(["m/s", "km/h"]),
    time_base=st.sampled_from(["seconds", "steps"]),
)
def test_paper_pid_equals_the_formula_written_out(errors: list[float], dt: float, unit: Unit, time_base: TimeBase) -> None:
    spec, memory = PaperPidSpec(error_unit=unit, time_base=time_base), PaperPidMemory()
    for k, error in enumerate(errors):
        pedal, memory = paper_pid(memory, error, dt=dt, spec=spec)
        assert pedal == pytest.approx(slow_paper_pid(errors[: k + 1], dt=dt, unit=unit, time_base=time_base), abs=1e-12)
    assert len(memory.errors) == min(len(errors), 10)


def test_paper_pid_chatters_between_its_stops_where_the_throttle_acts_at_once() -> None:
    # kd * full throttle = 0.4 * 3.5 = 1.4 > 1: each step answers the acceleration of the last, turned round and larger.
    run = drive(straight_path(2000), paper_control(), PlantSpec(powertrain_lag_s=0.0), speed=10.0, time_limit=40)
    late = run["time"] > 20
    assert run["pedal"][late].std() > 0.5
    assert run["speed"][late].mean() < 9.0


@pytest.mark.parametrize(("pid", "lag"), [(PaperPidSpec(), 0.3), (PaperPidSpec(time_base="steps"), 0.0)])
def test_paper_pid_is_steady_with_a_power_train_lag_or_without_a_time_step(pid: PaperPidSpec, lag: float) -> None:
    run = drive(straight_path(2000), paper_control(pid), PlantSpec(powertrain_lag_s=lag), speed=10.0, time_limit=40)
    late = run["time"] > 20
    assert run["pedal"][late].std() < 1e-3
    # Ten steps of integral leak: the pedal that holds 10 m/s against drag needs an error that lasts.
    drag = 0.01 * 9.80665 + 0.5 * 1.225 * 0.66 * 10**2 / 1573
    gain = 0.5 + 0.018 * 10 * (0.05 if pid.time_base == "seconds" else 1.0)
    assert 10 - run["speed"][-1] == pytest.approx(drag / 3.5 / gain, rel=0.02)


@given(speed=st.floats(0, 30), reference=st.floats(0, 30), ceiling=st.floats(-8, 3), integral=st.floats(-1, 1))
def test_tuned_pid_stays_within_comfort_and_below_its_ceiling(
    speed: float, reference: float, ceiling: float, integral: float
) -> None:
    spec, memory = TunedPidSpec(), TunedPidMemory(integral=integral, speed=speed)
    demand, _ = tuned_pid(memory, speed=speed, reference=Pace(reference, 0.0), dt=0.05, ceiling=ceiling, spec=spec)
    assert min(-spec.max_deceleration_mps2, ceiling) <= demand <= min(spec.max_acceleration_mps2, ceiling)


def test_tuned_pid_does_not_wind_up_while_it_waits_behind_a_ceiling() -> None:
    memory = TunedPidMemory()
    for _ in range(2000):
        _, memory = tuned_pid(memory, speed=0.0, reference=Pace(20.0, 0.0), dt=0.05, ceiling=-0.5, spec=TunedPidSpec())
    assert memory.integral == 0.0


def test_tuned_pid_gives_no_kick_when_the_reference_steps() -> None:
    spec, memory = TunedPidSpec(), TunedPidMemory()
    for reference in (10.0, 10.0, 10.5):
        demand, memory = tuned_pid(memory, speed=10.0, reference=Pace(reference, 0.0), dt=0.05, ceiling=9.0, spec=spec)
    assert demand == pytest.approx(spec.kp_1ps * 0.5 + spec.ki_1ps2 * 0.5 * 0.05)


@pytest.mark.parametrize("speed", [10.0, 24.0])
@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_tuned_pid_reaches_its_speed_from_rest_without_overshoot_and_without_a_lasting_error(
    speed: float, delay: float
) -> None:
    control = ControlSection(target_speed_mps=speed)
    run = drive(straight_path(5000), control, PlantSpec(command_delay_s=delay), speed=0.0, time_limit=60)
    assert run["speed"].max() < speed + 0.1
    assert run["speed"][-1] == pytest.approx(speed, abs=0.01)
    assert np.abs(np.diff(run["pedal"][run["time"] > 30])).max() < 1e-3


def paper_control(pid: PaperPidSpec | None = None) -> ControlSection:
    return ControlSection(lateral="paper", longitudinal="paper", pid=pid or PaperPidSpec())
