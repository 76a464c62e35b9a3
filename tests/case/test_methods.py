from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from builders import straight_traces

from wzsumo.case.crowd import Crowd
from wzsumo.case.map_method import MadeMap, MapTask, Source, TracesMethod
from wzsumo.case.methods import (
    METHODS,
    chosen_methods,
    is_baseline,
    map_of_before,
    map_of_before_with_devices,
    method_named,
    methods_from,
    register,
)
from wzsumo.case.traces_map import crowd_method
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec
from wzsumo.errors import InputError, SpecError
from wzsumo.grid import blank_grid, cells_inside
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.sections import SlamSpec
from wzsumo.scenario.site import Site, prepare_site

PAPER = load_scenario("scenarios/paper.toml")
COARSE = PAPER.model_copy(update={"map": PAPER.map.model_copy(update={"resolution_m": 0.25})})


@pytest.fixture(scope="module")
def site() -> Site:
    return prepare_site(COARSE)


@pytest.fixture(scope="module")
def barrier_site() -> Site:
    return prepare_site(load_scenario("scenarios/right_lane_barrier.toml"))


@pytest.fixture
def toy() -> Iterator[TracesMethod]:
    """A method that maps everything free, registered while a test runs."""

    def all_free(_traces: object, task: MapTask) -> MadeMap:
        return MadeMap(task.cells.with_p_occupied(np.zeros(task.cells.shape)), {"said": "free"})

    method = TracesMethod(name="all_free", title="everything is free", make=all_free)
    register(method)
    yield method
    del METHODS["all_free"]


def test_registered_method_is_found_by_its_name_and_counts_to_those_of_its_source(toy: TracesMethod) -> None:
    assert method_named("all_free") is toy
    assert "all_free" in methods_from(Source.CROWD)
    assert not is_baseline("all_free")
    assert chosen_methods(None, PAPER)[-1] is toy
    assert crowd_method("all_free", road=Path("road.toml")) is toy


def test_second_method_of_one_name_is_refused_and_the_first_kept(toy: TracesMethod) -> None:
    register(toy)  # the same again is no second one
    other = TracesMethod(name="all_free", title="another", make=toy.make)
    with pytest.raises(SpecError, match="map method all_free: there is one of that name"):
        register(other)
    assert METHODS["all_free"] is toy


