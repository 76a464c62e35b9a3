"""The car that obeys the controller: (EgoState, Command) -> EgoState.

Between command and wheels lie a pure delay, the lag and the rate limit of the steering and the lag of the power train; the
body is a kinematic bicycle or a dynamic single track.
"""

from dataclasses import dataclass
from math import ceil, exp, inf, radians
from typing import Literal, Self

from pydantic import Field

from wzsumo.control.bicycle import GRAVITY_MPS2, Motion, SingleTrackSpec, kinematic_step, single_track_step
from wzsumo.control.pedals import PedalSpec, acceleration_from_pedals
from wzsumo.ego import Command, EgoState
from wzsumo.errors import InputError
from wzsumo.spec import Spec
from wzsumo.vehicle import VehicleGeometry

AIR_DENSITY_KGPM3 = 1.225  # ISO 2533, sea level
SUBSTEP_S = 0.01  # longest step of integration; the delay is met to this


class PlantSpec(Spec):
    """Body, actuators and resistance of the car.

    The paper names no delay, lag or limit between its commands and the wheels: none is the default. They decide whether its
    law is stable: with the 0.4 rad/s of CommonRoad's passenger cars (Althoff et al. 2017) a car that starts 0.2 m beside the
    path at 10 m/s swings out to 10 m and more, and so does a car with 0.1 s of delay and 0.2 s of lag that starts on the path.
    """

    body: Literal["kinematic", "single_track"] = "kinematic"  # without or with tyre slip
    command_delay_s: float = Field(default=0.0, ge=0, le=2)  # from the command to steering and pedals alike
    steering_lag_s: float = Field(default=0.0, ge=0)  # first-order
    max_steering_rate_radps: float | None = Field(default=None, gt=0)  # of the front wheel; None: turns at once
    powertrain_lag_s: float = Field(default=0.3, ge=0)  # first-order; a combustion engine's torque, Rajamani 2012, Section 5.3
    mass_kg: float = Field(default=1573.0, gt=0)  # Rajamani 2012, passenger sedan
    drag_area_m2: float = Field(default=0.66, ge=0)  # c_d 0.3 times a front of 2.2 m2
    rolling_resistance: float = Field(default=0.01, ge=0)  # share of the weight, radial tyre on asphalt
    pedals: PedalSpec = PedalSpec()
    single_track: SingleTrackSpec = SingleTrackSpec()


@dataclass(frozen=True, kw_only=True)
class PlantState(EgoState):
    """EgoState and what else the car keeps from step to step. Reference point: centre of the REAR AXLE."""

    lateral_speed: float = 0.0  # m/s, of the rear axle, positive to the left
    yaw_rate: float = 0.0  # rad/s
    drive: float = 0.0  # m/s2, what power train and brakes give, drag not taken off
    pending: tuple[tuple[float, Command], ...] = ()  # commands with their age [s], oldest first; the first may already act

    @classmethod
    def of(cls, state: EgoState, *, spec: PlantSpec) -> Self:
        """The plant at a plain state: no slip, the drive that holds its acceleration, no pending command."""
        return cls(**vars(state), drive=state.acceleration + drag_mps2(state.speed, spec=spec))


def advance_ego(state: EgoState, command: Command, *, dt: float, vehicle: VehicleGeometry, spec: PlantSpec) -> PlantState:
    """State after `dt` seconds of `command`. Pass it on to the next call: a plain EgoState starts without slip or delay.

    Until a first command has come through the delay, steering and drive stay as they are. Braking ends at standstill: the
    car does not roll back. Raises InputError for dt <= 0.
    """
    if not 0 < dt < inf:
        raise InputError(f"dt={dt} s must be the length of the control step, above 0")
    before = state if isinstance(state, PlantState) else PlantState.of(state, spec=spec)
    pending = (*before.pending, (0.0, command))
    motion = Motion(before.x, before.y, before.heading, before.lateral_speed, before.yaw_rate)
    speed, steering, drive, acceleration = before.speed, before.steering, before.drive, before.acceleration
    n_substeps = ceil(dt / SUBSTEP_S - 1e-9)
    h = dt / n_substeps
    for substep in range(n_substeps):
        in_force = _in_force(pending, elapsed=substep * h, delay=spec.command_delay_s)
        turned, pushed = steering, drive
        if in_force is not None:
            turned = _steered(steering, in_force.steering, h=h, vehicle=vehicle, spec=spec)
            target = acceleration_from_pedals(in_force.throttle, in_force.brake, spec=spec.pedals)
            pushed = drive + (target - drive) * _lag_share(h, spec.powertrain_lag_s)
        acceleration = _net_acceleration(speed, drive=pushed, h=h, spec=spec)
        reached = max(speed + acceleration * h, 0.0)  # rounding may overshoot standstill
        motion = _body_step(
            motion, speed=(speed + reached) / 2, steering=(steering + turned) / 2, h=h, vehicle=vehicle, spec=spec
        )
        speed, steering, drive = reached, turned, pushed
    return PlantState(
        **motion._asdict(), speed=speed, steering=steering, acceleration=acceleration, drive=drive,
        pending=_aged(pending, dt=dt, delay=spec.command_delay_s),
    )  # fmt: skip


