"""The ego on its way along the paper's road, and another vehicle beside it."""

import numpy as np
from builders import paper_layout

from wzsumo.behaviour.way import Way, route_along
from wzsumo.ego import EgoState
from wzsumo.path import ReferencePath
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
LAYOUT = paper_layout()  # its left lane ends
LANE = 12 * 0.3048
RIGHT, MIDDLE = 0.5 * LANE, 1.5 * LANE


def one_vehicle(ahead_m, y, *, speed, heading=0.0, acceleration=0.0):
    """A car whose centre is so far ahead of the ego's, which is at x = 51.4 m."""
    return Traffic(
        ids=("other",),
        poses=np.array([[50 + CAR.axle_to_centre_m + ahead_m, y, heading]]),
        speeds=np.array([speed]),
        accelerations=np.array([acceleration]),
        lengths=np.array([4.8]),
        widths=np.array([1.85]),
    )


def way(y=RIGHT, *, slope=0.0, speed=10.0, desired_speed=10.0, x=50.0):
    """The ego at the start of a path from (x, y) that drifts to the left by `slope`."""
    s = np.arange(0.0, 200.0)
    path = ReferencePath(poses=np.column_stack([x + s, y + slope * s, np.full_like(s, np.arctan(slope))]))
    return Way(
        route=route_along(path, layout=LAYOUT, vehicle=CAR), station=0.0, vehicle=CAR,
        state=EgoState(x=x, y=y, heading=float(np.arctan(slope)), speed=speed),
        desired_speeds=np.full_like(s, desired_speed), acceleration=1.4,
    )  # fmt: skip
