import dataclasses

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from planning.grids import Alignment, Kind, Pose, work_zone_grid
from shapely import STRtree

from wzsumo.errors import MapError
from wzsumo.frames import FloatArray, wrap_angle
from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning import distance_field, hybrid_astar, path_check, planning_field, pushing, terrain
from wzsumo.planning.plan import Plan, PlanStatus, compile_kernels, plan_from, plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.planning_field import prepare_field
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
STRAIGHT: tuple[Pose, Pose] = (10.0, 20.0, 0.0), (140.0, 20.0, 0.0)


def pose_of(values: FloatArray) -> Pose:
    x, y, heading = values.tolist()
    return x, y, heading


def grid_of(p_occupied: npt.ArrayLike, resolution: float = 0.25, origin: tuple[float, float] = (0.0, 0.0)) -> OccupancyGrid:
    return OccupancyGrid(p_occupied=np.asarray(p_occupied, dtype=np.float32), resolution=resolution, origin=origin)


def corridor(width_m: float, length_m: float = 150.0, resolution: float = 0.25) -> OccupancyGrid:
    """A free strip about y = 20 m on a map 40 m wide."""
    y = (np.arange(int(40 / resolution)) + 0.5) * resolution
    return grid_of(np.tile((np.abs(y - 20) > width_m / 2)[:, None], (1, int(length_m / resolution))), resolution)


def clearances(path: ReferencePath, grid: OccupancyGrid) -> FloatArray:
    """Distances (n,) [m] by shapely of the outlines from the blocked cells; 0 on contact."""
    blocked = np.pad(~grid.free, 1, constant_values=False)
    shell = blocked & ~(np.roll(blocked, 1, 0) & np.roll(blocked, -1, 0) & np.roll(blocked, 1, 1) & np.roll(blocked, -1, 1))
    row, col = np.nonzero(shell[1:-1, 1:-1])
    low = np.array(grid.origin) + grid.resolution * np.column_stack([col, row])
    tree = STRtree(shapely.box(*low.T, *(low + grid.resolution).T))
    outlines = shapely.polygons([CAR.outline(pose) for pose in path.poses])
    return np.asarray(tree.query_nearest(outlines, return_distance=True, all_matches=False)[1])


def path_of(plan: Plan) -> ReferencePath:
    assert plan.path is not None, plan.reason
    return plan.path


def assert_drivable(plan: Plan, *, goal: Pose, grid: OccupancyGrid, max_curvature: float = 0.02) -> None:
    assert plan.status == PlanStatus.FOUND, plan.reason
    path = path_of(plan)
    assert np.diff(path.arc_length).max() <= 0.5
    assert np.hypot(*(path.poses[-1, :2] - goal[:2])) <= 0.1
    assert abs(wrap_angle(path.poses[-1, 2] - goal[2])) <= np.deg2rad(1)
    assert np.abs(path.curvature).max() <= max_curvature
    assert np.abs(np.diff(path.curvature)).max() <= 0.002
    nearest = clearances(path, grid).min()
    assert nearest > 0
    assert plan.min_clearance_m <= min(nearest, 1.5) + 1e-9


@pytest.mark.parametrize(
    "alignment",
    [None, Alignment(angle=0.4), Alignment(angle=np.pi / 4), Alignment(radius_m=300.0), Alignment(radius_m=900.0)],
    ids=["straight", "turned 23 deg", "turned 45 deg", "bend of 300 m", "bend of 900 m"],
)
@pytest.mark.parametrize("kind", ["corridor", "cones"])
def test_plan_through_a_lane_closure_is_smooth_and_keeps_half_a_metre(kind: Kind, alignment: Alignment | None) -> None:
    grid, start, goal = work_zone_grid(kind=kind, alignment=alignment)
    plan = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=PlannerSpec())
    assert_drivable(plan, goal=goal, grid=grid)
    assert plan.min_clearance_m >= 0.5


@pytest.mark.parametrize("speed_mps", [3.0, 10.0, 24.0])
def test_plan_keeps_lateral_acceleration_within_its_limit_at_the_planned_speed(speed_mps: float) -> None:
    grid, start, goal = work_zone_grid()
    spec = PlannerSpec(planned_speed_mps=speed_mps)
    plan = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=spec)
    assert_drivable(plan, goal=goal, grid=grid, max_curvature=min(2 / speed_mps**2, 1 / CAR.min_turning_radius_m))