def drag_mps2(speed: float, *, spec: PlantSpec) -> float:
    """Deceleration [m/s2] by rolling and air at `speed` [m/s]; none at standstill."""
    if speed <= 0:
        return 0.0
    return spec.rolling_resistance * GRAVITY_MPS2 + 0.5 * AIR_DENSITY_KGPM3 * spec.drag_area_m2 * speed**2 / spec.mass_kg


def slip_gradients(spec: PlantSpec) -> tuple[float, float]:
    """Understeer gradient and rear slip [rad per m/s2] of a plant: what `RegulatedSpec` asks for. Kinematic: none.

    In a steady bend each axle carries its share of m a_y: slip m a_y l_r / (L C_f) in front and m a_y l_f / (L C_r) behind;
    understeer is their difference. Source: Rajamani 2012, Section 3.3.
    """
    if spec.body == "kinematic":
        return 0.0, 0.0
    front_slip = spec.mass_kg * (1 - spec.single_track.front_share) / spec.single_track.front_stiffness_nprad
    rear_slip = spec.mass_kg * spec.single_track.front_share / spec.single_track.rear_stiffness_nprad
    return front_slip - rear_slip, rear_slip


def _body_step(motion: Motion, *, speed: float, steering: float, h: float, vehicle: VehicleGeometry, spec: PlantSpec) -> Motion:
    if spec.body == "kinematic":
        return kinematic_step(motion, speed=speed, steering=steering, h=h, wheelbase_m=vehicle.wheelbase_m)
    return single_track_step(
        motion, speed=speed, steering=steering, h=h,
        wheelbase_m=vehicle.wheelbase_m, mass_kg=spec.mass_kg, spec=spec.single_track,
    )  # fmt: skip


def _in_force(pending: tuple[tuple[float, Command], ...], *, elapsed: float, delay: float) -> Command | None:
    arrived = [command for age, command in pending if age + elapsed >= delay - 1e-9]
    return arrived[-1] if arrived else None


def _aged(pending: tuple[tuple[float, Command], ...], *, dt: float, delay: float) -> tuple[tuple[float, Command], ...]:
    aged = tuple((age + dt, command) for age, command in pending)
    n_arrived = sum(age >= delay - 1e-9 for age, _ in aged)
    return aged[max(n_arrived - 1, 0) :]


def _steered(steering: float, wanted: float, *, h: float, vehicle: VehicleGeometry, spec: PlantSpec) -> float:
    limit = radians(vehicle.max_steering_deg)
    change = (min(max(wanted, -limit), limit) - steering) * _lag_share(h, spec.steering_lag_s)
    most = inf if spec.max_steering_rate_radps is None else spec.max_steering_rate_radps * h
    return steering + min(max(change, -most), most)


def _lag_share(h: float, lag_s: float) -> float:
    """Share of the way to its target that a first-order lag goes in `h` seconds."""
    return 1 - exp(-h / lag_s) if lag_s > 0 else 1.0


def _net_acceleration(speed: float, *, drive: float, h: float, spec: PlantSpec) -> float:
    if speed == 0:
        return max(0.0, drive - spec.rolling_resistance * GRAVITY_MPS2)
    return max(drive - drag_mps2(speed, spec=spec), -speed / h)
