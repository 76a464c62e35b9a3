import doctest
import math
import subprocess
import sys
from types import ModuleType

import pandas as pd
import pytest

import wzsumo
from wzsumo import api as interface
from wzsumo.errors import InputError


@pytest.mark.parametrize("module", [wzsumo, interface], ids=lambda module: module.__name__)
def test_examples_in_docstrings_give_what_they_say(module: ModuleType) -> None:
    result = doctest.testmod(module)
    assert result.attempted > 2
    assert result.failed == 0


def test_every_name_that_the_package_offers_is_there_and_described() -> None:
    assert set(wzsumo.__all__) <= set(dir(wzsumo))
    for name in wzsumo.__all__:
        assert getattr(wzsumo, name).__doc__, name


def test_name_that_the_package_has_not_is_refused_with_those_it_has() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'sweeep'; it has .*run_case"):
        _ = wzsumo.sweeep


def test_import_of_the_package_takes_less_than_a_twentieth_of_its_parts() -> None:
    """Counted in modules, which do not depend on the load of the machine."""
    code = "import sys; before = len(sys.modules); import wzsumo; print(len(sys.modules) - before)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 50


def test_table_that_is_no_trace_table_is_refused() -> None:
    with pytest.raises(InputError, match="y_m"):
        wzsumo.build_map(pd.DataFrame({"vehicle_id": ["a"], "time_s": [0.0], "x_m": [1.0]}), seed=1)


@pytest.mark.parametrize("resolution_m", [0.0, -1.0, 10.5, float("nan")])
def test_map_with_a_resolution_that_no_cell_can_have_is_refused(resolution_m: float) -> None:
    traces = pd.DataFrame({"vehicle_id": "a", "time_s": [0.0, 1.0], "x_m": [0.0, 20.0], "y_m": 0.0})
    with pytest.raises(InputError, match=r"resolution_m=.* must be above 0 and at most 10 m"):
        wzsumo.build_map(traces, resolution_m=resolution_m)


def test_plan_takes_degrees_as_the_command_line_does() -> None:
    grid = wzsumo.blank_grid((-60, -60, 60, 60), resolution=0.5, p_occupied=0.0)
    northwards = wzsumo.plan(grid, start_xy_deg=(0, -30, 90), goal_xy_deg=(0, 30, 90))
    assert northwards.path is not None
    assert northwards.path.arc_length[-1] == pytest.approx(60, abs=0.5)
    assert northwards.path.poses[:, 2] == pytest.approx(math.pi / 2, abs=1e-3)
