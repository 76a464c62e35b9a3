"""Terrain of 100 m x 40 m in cells of 0.25 m, and a lane change on it, for tests of smoothing."""

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.terrain import Terrain, terrain_of
from wzsumo.vehicle import VehicleGeometry

BODY = outline_body(VehicleGeometry())
LANE_CHANGE = np.array([(20.0, 0.0), (15.0, 0.017), (15.0, -0.017), (20.0, 0.0)])


def terrain(p_occupied: FloatArray | None = None) -> Terrain:
    """Terrain of a map with these p(occupied), free everywhere where none are given."""
    p = np.zeros((160, 400)) if p_occupied is None else p_occupied
    grid = OccupancyGrid(p_occupied=p.astype(np.float32), resolution=0.25, origin=(0.0, 0.0))
    return terrain_of(grid, body=BODY, spec=PlannerSpec(), reach_m=3.0)