def test_name_of_no_method_is_refused_with_the_known_names() -> None:
    with pytest.raises(
        SpecError,
        match=r"method lane: unknown .did you mean lanes.*; known methods: paper_literal, paper, swept, lanes, slam_raw",
    ):
        method_named("lane")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("hd_map", "method hd_map: makes no map of traces; methods that do: paper_literal, paper, swept, lanes"),
        ("swept", "r.toml: the method swept makes no use of the road before; leave the road out or take the method lanes"),
    ],
)
def test_method_that_cannot_map_traces_on_a_road_is_refused_with_those_that_can(name: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        crowd_method(name, road=Path("r.toml"))


def test_one_name_in_place_of_a_list_is_refused_with_the_list_to_give() -> None:
    with pytest.raises(SpecError, match=r"methods='hd_map': must be a list of names, such as \['hd_map'\]"):
        chosen_methods("hd_map", PAPER)


def test_methods_of_the_crowd_are_run_by_default_and_all_where_the_scenario_has_a_lidar() -> None:
    assert [method.name for method in chosen_methods(None, PAPER)] == ["paper_literal", "paper", "swept", "lanes"]
    with_slam: Scenario = PAPER.model_copy(update={"slam": SlamSpec()})
    assert [method.name for method in chosen_methods(None, with_slam)] == [
        name for name in METHODS if name not in {"live", "map_of_before"}
    ]
    assert [method.name for method in chosen_methods(["hd_map", "lanes"], with_slam)] == ["hd_map", "lanes"]


@pytest.mark.parametrize("name", ["lanes", "swept", "slam_barrier", "hd_map"])
def test_planner_of_the_scenario_is_taken_as_it_is(name: str) -> None:
    planner = PAPER.planner.model_copy(update={"preferred_clearance_m": 0.4})
    assert METHODS[name].planner(planner) == planner


@pytest.mark.parametrize("name", ["paper_literal", "paper"])
def test_on_the_papers_maps_a_point_is_planned_for_in_an_inflation_of_0_7_m_without_a_guide(name: str) -> None:
    planner = METHODS[name].planner(PAPER.planner)
    assert (planner.body, planner.inflation_radius_m, planner.guide_cost) == ("point", 0.7, 0.0)
    assert planner.preferred_clearance_m == PAPER.planner.preferred_clearance_m


def test_map_of_a_crowd_method_is_nominal_outside_the_announced_zone(site: Site) -> None:
    method = TracesMethod(name="nothing", title="nothing", make=lambda _traces, task: MadeMap(task.cells, {}))
    crowd = Crowd(traces=straight_traces([5.5]), road=site.layout.road, spec=MixtureSpec(k_max=1), seed=1)
    grid = method.map_of_crowd(crowd, scenario=COARSE, site=site).grid
    np.testing.assert_array_equal(grid.free, site.nominal)
    assert not crowd.is_fitted


def test_map_of_traces_joins_the_road_outside_the_announced_zone(toy: TracesMethod) -> None:
    cells = blank_grid((0, 0, 10, 10), resolution=0.5, p_occupied=1.0)
    made = toy.map_of_traces(straight_traces([5.0]), MapTask(cells=cells, half_width_m=0.9, seed=1))
    assert made.grid.free.all()
    assert made.figures == {"said": "free"}


@pytest.mark.parametrize("name", ["swept", "lanes"])
@pytest.mark.parametrize(("reach_m", "free"), [(0.0, False), (4.0, True)])
def test_map_of_the_crowd_has_ground_free_that_two_vehicles_drove_over(name: str, reach_m: float, free: bool) -> None:
    cells = blank_grid((0, -10, 200, 10), resolution=0.25, p_occupied=1.0)
    task = MapTask(cells=cells, half_width_m=0.9, seed=1, witness_reach_m=reach_m)
    grid = crowd_method(name, road=None).map_of_traces(straight_traces([-0.1, 0.0, 0.1], length_m=200.0), task).grid
    # 3.5 m beside the traces: beyond their lane and what vehicles of 1.8 m sweep.
    assert bool(grid.free[grid.cell_of([[100.0, 3.5]])][0]) == free


def test_map_of_before_frees_the_lanes_that_are_closed_now_and_no_shoulder(site: Site) -> None:
    road, free = site.layout.road, map_of_before(site).free
    lanes = cells_inside(site.cells, road.strip(0, road.length, 0, road.travelled_width))
    np.testing.assert_array_equal(free, lanes)
    assert free[cells_inside(site.cells, site.layout.closed_area)].any()


def test_every_device_on_the_lanes_is_marked_on_the_map_of_before_and_little_else(site: Site) -> None:
    devices, marked = site.layout.devices, map_of_before(site).free & ~map_of_before_with_devices(site).free
    row, col = site.cells.cell_of(devices[["x_m", "y_m"]])
    on_lanes = map_of_before(site).free[row, col]
    assert on_lanes.sum() >= 10
    assert marked[row, col][on_lanes].all()
    assert marked.sum() * site.cells.resolution**2 < len(devices) * 0.7**2  # a base of 14 in and a cell


def test_every_device_fills_the_cell_that_it_stands_in_however_coarse_the_cells() -> None:
    coarser = prepare_site(PAPER.model_copy(update={"map": PAPER.map.model_copy(update={"resolution_m": 0.8})}))
    free = map_of_before_with_devices(coarser).free
    assert not free[coarser.cells.cell_of(coarser.layout.devices[["x_m", "y_m"]])].any()


def test_barrier_is_marked_along_its_whole_length_on_the_map_of_before(barrier_site: Site) -> None:
    outlines = barrier_site.layout.device_outlines[barrier_site.layout.devices["length_m"].to_numpy() > 0]
    assert len(outlines) > 10
    free = map_of_before_with_devices(barrier_site).free
    assert not any(free[cells_inside(barrier_site.cells, outline)].any() for outline in outlines)
