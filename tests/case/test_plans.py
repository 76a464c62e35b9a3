from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from builders import lane_map_of, straight_traces
from case.finished_plans import coarse_paper, coarse_site

from wzsumo.case.map_method import MadeMap, lines_of_lanes, lines_of_mixture, lines_of_traces
from wzsumo.case.methods import METHODS, map_of_before
from wzsumo.case.plans import lanes_to_goal, nominal_lanes, plan_for, within_lane
from wzsumo.crowd_mapping.lanes.raster import occupancy_grid
from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.frames import advance
from wzsumo.metrics.lane_keeping import measure_lane_keeping
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.site import Site, prepare_site

RIGHT, MIDDLE, LEFT = 1.829, 5.486, 9.144  # m, centres of the paper's lanes


def known_lanes(site: Site) -> MadeMap:
    """The map that knows the lanes of the site's layout."""
    lanes = lane_map_of(site.layout)
    learned = occupancy_grid(lanes, site.cells)
    grid = learned.with_p_occupied(np.where(site.nominal, 0.0, learned.p_occupied))
    width = float(np.median([lane.left - lane.right for lane in lanes.lanes]))
    return MadeMap(grid, {}, lanes, lines=lines_of_lanes(lanes), lane_width_m=width)


@pytest.fixture(scope="module")
def paper() -> tuple[Scenario, Site]:
    scenario = load_scenario("scenarios/paper.toml")
    scenario = scenario.model_copy(update={"map": scenario.map.model_copy(update={"resolution_m": 0.25})})
    return scenario, prepare_site(scenario)


def test_path_on_known_lanes_keeps_to_the_middle_of_its_lane_through_the_papers_shift(paper: tuple[Scenario, Site]) -> None:
    scenario, site = paper
    plan = plan_for(METHODS["lanes"], known_lanes(site), scenario=scenario, site=site)
    assert plan.path is not None
    kept = measure_lane_keeping(plan.path.poses, vehicle=scenario.vehicle, layout=site.layout)
    assert (kept.over_line_share, kept.n_lane_changes) == (0.0, 0)
    assert kept.mean_off_middle_m < 0.12
    assert kept.sd_off_middle_m < 0.15
    # No swing after the shifting taper: from 50 m behind it to the shift back the path lies on the lane's middle.
    centres = advance(plan.path.poses, scenario.vehicle.axle_to_centre_m)
    s, d = site.layout.road.to_sd(centres[:, :2])
    lane = next(lane for lane in site.layout.lanes if lane.index == 1)
    middle = (lane.right(s) + lane.left(s)) / 2
    beside_work = (s > site.layout.area("shifting taper").end + 50) & (s < site.layout.area("shift back").start - 50)
    assert np.abs(d - middle)[beside_work].max() < 0.2
    assert plan.n_expansions == 0


def test_start_in_the_closing_lane_leads_out_of_it_once_and_back_once(paper: tuple[Scenario, Site]) -> None:
    scenario, site = paper
    road = site.layout.road
    (first, last), _ = road.to_sd([site.start[:2], site.goal[:2]])
    start, goal = ((float(s), float(road.to_xy(s, LEFT)[1]), 0.0) for s in (first, last))
    (route,), _ = lanes_to_goal(known_lanes(site), scenario=scenario, site=replace(site, start=start, goal=goal))
    closed = (route[:, 0] > site.layout.area("tangent").start) & (route[:, 0] < site.layout.area("shifting taper").start)
    np.testing.assert_allclose(route[closed, 1], MIDDLE, atol=0.25)
    before = route[route[:, 0] < site.layout.area("tangent").start, 1]
    assert (np.diff(before) < 1e-9).all()  # to the right, and never back
    assert route[-1, 1] == pytest.approx(LEFT, abs=0.06)


@pytest.mark.parametrize("speed_mps", [10.0, 20.0, 26.0])
def test_change_out_of_the_closing_lane_takes_some_seconds_at_the_egos_own_speed(
    speed_mps: float, paper: tuple[Scenario, Site]
) -> None:
    """A slow ego that took as many metres as those at the posted speed was astride the line for 10 s, a tenth of the zone."""
    scenario, site = paper
    (first,), _ = site.layout.road.to_sd([site.start[:2]])
    start = (float(first), float(site.layout.road.to_xy(first, LEFT)[1]), 0.0)
    planner = scenario.planner.model_copy(update={"planned_speed_mps": speed_mps})
    scenario = scenario.model_copy(update={"planner": planner})
    (route,), _ = lanes_to_goal(known_lanes(site), scenario=scenario, site=replace(site, start=start))
    over = (route[:, 0] < site.layout.area("shifting taper").start) & (np.abs(route[:, 1] - (LEFT + MIDDLE) / 2) < 0.93)
    # The outline of 1.86 m is over the line for some half of a change of 4.6 s (Toledo & Zohar 2007); points are 5 m apart.
    assert 1.5 * speed_mps - 5 < np.ptp(route[over, 0]) < 3.5 * speed_mps + 5


