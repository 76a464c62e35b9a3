import numpy as np
import pandas as pd
import pytest
from builders import straight_traces

from wzsumo.case.crowd import collection_figures, free_witnessed_ground, witness_reach_m, witnessed_ground
from wzsumo.errors import SpecError
from wzsumo.frames import BoolArray
from wzsumo.grid import OccupancyGrid
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.site import Site, prepare_site

PAPER = load_scenario("scenarios/paper.toml")
MIDDLE = 5.49  # m, centre of the lane of start and goal
REACH_M = 0.93 + 0.25  # half a vehicle and the scatter of drivers


@pytest.fixture(scope="module")
def cells() -> OccupancyGrid:
    site: Site = prepare_site(PAPER)
    return site.cells


def with_error(error_m: float) -> Scenario:
    return PAPER.model_copy(update={"gnss": PAPER.gnss.model_copy(update={"error_m": error_m})})


def width_of(ground: BoolArray, cells: OccupancyGrid) -> float:
    """Width [m] of the cells beside x = 500 m."""
    (_,), (col,) = cells.cell_of((500.0, MIDDLE))
    return float(ground[:, col].sum() * cells.resolution)


def test_ground_that_two_vehicles_drove_over_is_as_wide_as_they_have_in_common(cells: OccupancyGrid) -> None:
    traces = straight_traces([MIDDLE - 0.2, MIDDLE + 0.2], length_m=1100.0)
    ground = witnessed_ground(cells, traces, reach_m=REACH_M)
    assert width_of(ground, cells) == pytest.approx(2 * REACH_M - 0.4, abs=cells.resolution)


def test_ground_that_one_vehicle_drove_over_is_not_known_to_be_free(cells: OccupancyGrid) -> None:
    alone = straight_traces([MIDDLE], length_m=1100.0)
    assert not witnessed_ground(cells, alone, reach_m=REACH_M).any()
    assert witnessed_ground(cells, pd.concat([alone, alone.assign(vehicle_id="b")]), reach_m=REACH_M).any()


def test_reach_of_a_witness_shrinks_by_two_standard_deviations_of_the_position_to_nothing() -> None:
    assert witness_reach_m(PAPER) == pytest.approx(1.18)  # half of 1.86 m, and the 0.25 m by which drivers scatter
    assert witness_reach_m(with_error(0.3)) == pytest.approx(1.18 - 2 * 0.3)
    assert witness_reach_m(with_error(1.0)) < 0


def test_map_that_doubts_ground_which_the_crowd_drove_over_has_it_free(cells: OccupancyGrid) -> None:
    doubtful = cells.with_p_occupied(np.full(cells.shape, 0.3))
    traces = straight_traces([MIDDLE, MIDDLE], length_m=1100.0)
    freed = free_witnessed_ground(doubtful, traces, reach_m=REACH_M)
    assert width_of(freed.free, cells) == pytest.approx(2 * REACH_M, abs=cells.resolution)
    assert free_witnessed_ground(doubtful, traces, reach_m=-0.8).p_occupied.min() == pytest.approx(0.3)


def test_minutes_to_collect_run_from_the_first_vehicle_to_the_last_of_those_that_are_used() -> None:
    trace = straight_traces([MIDDLE], length_m=1100.0)
    traces = pd.concat([trace.assign(vehicle_id=f"v{n}", time_s=trace["time_s"] + 60 * n) for n in range(5)])
    scenario = PAPER.model_copy(update={"crowd": PAPER.crowd.model_copy(update={"penetration": 1.0, "used": 4})})
    assert collection_figures(traces, scenario) == {"n_equipped": 5, "minutes_to_collect": pytest.approx(3.0)}
    more = PAPER.model_copy(update={"crowd": PAPER.crowd.model_copy(update={"penetration": 1.0, "used": 6})})
    with pytest.raises(SpecError, match=r"crowd\.used"):
        collection_figures(traces, more)
