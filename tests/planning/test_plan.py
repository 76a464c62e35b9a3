import numpy as np
import pytest
import shapely
from planning.grids import work_zone_grid

from wzsumo.path import swept_area
from wzsumo.planning.plan import PlannerSpec, PlanStatus, plan_path
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()


@pytest.mark.parametrize("kind", ["corridor", "cones"])
def test_plan_through_a_lane_closure_keeps_the_swept_outline_off_blocked_cells(kind):
    grid, start, goal = work_zone_grid(kind=kind)
    plan = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=PlannerSpec())
    assert plan.status == PlanStatus.FOUND
    row, col = np.nonzero(~grid.free)
    corner = grid.origin + grid.resolution * np.column_stack([col, row])
    cells = shapely.box(*corner.T, *(corner + grid.resolution).T)
    swept = swept_area(plan.path.poses, CAR)
    shapely.prepare(swept)
    assert not shapely.intersects(swept, cells).any()