def test_bend_that_is_too_sharp_for_the_planned_speed_is_planned_for_the_speed_that_it_allows() -> None:
    # 60 mph need a radius of 26.8^2 / 2 = 360 m; with half the square of the speed, 19 m/s, it is 180 m.
    grid, start, goal = work_zone_grid(resolution=0.25, alignment=Alignment(radius_m=300.0))
    plan = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=PlannerSpec(planned_speed_mps=26.8))
    assert plan.status is PlanStatus.FOUND
    assert plan.speed_mps == pytest.approx(26.8 / np.sqrt(2))
    assert np.abs(path_of(plan).curvature).max() <= 2.0 / plan.speed_mps**2
    assert np.abs(path_of(plan).curvature).max() > 2.0 / 26.8**2


def test_reported_clearance_equals_shapelys() -> None:
    grid, start, goal = work_zone_grid()
    plan = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=PlannerSpec())
    assert plan.min_clearance_m == pytest.approx(clearances(path_of(plan), grid).min(), abs=1e-6)


def test_papers_point_on_an_inflated_map_passes_where_the_car_does_not_fit() -> None:
    grid = corridor(1.75, resolution=0.125)
    paper = PlannerSpec(body="point", inflation_radius_m=0.7)
    plan = plan_path(grid, start=STRAIGHT[0], goal=STRAIGHT[1], vehicle=CAR, spec=paper)
    assert plan.status == PlanStatus.FOUND
    assert plan.min_clearance_m == 0
    assert plan_path(grid, start=STRAIGHT[0], goal=STRAIGHT[1], vehicle=CAR, spec=PlannerSpec()).status == "START_OCCUPIED"


@pytest.mark.parametrize("name", ["start", "goal"])
@pytest.mark.parametrize("pose", [(-1.0, 20.0, 0.0), (10.0, 1e9, 0.0), (np.nan, 20.0, 0.0)])
def test_pose_off_the_map_is_refused_with_its_numbers(name: str, pose: Pose) -> None:
    poses = {"start": STRAIGHT[0], "goal": STRAIGHT[1]} | {name: pose}
    with pytest.raises(MapError, match=rf"{name} \(.*(map|finite)"):
        plan_path(corridor(4), start=poses["start"], goal=poses["goal"], vehicle=CAR, spec=PlannerSpec())


def test_map_beyond_the_size_limit_is_refused_with_both_numbers() -> None:
    row = np.zeros((1, 10_000), dtype=np.float32)
    grid = grid_of(np.zeros((2, 2)))
    object.__setattr__(grid, "p_occupied", np.broadcast_to(row, (10_000, 10_000)))
    with pytest.raises(MapError, match="100000000 cells is too large to plan on"):
        plan_path(grid, start=(10, 10, 0), goal=(100, 10, 0), vehicle=CAR, spec=PlannerSpec())


def walled(gap_m: float) -> OccupancyGrid:
    p = corridor(40).p_occupied.copy()
    p[:, 300:304] = 1
    p[int((20 - gap_m / 2) * 4) : int((20 + gap_m / 2) * 4), 300:304] = 0
    return grid_of(p)


@pytest.mark.parametrize(
    ("grid", "start", "goal", "status"),
    [
        (grid_of(np.ones((160, 600))), *STRAIGHT, "START_OCCUPIED"),
        (corridor(1.5), *STRAIGHT, "START_OCCUPIED"),
        (corridor(4), STRAIGHT[0], (140.0, 20.0, np.pi / 2), "GOAL_OCCUPIED"),
        (corridor(4), STRAIGHT[0], (140.0, 26.0, 0.0), "GOAL_OCCUPIED"),
        (corridor(40), STRAIGHT[0], (149.0, 20.0, 0.0), "GOAL_OCCUPIED"),  # the front would leave the map
        (walled(0), *STRAIGHT, "NO_PATH"),
        (walled(1), *STRAIGHT, "NO_PATH"),
        (walled(3), *STRAIGHT, "FOUND"),
        (corridor(40), *STRAIGHT, "FOUND"),
    ],
    ids=["all occupied", "slot", "goal across", "goal in wall", "goal at edge", "wall", "gap 1 m", "gap 3 m", "all free"],
)
def test_status_on_simple_maps(grid: OccupancyGrid, start: Pose, goal: Pose, status: str) -> None:
    plan = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=PlannerSpec())
    assert plan.status == status
    assert (plan.path is None) == (plan.reason != "") == (status != "FOUND")


