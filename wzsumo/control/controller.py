"""Controller: (EgoState, ReferencePath) -> Command, once a control step."""

from math import inf, radians
from typing import Literal, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import Field

from wzsumo.control.path_frame import PathFrame, PathPosition
from wzsumo.control.pedals import PedalSpec, pedal_from_acceleration
from wzsumo.control.pid import PaperPidMemory, PaperPidSpec, TunedPidMemory, TunedPidSpec, paper_pid, tuned_pid
from wzsumo.control.plant import PlantSpec, slip_gradients
from wzsumo.control.pure_pursuit import paper_steering
from wzsumo.control.regulated_pursuit import RegulatedSpec, regulated_steering
from wzsumo.control.speed_profile import Pace, SpeedProfile
from wzsumo.ego import Command, EgoState
from wzsumo.errors import InputError
from wzsumo.frames import FloatArray
from wzsumo.path import ReferencePath
from wzsumo.spec import Spec, parse_spec
from wzsumo.vehicle import VehicleGeometry


class ControlSpec(Spec):
    """How the ego follows its path and keeps its speed."""

    lateral: Literal["paper", "regulated"] = "regulated"  # steering: the pure pursuit of Chen et al. 2022, or the regulated one
    longitudinal: Literal["paper", "tuned"] = "tuned"  # speed: the PID of Chen et al. 2022, or the tuned one
    # In a scenario that gives none: the posted speed. 10 m/s: Chen et al. 2022.
    target_speed_mps: float = Field(default=10.0, ge=0, le=60)
    min_lookahead_m: float = Field(default=3.0, gt=0)  # ibid.; the law "paper"
    pursuit_length_m: float = Field(default=4.6391, gt=0)  # ibid.: the LENGTH, used as wheelbase; the law "paper"
    goal_tolerance_m: float = Field(default=0.1, ge=0)  # the path's end counts as reached this far before it; chosen by us
    regulated: RegulatedSpec = RegulatedSpec()
    pid: PaperPidSpec = PaperPidSpec()
    tuned: TunedPidSpec = TunedPidSpec()
    pedals: PedalSpec = PedalSpec()


SomeControlSpec = TypeVar("SomeControlSpec", bound=ControlSpec)


def allow_for_slip(spec: SomeControlSpec, *, plant: PlantSpec) -> SomeControlSpec:
    """The same spec with a regulated law that allows for the tyre slip of `plant`. Raises SpecError if that oversteers."""
    understeer, rear_slip = slip_gradients(plant)
    slips = {"understeer_rad_per_mps2": understeer, "rear_slip_rad_per_mps2": rear_slip}
    regulated = parse_spec(RegulatedSpec, spec.regulated.model_dump() | slips, source="slip of the plant")
    return spec.model_copy(update={"regulated": regulated})


class Controller:
    """Follows one path; remembers its position on the path and the memory of its PID.

    `cross_track_m` (positive: ego left of the path), `station_m` and `reached_end` belong to the state that the last `command`
    was given; before the first one they are 0, 0 and False. The law "regulated" keeps below the speed that the path's curvature
    allows; the law "paper" has one speed.
    """

    def __init__(self, path: ReferencePath, vehicle: VehicleGeometry, spec: ControlSpec) -> None:
        self._vehicle, self._spec = vehicle, spec
        self._paper_pid, self._tuned_pid = PaperPidMemory(), TunedPidMemory()
        self.follow(path)

    def follow(self, path: ReferencePath) -> None:
        """Go on along another path, as after a new plan; the memory of the PID stays."""
        self._frame = PathFrame.of(path)
        self._profile = SpeedProfile.of(path, spec=self._spec.regulated)
        self._position: PathPosition | None = None

    def speeds_at(self, stations: npt.ArrayLike) -> FloatArray:
        """Speeds (n,) [m/s] that it keeps at stations (n,) [m] along the path if nothing hinders the ego."""
        target = np.full(np.shape(stations), self._spec.target_speed_mps)
        return target if self._spec.lateral == "paper" else np.minimum(target, self._profile.speeds_at(stations))

    @property
    def cross_track_m(self) -> float:
        """Distance of the rear axle from the path, positive to the left."""
        return self._position.cross_track_m if self._position else 0.0

    @property
    def station_m(self) -> float:
        """Distance along the path of the point beside the rear axle."""
        return self._position.station_m if self._position else 0.0

    @property
    def reached_end(self) -> bool:
        """Whether the rear axle is at the end of the path or past it."""
        return self._position is not None and self.station_m >= self._frame.length_m - self._spec.goal_tolerance_m

    def command(self, state: EgoState, *, dt: float, ceiling: float = inf) -> Command:
        """Command for the next `dt` seconds; moves position and memory on by one step. Raises InputError for dt <= 0.

        `ceiling` [m/s2] is the highest acceleration that is left to the ego.
        """
        if not 0 < dt < inf:
            raise InputError(f"dt={dt} s must be the time from one command to the next, above 0")
        near = self._position.segment if self._position else None
        self._position = self._frame.locate(state.x, state.y, near=near)
        reference = self._reference(state.speed, station_m=self._position.station_m)
        pedal = self._pedal(state.speed, reference=reference, dt=dt, ceiling=ceiling)
        return Command(throttle=max(pedal, 0.0), brake=max(-pedal, 0.0), steering=self._steering(state, self._position))

    def _reference(self, speed: float, *, station_m: float) -> Pace:
        spec = self._spec
        cruise = Pace(speed=spec.target_speed_mps, acceleration=0.0)
        if spec.lateral == "paper":
            return cruise
        ahead = station_m + speed * spec.regulated.speed_preview_s
        return min(cruise, self._profile.at(station_m), self._profile.at(ahead))  # by speed, their first field

    def _pedal(self, speed: float, *, reference: Pace, dt: float, ceiling: float) -> float:
        spec = self._spec
        if spec.longitudinal == "paper":
            pedal, self._paper_pid = paper_pid(self._paper_pid, reference.speed - speed, dt=dt, spec=spec.pid)
            return min(pedal, pedal_from_acceleration(ceiling, spec=spec.pedals))
        demand, self._tuned_pid = tuned_pid(
            self._tuned_pid, speed=speed, reference=reference, dt=dt, ceiling=ceiling, spec=spec.tuned
        )
        return pedal_from_acceleration(demand, spec=spec.pedals)

    def _steering(self, state: EgoState, position: PathPosition) -> float:
        spec = self._spec
        if spec.lateral == "paper":
            wanted = paper_steering(
                self._frame, position, state=state,
                min_lookahead_m=spec.min_lookahead_m, pursuit_length_m=spec.pursuit_length_m,
            )  # fmt: skip
        else:
            wanted = regulated_steering(
                self._frame, position, state=state, wheelbase_m=self._vehicle.wheelbase_m, spec=spec.regulated
            )
        limit = radians(self._vehicle.max_steering_deg)
        return min(max(wanted, -limit), limit)
