"""Pure pursuit as in the paper: the arc from the rear axle, tangent to the heading, through a point of the path ahead."""

from math import atan, atan2, hypot, sin

from wzsumo.control.path_frame import PathFrame, PathPosition, Point
from wzsumo.ego import EgoState


def pursuit_steering(state: EgoState, target: Point, *, length_m: float) -> float:
    """Steering angle [rad] that takes the rear axle on an arc to `target`, atan(2 L sin(alpha) / l_d).

    `length_m` is L: the wheelbase, where the arc is meant to be met. Source: Chen et al. 2022, Equation 3, after Coulter 1992.

    >>> round(pursuit_steering(EgoState(x=0, y=0, heading=0, speed=10), (3.0, 3.0), length_m=3.0), 6)
    0.785398
    """
    dx, dy = target[0] - state.x, target[1] - state.y
    alpha = atan2(dy, dx) - state.heading
    return atan(2 * length_m * sin(alpha) / hypot(dx, dy))


def paper_steering(
    frame: PathFrame, position: PathPosition, *, state: EgoState, min_lookahead_m: float, pursuit_length_m: float
) -> float:
    """Steering angle [rad] to the first path point, from the vehicle on, that is `min_lookahead_m` or more away.

    l_d is the distance to that point, not the minimum: where the poses are far apart, so is the target. Source: Chen et al.
    2022.
    """
    target = frame.first_point_beyond(min_lookahead_m, x=state.x, y=state.y, segment=position.segment)
    return pursuit_steering(state, target, length_m=pursuit_length_m)
