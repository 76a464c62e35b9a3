import numpy as np
import pytest

from wzsumo.grid import OccupancyGrid
from wzsumo.planning.attempts import _attempts
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.planning_field import PlanningField, prepare_field
from wzsumo.vehicle import VehicleGeometry


def field_for(spec: PlannerSpec) -> PlanningField:
    grid = OccupancyGrid(p_occupied=np.zeros((40, 80), dtype=np.float32), resolution=0.5, origin=(0.0, 0.0))
    return prepare_field(grid, goal=(30.0, 10.0, 0.0), vehicle=VehicleGeometry(), spec=spec)


def test_searches_are_careful_then_hasty_then_finer_then_for_lower_speeds() -> None:
    attempts = _attempts(field_for(PlannerSpec()))
    assert [tuple(attempt) for attempt in attempts[:3]] == [(10.0, 1, 1.0, 0.015), (10.0, 1, 1.7, 0.4), (10.0, 2, 1.7, 0.7)]
    slower = attempts[3:]
    # Half the square of the speed each time, until 2 / v^2 reaches the 0.2457 1/m of full steering: 2.853 m/s.
    assert [attempt.speed_mps for attempt in slower] == pytest.approx([10 / np.sqrt(2) ** n for n in (1, 2, 3, 4)])
    assert [attempt.expansion_share for attempt in slower] == pytest.approx([0.7 + 0.3 * n / 4 for n in (1, 2, 3, 4)])
    assert {(attempt.fineness, attempt.haste) for attempt in slower} == {(1, 1.7)}


def test_no_search_is_for_less_than_the_slowest_share_of_the_planned_speed() -> None:
    attempts = _attempts(field_for(PlannerSpec(slowest_share=0.6)))
    assert [attempt.speed_mps for attempt in attempts[3:]] == pytest.approx([10 / np.sqrt(2)])
    only = _attempts(field_for(PlannerSpec(slowest_share=1.0)))
    assert [attempt.expansion_share for attempt in only] == [0.015, 0.4, 1.0]
