from types import SimpleNamespace
from typing import cast

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces
from case.finished_plans import coarse_paper, coarse_site

from wzsumo.case import map_method
from wzsumo.case.crowd import Crowd
from wzsumo.case.map_method import LidarMethod, MadeMap, MapTask, MixtureMethod, TracesMethod
from wzsumo.case.methods import METHODS
from wzsumo.case.sources import Sources
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec
from wzsumo.grid import blank_grid

CELLS = blank_grid((0, 0, 100, 10), resolution=0.5, p_occupied=1.0)


def test_method_of_the_crowd_gets_the_scenarios_road_vehicle_seed_and_reach_of_a_witness() -> None:
    asked: list[MapTask] = []

    def make(_traces: pd.DataFrame, task: MapTask) -> MadeMap:
        asked.append(task)
        return MadeMap(task.cells, {})

    scenario = coarse_paper().model_copy(update={"seed": 77})
    site = coarse_site()
    crowd = Crowd(traces=straight_traces([5.5]), road=site.layout.road, spec=MixtureSpec(k_max=1), seed=1)
    TracesMethod(name="asks", title="", make=make).map_of_crowd(crowd, scenario=scenario, site=site)
    (task,) = asked
    assert (task.half_width_m, task.seed) == (0.93, 77)  # the car is 1.86 m wide
    assert task.witness_reach_m == pytest.approx(0.93 + 0.25)
    assert task.cells is site.cells
    assert task.before is not None
    assert (task.before.start, task.before.end) == (site.layout.start, site.layout.end)


@pytest.mark.parametrize(("n_fixes", "n_taken"), [(100_000, 100_000), (100_001, 50_001), (250_000, 83_334)])
def test_of_more_than_100_000_fixes_every_nth_is_taken_for_a_mixture(
    monkeypatch: pytest.MonkeyPatch, n_fixes: int, n_taken: int
) -> None:
    taken = []

    def make_of(_self: MixtureMethod, crowd: Crowd, _task: MapTask) -> MadeMap:
        taken.append(len(crowd.traces))
        return MadeMap(CELLS, {})

    monkeypatch.setattr(map_method, "reference_line_from_traces", lambda fixes: fixes)
    monkeypatch.setattr(MixtureMethod, "make_of", make_of)
    method = MixtureMethod(name="mixture", title="", make=lambda _crowd, task: task.cells)
    method.map_of_traces(pd.DataFrame({"x_m": np.zeros(n_fixes)}), MapTask(cells=CELLS, half_width_m=0.9, seed=1))
    assert taken == [n_taken]


def test_mixture_method_names_the_number_of_its_components() -> None:
    crowd = Crowd(traces=straight_traces([5.5]), road=coarse_site().layout.road, spec=MixtureSpec(k_max=1), seed=1)
    made = METHODS["swept"]
    assert isinstance(made, MixtureMethod)
    assert made.make_of(crowd, MapTask(cells=CELLS, half_width_m=0.9, seed=1)).figures == {"n_components": 1}


def test_map_of_scans_ends_at_the_outer_edges_of_the_shoulders_of_the_road_before() -> None:
    """Scans that saw nothing: free is the paper's pavement, from 10 ft right of the lanes to 48 ft, also where it is closed."""
    site = coarse_site()
    seen = site.cells.with_p_occupied(np.zeros(site.cells.shape))
    method = LidarMethod(name="blind", title="", form=lambda _maps: seen)
    lidar = SimpleNamespace(maps=None)
    grid = method.map_of_zone(cast("Sources", SimpleNamespace(lidar=lidar, site=site))).grid
    x = (site.layout.start + site.layout.end) / 2
    y = np.array([-3.9, -3.2, -2.8, 1.0, 14.3, 14.9])  # shoulders from -3.05 to 0 m and up to 14.63 m
    free = grid.free[grid.cell_of(np.column_stack([np.full_like(y, x), y]))]
    assert free.tolist() == [False, False, True, True, True, False]


def test_only_lanes_joins_a_road_and_it_and_live_maps_cost_more_than_half_a_second() -> None:
    assert {name for name, method in METHODS.items() if method.joins_road} == {"lanes"}
    assert {name: method.cpu_s for name, method in METHODS.items() if method.cpu_s != 0.5} == {
        "lanes": 2.0, "live": 60.0, "map_of_before": 60.0,
    }  # fmt: skip


def test_squares_have_the_sides_of_their_method() -> None:
    """One sample in the middle of fine cells: the paper's squares of 5 in, and those of 5 ft that join."""
    fine = blank_grid((98.0, 3.5, 102.0, 7.5), resolution=0.01, p_occupied=1.0)
    crowd = Crowd(traces=straight_traces([5.5]), road=coarse_site().layout.road, spec=MixtureSpec(k_max=1, n_samples=1), seed=1)
    vars(crowd)["samples"] = np.array([[100.0, 5.5]])
    task = MapTask(cells=fine, half_width_m=0.9, seed=1)
    for name, side_m in (("paper_literal", 0.127), ("paper", 1.524)):
        method = METHODS[name]
        assert isinstance(method, MixtureMethod)
        free = method.make_of(crowd, task).grid.free
        assert free.sum() * 0.01**2 == pytest.approx(side_m**2, rel=0.15)
