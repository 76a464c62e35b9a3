"""Pure pursuit: the arc from the rear axle, tangent to the heading, through a point of the path ahead."""

from math import atan, atan2, hypot, sin

from pydantic import Field

from wzsumo.control.path_frame import PathFrame, PathPosition, Point
from wzsumo.ego import EgoState
from wzsumo.spec import Spec


def pursuit_steering(state: EgoState, target: Point, *, length_m: float) -> float:
    """Steering angle [rad] that takes the rear axle on an arc to `target`, atan(2 L sin(alpha) / l_d).

    `length_m` is L: the wheelbase, where the arc is meant to be met. Source: Chen et al. 2022, Equation 3, after Coulter 1992.

    >>> round(pursuit_steering(EgoState(x=0, y=0, heading=0, speed=10), (3.0, 3.0), length_m=3.0), 6)
    0.785398
    """
    dx, dy = target[0] - state.x, target[1] - state.y
    distance = hypot(dx, dy)
    alpha = atan2(dy, dx) - state.heading
    return atan(2 * length_m * sin(alpha) / distance)


def paper_target(frame: PathFrame, position: PathPosition, *, state: EgoState, min_lookahead_m: float) -> Point:
    """First point of the path, from the vehicle on, that is `min_lookahead_m` or more away. Source: Chen et al. 2022."""
    return frame.first_point_beyond(min_lookahead_m, x=state.x, y=state.y, segment=position.segment)


class RegulatedSpec(Spec):
    """Pure pursuit with a look-ahead that grows with speed, and a speed that falls with curvature."""

    lookahead_time_s: float = Field(default=0.8, gt=0)
    min_lookahead_m: float = Field(default=3.0, gt=0)  # Chen et al. 2022
    max_lookahead_m: float = Field(default=30.0, gt=0)


def lookahead_m(speed: float, *, spec: RegulatedSpec) -> float:
    """Look-ahead [m] along the path at a speed [m/s]."""
    return min(max(spec.lookahead_time_s * speed, spec.min_lookahead_m), spec.max_lookahead_m)
