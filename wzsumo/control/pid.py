"""Speed controllers: the PID of the paper, and a tuned one.

Memory goes in and comes out as a frozen value, so that a step is a function of what it is given.
"""

from dataclasses import dataclass
from math import exp
from typing import Literal

from pydantic import Field

from wzsumo.control.speed_profile import Pace
from wzsumo.spec import Spec


class PaperPidSpec(Spec):
    """PID of Chen et al. 2022: proportion, derivative and integral of the speed error over the ten most recent steps.

    The paper names neither the unit of the error nor what a derivative is divided by. Both decide the loop: CARLA's example
    controller, which has the same window of ten, takes km/h (3.6 times the gain) and divides by the time step. With
    `time_base` "seconds" and a throttle that acts at once, the derivative term is an algebraic loop of gain
    kd * full throttle [m/s2]: 0.4 * 3.5 = 1.4 > 1, and the pedals chatter between their stops. A power-train lag removes it.
    """

    kp: float = Field(default=0.5, ge=0)  # Chen et al. 2022
    ki: float = Field(default=0.018, ge=0)  # ibid.
    kd: float = Field(default=0.4, ge=0)  # ibid.
    window_steps: int = Field(default=10, ge=2)  # "the ten most recent timesteps", ibid.
    error_unit: Literal["m/s", "km/h"] = "m/s"  # not in the paper: SI, the unit of its v = 10 m/s
    time_base: Literal["seconds", "steps"] = "seconds"  # not in the paper: derivative per second, integral over seconds


class TunedPidSpec(Spec):
    """PID from speed error to acceleration, with limits of comfort, filtered derivative and no integral wind-up.

    The gains are the fastest of a grid that reach 24 m/s from rest with no overshoot, at 0.3 and 0.5 s of power-train lag and
    0.1 s of delay: analysis/benchmarks/control.py.
    """

    kp_1ps: float = Field(default=1.0, ge=0)  # of the speed error
    ki_1ps2: float = Field(default=0.1, ge=0)  # of its integral
    kd: float = Field(default=0.1, ge=0)  # m/s2 of demand per m/s2 measured
    derivative_filter_s: float = Field(default=0.3, gt=0)  # as slow as the power train, of which it cannot see more
    max_acceleration_mps2: float = Field(default=2.0, gt=0)  # ISO 15622, adaptive cruise control at 20 m/s and above
    max_deceleration_mps2: float = Field(default=3.5, gt=0)  # ibid.; car following may ask for more


@dataclass(frozen=True, kw_only=True)
class PaperPidMemory:
    """Errors of the most recent steps, oldest first, in the unit of the spec."""

    errors: tuple[float, ...] = ()


def paper_pid(memory: PaperPidMemory, error_mps: float, *, dt: float, spec: PaperPidSpec) -> tuple[float, PaperPidMemory]:
    """Pedal in [-1, 1], throttle positive, for a speed error [m/s] (reference - speed), and the memory for the next step."""
    error = error_mps * 3.6 if spec.error_unit == "km/h" else error_mps
    errors = (*memory.errors, error)[-spec.window_steps :]
    step = dt if spec.time_base == "seconds" else 1.0
    change = errors[-1] - errors[-2] if len(errors) > 1 else 0.0
    output = spec.kp * error + spec.ki * sum(errors) * step + spec.kd * change / step
    return min(max(output, -1.0), 1.0), PaperPidMemory(errors=errors)


@dataclass(frozen=True, kw_only=True)
class TunedPidMemory:
    """Integral [m/s2], filtered acceleration [m/s2] and the speed [m/s] of the step before (None at the first)."""

    integral: float = 0.0
    acceleration: float = 0.0
    speed: float | None = None


def tuned_pid(
    memory: TunedPidMemory, *, speed: float, reference: Pace, dt: float, ceiling: float, spec: TunedPidSpec
) -> tuple[float, TunedPidMemory]:
    """Demanded acceleration [m/s2] at a speed [m/s] and a reference, never above `ceiling`, and the next memory.

    The acceleration of the reference is fed forward: without it the integral fills while braking for a bend, and the car
    goes on braking in it. The derivative leaves out steps of the reference's speed, which would give a kick. The integral
    stands still while the output is at a limit and the error would drive it further (conditional integration, Astrom &
    Hagglund 1995).
    """
    error = reference.speed - speed
    measured = 0.0 if memory.speed is None else (speed - memory.speed) / dt
    acceleration = memory.acceleration + (1 - exp(-dt / spec.derivative_filter_s)) * (measured - memory.acceleration)
    integral = memory.integral + spec.ki_1ps2 * error * dt
    highest = min(spec.max_acceleration_mps2, ceiling)
    lowest = min(-spec.max_deceleration_mps2, ceiling)
    wanted = reference.acceleration + spec.kp_1ps * error + integral + spec.kd * (reference.acceleration - acceleration)
    demand = min(max(wanted, lowest), highest)
    if (wanted > highest and error > 0) or (wanted < lowest and error < 0):
        integral = memory.integral
    return demand, TunedPidMemory(integral=integral, acceleration=acceleration, speed=speed)
