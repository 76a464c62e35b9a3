"""The ego's outlook along the paper's road, straight along +x, and another vehicle on it."""

import numpy as np
from builders import paper_layout

from wzsumo.behaviour.ego_outlook import EgoOutlook, path_on_road
from wzsumo.ego import EgoState
from wzsumo.path import ReferencePath
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()  # 4.64 m x 1.86 m, centre 1.4 m and bumper 3.72 m before the rear axle
LAYOUT = paper_layout()  # its left lane ends
LANE = 12 * 0.3048
RIGHT, MIDDLE, LEFT = 0.5 * LANE, 1.5 * LANE, 2.5 * LANE
NOBODY = Traffic(
    ids=(), poses=np.empty((0, 3)), speeds=np.empty(0), accelerations=np.empty(0), lengths=np.empty(0), widths=np.empty(0)
)


def vehicle_at(
    x: float,
    y: float,
    *,
    speed: float,
    heading: float = 0.0,
    acceleration: float = 0.0,
    length: float = 4.8,
) -> Traffic:
    """One vehicle, 1.85 m wide, with its centre at (x, y)."""
    return Traffic(
        ids=("other",), poses=np.array([[x, y, heading]]), speeds=np.array([speed]), accelerations=np.array([acceleration]),
        lengths=np.array([length]), widths=np.array([1.85]),
    )  # fmt: skip


def one_vehicle(
    ahead_m: float, y: float, *, speed: float, heading: float = 0.0, acceleration: float = 0.0, length: float = 4.8
) -> Traffic:
    """One vehicle, 4.8 m x 1.85 m, with its centre so far ahead of the ego's, which is at x = 51.4 m."""
    x = 50 + CAR.axle_to_centre_m + ahead_m
    return vehicle_at(x, y, speed=speed, heading=heading, acceleration=acceleration, length=length)


def together(*vehicles: Traffic) -> Traffic:
    """The vehicles of several moments as those of one."""
    return Traffic(
        ids=tuple(f"{i}" for i, traffic in enumerate(vehicles) for _ in traffic.ids),
        poses=np.concatenate([traffic.poses for traffic in vehicles]),
        speeds=np.concatenate([traffic.speeds for traffic in vehicles]),
        accelerations=np.concatenate([traffic.accelerations for traffic in vehicles]),
        lengths=np.concatenate([traffic.lengths for traffic in vehicles]),
        widths=np.concatenate([traffic.widths for traffic in vehicles]),
    )


def outlook(
    y: float = RIGHT,
    *,
    slope: float = 0.0,
    speed: float = 10.0,
    desired_speed: float = 10.0,
    x: float = 50.0,
    length_m: int = 200,
) -> EgoOutlook:
    """The ego at the start of a path from (x, y), a pose a metre, that drifts to the left by `slope`."""
    s = np.arange(0.0, length_m)
    path = ReferencePath(poses=np.column_stack([x + s, y + slope * s, np.full_like(s, np.arctan(slope))]))
    return EgoOutlook(
        path=path_on_road(path, layout=LAYOUT, vehicle=CAR), station=0.0, vehicle=CAR,
        state=EgoState(x=x, y=y, heading=float(np.arctan(slope)), speed=speed),
        desired_speeds=np.full_like(s, desired_speed),
    )  # fmt: skip
