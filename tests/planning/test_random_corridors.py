"""Plans through random corridors, checked by shapely: any bend, angle and cell size; tapers, bait, obstacles, doubt."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from planning.grids import Alignment, Pose
from shapely import STRtree

from wzsumo.frames import FloatArray, wrap_angle
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.plan import plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.vehicle import VehicleGeometry

CAR, SPEC = VehicleGeometry(), PlannerSpec()
LENGTH_M, MARGIN_M = 140.0, 14.0
FREEWAY_CURVATURE_1PM, JUMP_1PM = 0.02, 0.002


@st.composite
def corridors(draw: st.DrawFn) -> tuple[OccupancyGrid, Pose, Pose, bool]:
    """(Grid, start, goal, whether half a metre can be kept): a corridor with a taper, perhaps a lane beside it as bait."""
    resolution = draw(st.sampled_from([0.125, 0.2, 0.25, 0.4]))
    road = Alignment(angle=draw(st.floats(-np.pi, np.pi)), radius_m=draw(st.sampled_from([None, 300.0, 1000.0])))
    width, shift, ratio = draw(st.floats(2.6, 12.0)), draw(st.floats(-3.5, 3.5)), draw(st.sampled_from([15, 30, 60]))
    middle = MARGIN_M
    taper = ((0.0, 30.0, 30.0 + min(abs(shift) * ratio, 80.0), LENGTH_M), (0.0, 0.0, shift, shift))
    edge = [road.pose(s, d)[:2] for s in np.arange(0, LENGTH_M + 1, 5) for d in (0.0, 2 * MARGIN_M)]
    low = np.floor(np.min(edge, axis=0))
    cols, rows = np.ceil((np.max(edge, axis=0) - low) / resolution).astype(int)
    x, y = low[0] + (np.arange(cols) + 0.5) * resolution, low[1] + (np.arange(rows) + 0.5) * resolution
    s, d = road.to_sd(x[None, :], y[:, None])
    off = d - middle - np.interp(s, *taper)
    free = (np.abs(off) <= width / 2) & (s >= 0) & (s <= LENGTH_M)
    if draw(st.booleans()):
        free |= (off > width / 2 + 0.5) & (off < width / 2 + 4.0) & (s > 0) & (s < 100.0)  # ends at nothing
        free |= (off > 0) & (off < width / 2 + 4.0) & (s > 50.0) & (s < 62.0)  # the hole that leads into it
    p = np.where(free, 0.0, 1.0)
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    doubt, n_cones = draw(st.sampled_from([0.0, 0.18])), draw(st.sampled_from([0, 0, 4, 12]))
    p = np.where(free, doubt * random.random(p.shape), p)
    for station, across in random.uniform((25.0, -0.5), (LENGTH_M - 25.0, 0.5), (n_cones, 2)):
        cone = road.pose(station, middle + np.interp(station, *taper) + across * width)
        p[(x[None, :] - cone[0]) ** 2 + (y[:, None] - cone[1]) ** 2 <= 0.3**2] = 1.0
    grid = OccupancyGrid(p_occupied=p.astype(np.float32), resolution=resolution, origin=(float(low[0]), float(low[1])))
    roomy = n_cones == 0 and (width - CAR.width_m) / 2 - 0.75 * resolution > 0.75
    return grid, road.pose(6.0, middle), road.pose(LENGTH_M - 6.0, middle + shift), roomy


def clearances(poses: FloatArray, grid: OccupancyGrid) -> FloatArray:
    """Distances (n,) [m] by shapely of the outlines from the blocked cells; 0 on contact."""
    row, col = np.nonzero(grid.p_occupied >= SPEC.max_p_occupied)
    low = np.array(grid.origin) + grid.resolution * np.column_stack([col, row])
    tree = STRtree(shapely.box(*low.T, *(low + grid.resolution).T))
    outlines = shapely.polygons([CAR.outline(pose) for pose in poses])
    return np.asarray(tree.query_nearest(outlines, return_distance=True, all_matches=False)[1])


@settings(max_examples=40)
@given(corridors())
def test_path_through_a_random_corridor_keeps_every_promise(corridor: tuple[OccupancyGrid, Pose, Pose, bool]) -> None:
    grid, start, goal, roomy = corridor
    plan = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=SPEC)
    if plan.path is None:
        assert plan.reason
        assert not roomy
        return
    poses, curvature = plan.path.poses, plan.path.curvature
    nearest = clearances(poses, grid).min()
    assert nearest > 0
    assert nearest >= 0.5 or not roomy
    assert plan.min_clearance_m <= nearest + 1e-9
    missed = poses[[0, -1]] - [start, goal]
    assert np.abs(missed[:, :2]).max() <= 1e-6
    assert np.abs(wrap_angle(missed[:, 2])).max() <= 1e-6
    assert np.diff(plan.path.arc_length).max() <= 0.5
    assert np.abs(curvature).max() <= SPEC.max_curvature(CAR, speed_mps=plan.speed_mps) + 1e-9
    if plan.speed_mps == SPEC.planned_speed_mps:
        assert np.abs(curvature).max() <= FREEWAY_CURVATURE_1PM
    if roomy:
        assert np.abs(np.diff(curvature)).max() <= JUMP_1PM
        assert np.abs(wrap_angle(np.diff(poses[:, 2]))).max() <= FREEWAY_CURVATURE_1PM * 0.5
