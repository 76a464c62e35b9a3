"""EgoOutlook: the ego on its path, and how it goes on along it if no vehicle hinders it."""

from dataclasses import dataclass

import numpy as np

from wzsumo.ego import EgoState
from wzsumo.frames import FloatArray, advance, wrap_angle
from wzsumo.path import ReferencePath
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout


@dataclass(frozen=True, kw_only=True, eq=False)
class PathOnRoad:
    """A path in the world and on the road, one row a pose; made by `path_on_road`."""

    poses: FloatArray  # (n, 3) of the REAR AXLE
    stations: FloatArray  # (n,) m along the path
    centres_on_road: FloatArray  # (n, 3) of the vehicle's CENTRE: station [m], lateral offset [m] and heading [rad] on the road


@dataclass(frozen=True, kw_only=True, eq=False)
class EgoOutlook:
    """Where the ego is on its path, and how it goes on if no vehicle hinders it."""

    path: PathOnRoad
    station: float  # m, of the rear axle along the path
    state: EgoState
    vehicle: VehicleGeometry
    desired_speeds: FloatArray  # (n,) m/s at the path's poses, lower before and in bends


def path_on_road(path: ReferencePath, *, layout: WorkZoneLayout, vehicle: VehicleGeometry) -> PathOnRoad:
    """The path with the vehicle's centres on the road of `layout`."""
    centres = advance(path.poses, vehicle.axle_to_centre_m)
    station, offset = layout.road.to_sd(centres[:, :2])
    turned = wrap_angle(centres[:, 2] - layout.road.heading_at(station))
    return PathOnRoad(poses=path.poses, stations=path.arc_length, centres_on_road=np.column_stack([station, offset, turned]))


def half_extents(turned: FloatArray, length: FloatArray | float, width: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Half of the lengths [m] that bodies turned from a line by `turned` [rad] take up along and across that line."""
    cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    return np.asarray(length * cos + width * sin) / 2, np.asarray(width * cos + length * sin) / 2
