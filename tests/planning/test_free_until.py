import numpy as np
import pytest

from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.path_check import free_until
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()


def walled(x_m: float) -> OccupancyGrid:
    """120 m by 20 m, free but for a wall across it."""
    p = np.zeros((80, 480), dtype=np.float32)
    p[:, round(x_m / 0.25) : round(x_m / 0.25) + 4] = 1.0
    return OccupancyGrid(p_occupied=p, resolution=0.25, origin=(0.0, 0.0))


def path(first_m: float, last_m: float) -> ReferencePath:
    x = np.arange(first_m, last_m + 0.1, 0.5)
    return ReferencePath(poses=np.column_stack([x, np.full_like(x, 10.0), np.zeros_like(x)]))


@pytest.mark.parametrize("start_m", [0.0, 30.0])
def test_path_is_free_until_the_front_bumper_meets_a_wall(start_m: float) -> None:
    found = free_until(path(10.0, 100.0), walled(80.0), start_m=start_m, vehicle=CAR, spec=PlannerSpec())
    assert found == pytest.approx(70.0 - CAR.axle_to_bumper_m, abs=0.75)


def test_path_without_a_wall_is_free_to_its_end_and_one_that_begins_in_a_wall_nowhere() -> None:
    assert free_until(path(10.0, 70.0), walled(80.0), start_m=0.0, vehicle=CAR, spec=PlannerSpec()) == pytest.approx(60.0)
    in_wall = free_until(path(10.0, 100.0), walled(80.0), start_m=70.0, vehicle=CAR, spec=PlannerSpec())
    assert in_wall == pytest.approx(70.0, abs=0.5)
