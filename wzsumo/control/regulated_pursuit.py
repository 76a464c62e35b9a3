"""Pure pursuit for speed: look-ahead that grows with it, target between the poses, true wheelbase, lag and slip allowed for."""

from dataclasses import replace
from math import cos, sin, tan

from pydantic import Field

from wzsumo.control.path_frame import PathFrame, PathPosition
from wzsumo.control.pure_pursuit import pursuit_steering
from wzsumo.ego import EgoState
from wzsumo.spec import Spec


class RegulatedSpec(Spec):
    """Regulated pure pursuit, after Macenski et al. 2023. Defaults: analysis/benchmarks/control.py measures them.

    The two slips are the car's answer to lateral acceleration, and `controller.allow_for_slip` takes them from a plant; 0 is a
    car whose tyres do not slip.
    """

    lookahead_time_s: float = Field(default=0.6, gt=0)  # of 0.4 to 1.2 s: least error that still takes noise of position
    min_lookahead_m: float = Field(default=3.0, gt=0)  # Chen et al. 2022
    max_lookahead_m: float = Field(default=30.0, gt=0)  # sight of a planned path; binds from 50 m/s
    prediction_s: float = Field(default=0.2, ge=0)  # pursue from where the car will be: about its delay and lag
    understeer_rad_per_mps2: float = Field(default=0.0, ge=0)  # steering beyond the Ackermann angle
    rear_slip_rad_per_mps2: float = Field(default=0.0, ge=0)  # heading inside the course, at the rear axle
    max_lateral_mps2: float = Field(default=2.0, gt=0)  # v^2 curvature, the planner's own limit
    slowdown_mps2: float = Field(default=1.0, gt=0)  # towards a lower speed ahead; half of the b = 2 m/s2 of car following
    # Out of a bend. From one to the other within a second is below the jerk of 2.5 m/s3 of ISO 15622.
    speedup_mps2: float = Field(default=0.75, gt=0)
    speed_preview_s: float = Field(default=0.5, ge=0)  # the limit is read so far ahead, for the lag of the power train
    stop_at_goal: bool = False  # the paper drives through its goal at v = 10 m/s


def lookahead_m(speed: float, *, spec: RegulatedSpec) -> float:
    """Look-ahead [m] along the path at a speed [m/s]."""
    return min(max(spec.lookahead_time_s * speed, spec.min_lookahead_m), spec.max_lookahead_m)


def regulated_steering(
    frame: PathFrame, position: PathPosition, *, state: EgoState, wheelbase_m: float, spec: RegulatedSpec
) -> float:
    """Steering angle [rad] for the arc from the predicted pose to the path point one look-ahead further along.

    Pursuit takes the heading for the course. In a bend of curvature k the rear axle slips: the course lies rear_slip v^2 k
    outside the heading, and the arc needs understeer v^2 k more steering; both are added for the path beside the vehicle.
    """
    predicted = predicted_state(state, wheelbase_m=wheelbase_m, spec=spec)
    beside = frame.locate(predicted.x, predicted.y, near=position.segment)
    target = frame.point_at(beside.station_m + lookahead_m(state.speed, spec=spec))
    lateral = state.speed**2 * frame.curvature_at(beside.station_m)
    course = replace(predicted, heading=predicted.heading - spec.rear_slip_rad_per_mps2 * lateral)
    return pursuit_steering(course, target, length_m=wheelbase_m) + spec.understeer_rad_per_mps2 * lateral


def predicted_state(state: EgoState, *, wheelbase_m: float, spec: RegulatedSpec) -> EgoState:
    """State after the prediction time with the steering and the speed of now. Reference point: centre of the REAR AXLE."""
    curvature = tan(state.steering) / (wheelbase_m + spec.understeer_rad_per_mps2 * state.speed**2)
    distance = state.speed * spec.prediction_s
    turn = distance * curvature
    course = state.heading + turn / 2 - spec.rear_slip_rad_per_mps2 * state.speed**2 * curvature
    return replace(state, x=state.x + distance * cos(course), y=state.y + distance * sin(course), heading=state.heading + turn)