def test_map_without_lanes_is_searched_by_the_nominal_lanes_before_and_after_the_zone(paper: tuple[Scenario, Site]) -> None:
    scenario, site = paper
    made = MadeMap(map_of_before(site), {})
    routes, lanes = lanes_to_goal(made, scenario=scenario, site=site)
    assert routes == ()
    xs, ys = lanes[:, :, 0], lanes[:, :, 1]
    layout = site.layout
    assert ((xs <= layout.start + 1e-6) | (xs >= layout.end - 1e-6)).all()
    assert {round(float(y), 2) for y in ys.ravel()} == {round(y, 2) for y in (RIGHT, MIDDLE, LEFT)}
    assert len(nominal_lanes(site.layout.road, beside=(site.layout.start, site.layout.end))) == 6


def test_path_is_searched_for_where_the_route_is_not_free(paper: tuple[Scenario, Site]) -> None:
    scenario, site = paper
    made = known_lanes(site)
    # A wall across the ego's lane for 40 m, and the known lanes say nothing of it.
    rows, cols = np.indices(made.grid.shape)
    x, y = made.grid.centre_of(rows.ravel(), cols.ravel()).T
    wall = ((x > 1100) & (x < 1140) & (y > 0.4)).reshape(made.grid.shape)
    blocked = made._replace(grid=made.grid.with_p_occupied(np.where(wall, 1.0, made.grid.p_occupied)))
    plan = plan_for(METHODS["lanes"], blocked, scenario=scenario, site=site)
    assert plan.path is not None
    assert plan.min_clearance_m > 0


def test_path_along_which_a_few_metres_are_not_free_is_in_the_next_lane_not_between_two(paper: tuple[Scenario, Site]) -> None:
    # A wall across the ego's lane for 8 m: dearer to go around than through, for a route that may not be passable.
    scenario, site = paper
    made, (ego, beside) = (
        known_lanes(site),
        (next(lane for lane in site.layout.lanes if lane.index == index) for index in (1, 0)),
    )
    x, y = made.grid.centre_of(*np.indices(made.grid.shape).reshape(2, -1)).T
    wall = ((x > 1200) & (x < 1208) & (y > ego.right(x)) & (y < ego.left(x))).reshape(made.grid.shape)
    blocked = made._replace(grid=made.grid.with_p_occupied(np.where(wall, 1.0, made.grid.p_occupied)))
    through, around = lanes_to_goal(blocked, scenario=scenario, site=site)[0]
    at_wall = float(ego.right(1204.0) + ego.left(1204.0)) / 2
    assert np.interp(1204.0, *through.T) == pytest.approx(at_wall, abs=0.2)
    middle = float(beside.right(1204.0) + beside.left(1204.0)) / 2
    assert np.interp(1204.0, *around.T) == pytest.approx(middle, abs=0.7)  # a car of 1.86 m is within a lane of 11 ft
    plan = plan_for(METHODS["lanes"], blocked, scenario=scenario, site=site)
    assert plan.path is not None
    assert plan.n_expansions == 0
    keeping = measure_lane_keeping(plan.path.poses, vehicle=scenario.vehicle, layout=site.layout)
    assert keeping.n_lane_changes == 2
    assert keeping.over_line_share < 0.25  # two changes of lanes of 123 m, half of each over the line, in a zone of 1 km


def test_no_more_clearance_is_wished_for_than_the_lane_has(paper: tuple[Scenario, Site]) -> None:
    scenario, site = paper
    made = known_lanes(site)._replace(lane_width_m=3.353)  # lanes of 11 ft: 0.75 m on either side of a car of 1.86 m
    for wished, got in ((0.5, 0.5), (0.7, 0.7), (1.2, 0.746)):
        planner = scenario.planner.model_copy(update={"preferred_clearance_m": wished})
        assert within_lane(planner, made, scenario=scenario, site=site).preferred_clearance_m == pytest.approx(got, abs=0.01)
    unknown = MadeMap(made.grid, {})  # then the road's lanes of 12 ft
    wide = scenario.planner.model_copy(update={"preferred_clearance_m": 1.2})
    assert within_lane(wide, unknown, scenario=scenario, site=site).preferred_clearance_m == pytest.approx(0.899, abs=0.001)


