from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from wzsumo.case.lidar_baseline import mapping_drive
from wzsumo.errors import SpecError
from wzsumo.scenario.scenario import load_scenario
from wzsumo.scenario.site import prepare_site

SCENARIO = load_scenario(Path(__file__).parents[2] / "scenarios" / "paper.toml", seed=1)
SITE = prepare_site(SCENARIO)
START_M, GOAL_M = SITE.layout.road.to_sd([SITE.start[:2], SITE.goal[:2]])[0]


def car(*, start_s: float = 130.0, late_m: float = 0.0, early_m: float = 0.0, length_m: float = 4.6) -> pd.DataFrame:
    """A car in the ego's lane whose trace begins `late_m` after the ego's start and ends `early_m` before its goal."""
    x = np.arange(START_M + late_m, GOAL_M - early_m + 1e-6, 1.0)
    return pd.DataFrame({
        "vehicle_id": "car", "time_s": start_s + (x - x[0]) / 20, "x_m": x, "y_m": float(SITE.start[1]), "heading_rad": 0.0,
        "speed_mps": 20.0, "length_m": length_m, "width_m": 1.8,
    })  # fmt: skip


def is_mapping_car(fleet: pd.DataFrame) -> bool:
    try:
        mapping_drive(fleet, scenario=SCENARIO, site=SITE)
    except SpecError:
        return False
    return True


@pytest.mark.parametrize(("start_s", "taken"), [(119.9, False), (120.0, True)])
def test_mapping_car_enters_after_two_minutes(start_s: float, taken: bool) -> None:
    assert is_mapping_car(car(start_s=start_s)) == taken


@pytest.mark.parametrize(("late_m", "early_m", "taken"), [(8.5, 8.5, True), (10.5, 0.0, False), (0.0, 11.5, False)])
def test_mapping_car_drives_from_start_to_goal_within_10_m(late_m: float, early_m: float, taken: bool) -> None:
    assert is_mapping_car(car(late_m=late_m, early_m=early_m)) == taken


@pytest.mark.parametrize(("length_m", "taken"), [(6.9, True), (7.0, False)])
def test_vehicle_from_7_m_on_is_a_truck_and_no_mapping_car(length_m: float, taken: bool) -> None:
    assert is_mapping_car(car(length_m=length_m)) == taken
