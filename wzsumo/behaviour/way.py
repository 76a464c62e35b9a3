"""The ego's way: the path that it follows on the road, where it is on it and how it would go on."""

from dataclasses import dataclass

import numpy as np

from wzsumo.ego import EgoState
from wzsumo.frames import FloatArray, advance, wrap_angle
from wzsumo.path import ReferencePath
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout


@dataclass(frozen=True, kw_only=True, eq=False)
class Route:
    """A path with what is asked of it at each step, one row a pose; made by `route_along`."""

    poses: FloatArray  # (n, 3) of the REAR AXLE
    stations: FloatArray  # (n,) m along the path
    on_road: FloatArray  # (n, 3) station [m], lateral offset [m] and heading [rad] on the road, of the vehicle's CENTRE


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """The ego on its route: where it is and how it would go on if nobody hindered it."""

    route: Route
    station: float  # m, of the rear axle along the path
    state: EgoState
    vehicle: VehicleGeometry
    desired_speeds: FloatArray  # (n,) m/s at the route's poses, slower before and in bends
    acceleration: float  # m/s2, with which it takes up speed


def route_along(path: ReferencePath, *, layout: WorkZoneLayout, vehicle: VehicleGeometry) -> Route:
    """The route of a path on the road of `layout`."""
    centres = advance(path.poses, vehicle.axle_to_centre_m)
    station, offset = layout.road.to_sd(centres[:, :2])
    turned = wrap_angle(centres[:, 2] - layout.road.heading_at(station))
    return Route(poses=path.poses, stations=path.arc_length, on_road=np.column_stack([station, offset, turned]))


def half_extents(turned: FloatArray, length: FloatArray | float, width: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Half of what bodies take up along and across a line from which they are turned [rad]: who stands askew takes more."""
    cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    return np.asarray(length * cos + width * sin) / 2, np.asarray(width * cos + length * sin) / 2
