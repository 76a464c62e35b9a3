"""One registration makes a map method known to command line, map of traces, studies, estimate and report."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces
from sweep_trials import a_study

from wzsumo.case.map_method import MadeMap, MapTask, TracesMethod
from wzsumo.case.methods import METHODS, register
from wzsumo.cli import main
from wzsumo.report.report import best_method
from wzsumo.sweep.estimate import estimate


@pytest.fixture(autouse=True)
def all_free() -> Iterator[None]:
    def make(_traces: pd.DataFrame, task: MapTask) -> MadeMap:
        return MadeMap(task.cells.with_p_occupied(np.zeros(task.cells.shape)), {"said": "all is free"})

    register(TracesMethod(name="all_free", title="everything is free", make=make, cpu_s=1000.0))
    yield
    del METHODS["all_free"]


@pytest.mark.parametrize("command", ["run", "map"])
def test_help_names_the_method(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    assert "all_free" in capsys.readouterr().out


def test_map_command_makes_the_map_and_tells_what_the_method_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    straight_traces([0.0, 0.1]).to_csv(tmp_path / "traces.csv", index=False)
    with pytest.raises(SystemExit) as ended:
        main(["map", str(tmp_path / "traces.csv"), "--out", str(tmp_path), "--method", "all_free", "--json"])
    assert ended.value.code == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["method"], figures["said"]) == ("all_free", "all is free")
    assert figures["free_m2"] == pytest.approx(120 * 20, rel=0.05)  # 10 m around the traces


def test_study_takes_the_method_and_its_estimate_the_methods_time() -> None:
    usual, costly = (estimate(a_study(methods=(name,), seed=[1, 2]), finished=()) for name in ("swept", "all_free"))
    assert costly.processor_s - usual.processor_s == pytest.approx(2 * (1000.0 - 0.5))


def test_report_counts_its_map_among_those_of_the_crowd() -> None:
    assert best_method({"hd_map": {"iou": 0.9}, "all_free": {"iou": 0.2}}) == "all_free"