def test_lines_of_a_lane_map_are_the_middles_of_its_lanes_where_they_are_open() -> None:
    layout = coarse_site().layout
    lines = lines_of_lanes(lane_map_of(layout))
    reach = sorted(
        (round(float(line.offsets[0]), 1), round(float(line.stations[0])), round(float(line.stations[-1]))) for line in lines
    )
    assert len(reach) == 4  # two lanes go through, the closing one has a part before the zone and one after it
    of_closing = [line for line in lines if abs(float(line.offsets[0]) - LEFT) < 0.3]
    assert len(of_closing) == 2
    taper = coarse_site().layout.area("merging taper")
    assert taper.start < min(line.stations[-1] for line in of_closing) < taper.end


def test_lines_of_traces_lie_where_they_were_driven_without_the_common_error_and_weigh_less_the_more_receivers_err() -> None:
    traces = straight_traces([RIGHT + 1.2, MIDDLE + 0.8])
    road = coarse_site().layout.road
    right, middle = lines_of_traces(traces, axis=road, shift_m=1.0, error_m=0.0)
    np.testing.assert_allclose(right.offsets, RIGHT + 0.2, atol=1e-6)
    np.testing.assert_allclose(middle.offsets, MIDDLE - 0.2, atol=1e-6)
    assert (right.stations[0] < 5, right.stations[-1] > 95, len(right.stations)) == (True, True, 21)
    assert right.weight == pytest.approx(0.3**2 / 0.25**2)  # of a lane's middle, known to 0.3 m, beside a driver's 0.25 m
    (vague, _) = lines_of_traces(traces, axis=road, shift_m=1.0, error_m=1.0)
    assert vague.weight == pytest.approx(0.3**2 / (0.25**2 + 1))


def test_path_follows_the_lane_that_work_has_narrowed_where_vehicles_drive_it(paper: tuple[Scenario, Site]) -> None:
    # The map has lanes of 12 ft; the zone's are of 11 ft, 0.3 m beside, and five vehicles drove there.
    scenario, site = paper
    known, road, lane = known_lanes(site), site.layout.road, next(lane for lane in site.layout.lanes if lane.index == 1)
    s = np.arange(site.layout.start, site.layout.end, 2.0)
    true_middle = (lane.right(s) + lane.left(s)) / 2
    beside = tuple(replace(line, offsets=line.offsets + 0.3) for line in known.lines)
    places = [road.to_xy(s, true_middle + off) for off in (-0.2, -0.1, 0.0, 0.1, 0.2)]
    traces = pd.concat(pd.DataFrame({"vehicle_id": f"{i}", "x_m": xy[:, 0], "y_m": xy[:, 1]}) for i, xy in enumerate(places))
    driven = lines_of_traces(traces, axis=road, shift_m=0.0, error_m=0.0)
    within = (s > site.layout.area("activity area").start + 30) & (s < site.layout.area("activity area").end - 30)
    off = []
    for lines in (beside, (*beside, *driven)):
        (route, *_), _ = lanes_to_goal(known._replace(lines=lines), scenario=scenario, site=site)
        station, offset = road.to_sd(route)
        off.append(np.abs(np.interp(s, station, offset) - true_middle)[within].max())
    assert off[0] > 0.25
    assert off[1] < 0.16


def test_lines_of_a_mixture_weigh_the_fixes_a_metre() -> None:
    covariances = np.array([np.diag([100.0**2 / 12, 0.01]), np.diag([300.0**2 / 12, 0.01])])
    mixture = Mixture(
        weights=np.array([0.5, 0.5]), means=np.array([[50.0, RIGHT], [150.0, MIDDLE]]), covariances=covariances,
        log_likelihood=0.0, n_points=100, converged=True,
    )  # fmt: skip
    short, long = lines_of_mixture(mixture)
    assert (short.stations[0], short.stations[-1]) == (pytest.approx(0), pytest.approx(100))
    assert short.weight / long.weight == pytest.approx(3)


def test_paper_method_plans_for_a_point_without_a_route() -> None:
    scenario, site = coarse_paper(), coarse_site()
    made = known_lanes(site)
    plan = plan_for(METHODS["paper"], made, scenario=scenario, site=site)
    assert plan.n_expansions > 0
