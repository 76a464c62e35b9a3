"""Angles, poses and the points of a vehicle. The world frame is SUMO's net frame: metres, x east, y north.

Headings are radians counter-clockwise from +x. A pose is (x, y, heading); arrays of poses are (n, 3). SUMO gives the centre of
the FRONT BUMPER and degrees clockwise from north: both are converted here, for `simulation/` alone.
"""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]


def wrap_angle(angle: npt.ArrayLike) -> FloatArray:
    """Angles [rad] in (-pi, pi], same shape.

    >>> float(wrap_angle(3 * np.pi))
    3.141592653589793
    """
    turns = np.asarray(angle, dtype=float)
    return np.asarray(np.pi - np.mod(np.pi - turns, 2 * np.pi))


def heading_from_sumo_angle(angle_deg: npt.ArrayLike) -> FloatArray:
    """Headings [rad, counter-clockwise from +x, in (-pi, pi]] of SUMO angles [degrees clockwise from north].

    Source: SUMO docs, FCDOutput, "angle".
    """
    return wrap_angle(np.deg2rad(90.0 - np.asarray(angle_deg, dtype=float)))


def sumo_angle_from_heading(heading: npt.ArrayLike) -> FloatArray:
    """SUMO angles [degrees clockwise from north, in [0, 360)] of headings [rad]."""
    return np.asarray(np.mod(90.0 - np.rad2deg(np.asarray(heading, dtype=float)), 360.0))


def pose_of_degrees(pose: npt.ArrayLike) -> tuple[float, float, float]:
    """The pose (x, y, heading [rad]) of one whose heading is in degrees counter-clockwise from +x, as people give them.

    >>> pose_of_degrees((10, 0, 180))
    (10.0, 0.0, 3.141592653589793)
    """
    x, y, heading_deg = np.asarray(pose, dtype=float)
    return float(x), float(y), float(np.deg2rad(heading_deg))


def advance(poses: npt.ArrayLike, distance: npt.ArrayLike) -> FloatArray:
    """Poses (..., 3) moved by `distance` [m] along their own heading: front bumper <-> centre <-> rear axle.

    >>> advance([0.0, 0.0, 0.0], 1.93).tolist()
    [1.93, 0.0, 0.0]
    """
    moved = np.array(poses, dtype=float)
    heading = moved[..., 2]
    moved[..., 0] += distance * np.cos(heading)
    moved[..., 1] += distance * np.sin(heading)
    return moved


def arc_length(points: npt.ArrayLike) -> FloatArray:
    """Distances (n,) [m] along a polyline (n, 2) from its first point."""
    steps = np.diff(np.asarray(points, dtype=float), axis=0)
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
