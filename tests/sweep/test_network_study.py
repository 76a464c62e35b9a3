"""A study of a zone in a network: a sweep reports what a run reports, and its intervals are over pairs of simulations."""

import json
from pathlib import Path

import pytest
from placement.study_case import scenario_file
from sweep_trials import AtOnce, sweep

import wzsumo
from wzsumo.scenario.scenario import load_scenario
from wzsumo.sweep.results import read_results
from wzsumo.sweep.study_file import load_study
from wzsumo.sweep.summary import summarise

STUDY = """name = "street"
scenarios = ["{scenario}"]
methods = ["lanes"]
[grid]
seed = [3, 4]
"""


def test_sweep_in_a_network_gives_what_a_run_gives_and_an_interval_over_seeds(tmp_path: Path) -> None:
    scenario = scenario_file("placed")
    study = tmp_path / "study.toml"
    study.write_text(STUDY.format(scenario=scenario))
    sweep(load_study(study), tmp_path / "out", AtOnce())
    table = read_results(tmp_path / "out")
    assert table["status"].tolist() == ["DONE", "DONE"]
    wzsumo.run_case(load_scenario(scenario, seed=4), tmp_path / "run", methods=["lanes"])
    run = json.loads((tmp_path / "run" / "result.json").read_text())
    row = table.set_index("seed").loc[4]
    assert row["network_delay_h_change"] == pytest.approx(run["network"]["change"]["delay_h"])
    assert row["network_corridor_co2_kg_change"] == pytest.approx(run["network"]["change"]["corridor_co2_kg"])
    assert row["iou"] == pytest.approx(run["methods"]["lanes"]["iou"])
    summary = summarise(table, "network_mean_delay_s_change", by=[]).iloc[0]
    assert summary["n"] == 2
    assert summary["low"] <= summary["mean"] <= summary["high"]
