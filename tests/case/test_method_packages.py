"""Map methods of other packages: every process knows them, also the workers of a sweep."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sweep_trials import a_study, sweep

from wzsumo.case.map_method import MadeMap, MapTask, TracesMethod
from wzsumo.case.methods import METHODS, register
from wzsumo.errors import SpecError

MODULE = """
from wzsumo.case.map_method import MadeMap, TracesMethod

def make(traces, task):
    return MadeMap(task.cells.with_p_occupied(0.0 * task.cells.p_occupied), {})

toy = TracesMethod(name="toy", title="everything is free", make=make)
"""
IN_WORKER = """
import toy_tasks
from wzsumo.sweep.workers import LocalWorkers
with LocalWorkers(1) as workers:
    print(workers.start(toy_tasks.known_title, limit_s=60).result())
"""
CASE_ID = """
from sweep_trials import a_study
print(*(a_study(methods=(name,), seed=[1]).cases[0].id for name in ("swept", "toy")))
"""


@pytest.fixture
def packages(tmp_path: Path) -> Path:
    """A folder with an installed package of one map method."""
    (tmp_path / "toy_maps.py").write_text(MODULE)
    (tmp_path / "toy_tasks.py").write_text(
        "from wzsumo.case.methods import METHODS\ndef known_title():\n    return METHODS['toy'].title\n"
    )
    info = tmp_path / "toy_maps-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy-maps\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text("[wzsumo.map_methods]\ntoy = toy_maps:toy\n")
    return tmp_path


def python(program: str, packages: Path) -> "subprocess.CompletedProcess[str]":
    path = f"{packages}:{Path(__file__).parents[1]}"
    return subprocess.run(
        [sys.executable, "-c", program], env={"PYTHONPATH": path, "PATH": ""}, capture_output=True, text=True, check=False
    )


def test_workers_know_the_method_of_an_installed_package(packages: Path) -> None:
    done = python(IN_WORKER, packages)
    assert done.stdout == "everything is free\n", done.stderr


def test_editing_the_package_makes_new_cases_of_its_method_alone(packages: Path) -> None:
    swept, toy = python(CASE_ID, packages).stdout.split()
    (packages / "toy_maps.py").write_text(MODULE.replace("0.0 *", "0.1 *"))
    assert python(CASE_ID, packages).stdout.split()[0] == swept
    assert python(CASE_ID, packages).stdout.split()[1] != toy


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("toy = toy_maps:gone", "map method toy: toy_maps:gone cannot be loaded (AttributeError: "),
        ("toy = no_module:toy", "map method toy: no_module:toy cannot be loaded (ModuleNotFoundError: "),
        ("toy = toy_maps:make", "map method toy: toy_maps:make must be a MapMethod of this name"),
        ("other = toy_maps:toy", "map method other: toy_maps:toy must be a MapMethod of this name"),
    ],
)
def test_package_that_cannot_be_loaded_is_told_in_one_line(entry: str, reason: str, packages: Path) -> None:
    (packages / "toy_maps-1.2.dist-info" / "entry_points.txt").write_text(f"[wzsumo.map_methods]\n{entry}\n")
    done = python("from wzsumo.cli import main; main(['run', '--help'])", packages)
    assert done.returncode == 2
    assert done.stderr.startswith(f"wzsumo: {reason}")
    assert "mend or uninstall toy-maps 1.2" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.fixture
def by_hand() -> Iterator[str]:
    def make(_traces: pd.DataFrame, task: MapTask) -> MadeMap:
        return MadeMap(task.cells.with_p_occupied(np.zeros(task.cells.shape)), {})

    register(TracesMethod(name="by_hand", title="everything is free", make=make))
    yield "by_hand"
    del METHODS["by_hand"]


def test_sweep_refuses_a_method_that_its_workers_do_not_know(by_hand: str, tmp_path: Path) -> None:
    with pytest.raises(
        SpecError, match=f"method {by_hand}: registered by this program.*entry point of the group wzsumo.map_meth"
    ):
        sweep(a_study(methods=(by_hand,)), tmp_path / "out")
    assert not (tmp_path / "out").exists()