def test_goal_against_the_direction_of_a_corridor_ends_without_a_path_within_the_limit() -> None:
    spec = PlannerSpec(max_expansions=3000)
    plan = plan_path(corridor(4), start=STRAIGHT[0], goal=(140.0, 20.0, np.pi), vehicle=CAR, spec=spec)
    assert plan.status in {PlanStatus.NO_PATH, PlanStatus.LIMIT_REACHED}
    assert plan.n_expansions <= 3000
    assert "180.0 deg" in plan.reason


@pytest.mark.parametrize("speed_mps", [0.0, 60.0])
def test_extreme_speeds_are_planned_on_a_straight_corridor(speed_mps: float) -> None:
    plan = plan_path(
        corridor(4), start=STRAIGHT[0], goal=STRAIGHT[1], vehicle=CAR, spec=PlannerSpec(planned_speed_mps=speed_mps)
    )
    assert_drivable(plan, goal=STRAIGHT[1], grid=corridor(4))


def test_corridor_a_hand_wider_than_the_car_is_driven_without_contact() -> None:
    grid = corridor(2.0)
    assert_drivable(
        plan_path(grid, start=STRAIGHT[0], goal=STRAIGHT[1], vehicle=CAR, spec=PlannerSpec()), goal=STRAIGHT[1], grid=grid
    )


def test_plans_from_a_kept_field_equal_plans_made_at_once() -> None:
    grid, start, goal = work_zone_grid()
    field = prepare_field(grid, goal=goal, vehicle=CAR, spec=PlannerSpec())
    whole = path_of(plan_from(field, start=start)).poses
    for begin in (start, *(pose_of(whole[int(x / 0.48)]) for x in (60.0, 500.0))):
        kept, fresh = plan_from(field, start=begin), plan_path(grid, start=begin, goal=goal, vehicle=CAR, spec=PlannerSpec())
        np.testing.assert_array_equal(path_of(kept).poses, path_of(fresh).poses)
        assert dataclasses.replace(kept, timings_ms={}, path=None) == dataclasses.replace(fresh, timings_ms={}, path=None)


def test_path_moves_with_the_maps_origin() -> None:
    grid, start, goal = work_zone_grid()
    here = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=PlannerSpec())
    far = grid_of(grid.p_occupied, origin=(4096.0, -8192.0))
    shift = np.array([4096.0, -8192.0, 0.0])
    there = plan_path(far, start=pose_of(start + shift), goal=pose_of(goal + shift), vehicle=CAR, spec=PlannerSpec())
    np.testing.assert_allclose(path_of(there).poses - shift, path_of(here).poses, atol=1e-6)


def test_path_goes_round_cells_that_are_likely_but_not_certainly_occupied() -> None:
    y, x = (np.mgrid[:160, :600] + 0.5) * 0.25
    p = 0.19 * np.exp(-(((y - 20) / 3) ** 2)) * (np.abs(x - 75) < 15)  # a hump on the straight way, below the threshold
    plan = plan_path(grid_of(p), start=STRAIGHT[0], goal=STRAIGHT[1], vehicle=CAR, spec=PlannerSpec())
    blind = plan_path(grid_of(p), start=STRAIGHT[0], goal=STRAIGHT[1], vehicle=CAR, spec=PlannerSpec(occupancy_cost=0.0))
    assert blind.risk_m == pytest.approx(0.19 * (30 + CAR.length_m), abs=0.2)
    assert blind.max_p_occupied == pytest.approx(0.19, abs=0.001)
    assert plan.risk_m < 0.75 * blind.risk_m


