"""Clearance of a path from the devices and the road's edges, measured from the exact outline of the vehicle."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from wzsumo.frames import FloatArray, arc_length
from wzsumo.path import swept_pieces
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout


@dataclass(frozen=True, kw_only=True)
class Clearance:
    """Smallest distances [m] of the vehicle's outline along a path; 0 where it touches."""

    min_clearance_devices_m: float  # to the nearest device's outline
    min_clearance_road_edge_m: float  # to the nearer edge of the pavement, shoulders included; negative beyond it
    closed_area_share: float  # share of the path's length on which part of the outline is in the closed area


def clearance_along(poses: npt.ArrayLike, *, vehicle: VehicleGeometry, layout: WorkZoneLayout) -> Clearance:
    """Clearance of rear-axle poses (n, 3) to the devices, the pavement's edges and the closed area of `layout`."""
    path = np.asarray(poses, dtype=float)
    # The distance to the swept area is the distance to its nearest piece, so the pieces need not be united.
    pieces = shapely.STRtree(swept_pieces(path, vehicle))
    _, to_devices = pieces.query_nearest(layout.device_outlines, return_distance=True, all_matches=False)
    outlines = vehicle.outline(path)
    _, d = layout.road.to_sd(outlines.reshape(-1, 2))
    to_edges = np.minimum(d + layout.road.right_shoulder, layout.road.left_edge - d)
    return Clearance(
        min_clearance_devices_m=max(float(to_devices.min()), 0.0),
        min_clearance_road_edge_m=float(to_edges.min()),
        closed_area_share=_closed_area_share(path, outlines, layout),
    )


def _closed_area_share(path: FloatArray, outlines: FloatArray, layout: WorkZoneLayout) -> float:
    """Share of the path's length with an outline in the closed area; a step of which one end is inside counts half."""
    closed = layout.closed_area
    shapely.prepare(closed)
    inside = shapely.intersects(closed, shapely.polygons(outlines)).astype(float)
    steps = np.diff(arc_length(path[:, :2]))
    return float(np.sum((inside[1:] + inside[:-1]) / 2 * steps) / max(steps.sum(), 1e-9))