def test_unknown_cells_are_not_free() -> None:
    p = np.full((160, 600), 0.5, dtype=np.float32)
    assert (
        plan_path(grid_of(p), start=STRAIGHT[0], goal=STRAIGHT[1], vehicle=CAR, spec=PlannerSpec()).status == "START_OCCUPIED"
    )
    bold = PlannerSpec(max_p_occupied=0.65)
    assert plan_path(grid_of(p), start=STRAIGHT[0], goal=STRAIGHT[1], vehicle=CAR, spec=bold).status == "FOUND"


def test_path_that_a_hasty_search_found_is_looked_for_again_with_care() -> None:
    grid, start, goal = work_zone_grid(resolution=0.25, kind="cones")
    plans = [
        plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=PlannerSpec(max_expansions=n)) for n in (100_000, 20_000)
    ]
    # The careful search may take 1.5 % of the limit: enough of the first, too little of the second.
    assert 300 < plans[0].n_expansions < 1500 < plans[1].n_expansions
    np.testing.assert_array_equal(path_of(plans[1]).poses, path_of(plans[0]).poses)


KERNELS = (
    distance_field._fill_distances,
    planning_field._spread_costs,
    hybrid_astar.search,
    path_check._min_clearance,
    path_check._max_p_under,
    path_check._touching,
    pushing._smooth,
    terrain._fill_multiplier,
)


def test_odd_but_valid_input_plans_the_same_path_with_no_further_compilation() -> None:
    p = corridor(4, resolution=1.0).p_occupied
    expected = plan_path(grid_of(p, 1.0), start=STRAIGHT[0], goal=STRAIGHT[1], vehicle=CAR, spec=PlannerSpec())
    compile_kernels()
    compiled = [len(kernel.signatures) for kernel in KERNELS]
    odd = p[::-1][::-1].copy(order="F")
    odd.setflags(write=False)
    grid = grid_of(odd, resolution=1, origin=(0, 0))
    plan = plan_path(grid, start=(10, 20, 0), goal=(140, 20, 0), vehicle=CAR, spec=PlannerSpec(heuristic_weight=1.2))
    np.testing.assert_array_equal(path_of(plan).poses, path_of(expected).poses)
    assert [len(kernel.signatures) for kernel in KERNELS] == compiled


@pytest.mark.parametrize("distance_m", [0.0, 0.3, 3.0])
def test_goal_at_or_just_ahead_of_the_start_is_reached_on_a_straight(distance_m: float) -> None:
    goal = (10.0 + distance_m, 20.0, 0.0)
    plan = plan_path(corridor(4), start=STRAIGHT[0], goal=goal, vehicle=CAR, spec=PlannerSpec())
    assert plan.status == "FOUND"
    assert path_of(plan).arc_length[-1] == pytest.approx(distance_m, abs=1e-6)
    np.testing.assert_allclose(path_of(plan).poses[-1], goal, atol=1e-6)


def test_timings_of_a_kept_field_count_for_the_first_plan_alone() -> None:
    grid, start, goal = work_zone_grid()
    field = prepare_field(grid, goal=goal, vehicle=CAR, spec=PlannerSpec())
    again = plan_from(field, start=start).timings_ms
    first = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=PlannerSpec()).timings_ms
    assert again["distance_field"] == again["heuristic"] == 0
    assert min(first[key] for key in ("distance_field", "heuristic", "search", "smoothing", "check")) > 0
    for timings in (first, again):
        assert timings["total"] == pytest.approx(sum(value for key, value in timings.items() if key != "total"))


def test_path_through_two_open_lanes_does_not_weave_between_them() -> None:
    # Free space 7.25 m wide, the ends nearer to its edge than is preferred: away from it once and back, at most twice 3.7 m.
    p = np.ones((80, 4000), dtype=np.float32)
    p[20:49, :] = 0.0
    grid = OccupancyGrid(p_occupied=p, resolution=0.25, origin=(0.0, 0.0))
    plan = plan_path(grid, start=(10.0, 10.5, 0.0), goal=(980.0, 10.5, 0.0), vehicle=VehicleGeometry(), spec=PlannerSpec())
    sideways = np.abs(np.diff(path_of(plan).poses[:, 1])).sum()
    assert sideways < 8.0  # a quadratic price of turning gave 37 m
