import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from sweep_trials import PAPER, AtOnce, a_study, evaluate_cases, simulate, sweep

from wzsumo.cli import main
from wzsumo.commands import sweep as sweep_verbs
from wzsumo.scenario.scenario import Scenario
from wzsumo.sweep import task_queue as engine
from wzsumo.sweep.estimate import estimate, n_cases_lacking_traces
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.study_file import Study


@pytest.fixture(autouse=True)
def quick_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "simulate", simulate)
    monkeypatch.setattr(engine, "evaluate_cases", evaluate_cases)
    monkeypatch.setattr(sweep_verbs, "LocalWorkers", AtOnce)


@pytest.fixture
def study_file(tmp_path: Path) -> Path:
    head = f'name = "trial"\nscenarios = ["{PAPER}"]\nmethods = ["swept", "lanes"]\n'
    path = tmp_path / "study.toml"
    path.write_text(head + "[grid]\nseed = [1, 2, 3]\ncrowd.used = [2, 5]\n")
    return path


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """(exit code, stdout, stderr) of one command."""
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in words])
    out = capsys.readouterr()
    return int(stopped.value.code or 0), out.out, out.err


def test_dry_run_counts_cases_and_simulations_and_writes_nothing(
    study_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    code, text, _ = run(capsys, "sweep", study_file, "--out", out, "--dry-run", "--workers", 2, "--json")
    figures = json.loads(text)
    assert (code, figures["n_cases"], figures["n_missing"], figures["n_simulations"]) == (0, 12, 12, 3)
    assert figures["about_s"] > 0
    assert not out.exists()
    run(capsys, "sweep", study_file, "--out", out)
    _, text, _ = run(capsys, "sweep", study_file, "--out", out, "--dry-run", "--json")
    assert json.loads(text)["n_missing"] == 0


def test_cases_that_ask_for_more_traces_than_will_pass_are_foreseen(
    study_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of 1,500 veh/h for 900 s some 350 vehicles pass, of which 5 % are 17 and 50 % are 175."""
    text = study_file.read_text().replace("crowd.used = [2, 5]", "crowd.used = [5, 100]\ncrowd.penetration = [0.05, 0.5]")
    study_file.write_text(text)
    _, out, err = run(capsys, "sweep", study_file, "--out", tmp_path / "out", "--dry-run")
    assert err.startswith("6 of 24 cases ask for more traces (crowd.used) than equipped vehicles")
    assert out.startswith("24 cases, 24 of them missing, in 3 simulations: some ")
    _, _, err = run(capsys, "sweep", study_file, "--out", tmp_path / "out", "--dry-run", "--quiet")
    assert err == ""


def test_estimate_counts_a_simulation_once_and_a_map_once_for_all_penetration_rates() -> None:
    def seconds(**grid: Any) -> float:
        return estimate(a_study(**grid), finished=()).processor_s

    one = seconds(seed=[1])
    assert seconds(seed=[1, 2]) == pytest.approx(2 * one, abs=0.2)
    assert seconds(seed=[1], crowd__penetration=[0.1, 0.2, 0.3]) == one
    assert one < seconds(seed=[1], crowd__used=[2, 3]) < 2 * one


@pytest.mark.parametrize("of_study", [lambda study: estimate(study, finished=()), n_cases_lacking_traces])
def test_more_seeds_and_crowds_lay_out_no_more_zones(
    of_study: Callable[[Study], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """To lay out a zone takes milliseconds: a study of 10,000 seeds took minutes before its first word."""
    laid_out: list[int] = []
    layout = Scenario.layout

    def counted(scenario: Scenario) -> object:
        laid_out.append(scenario.seed)
        return layout(scenario)

    flows = [700, 1000]
    few = a_study(simulation__demand__flow_vph=flows, seed=[1])
    many = a_study(
        simulation__demand__flow_vph=flows, seed=list(range(1, 9)), crowd__used=[2, 3], crowd__penetration=[0.1, 0.2]
    )
    monkeypatch.setattr(Scenario, "layout", counted)
    of_study(few)
    for_few = len(laid_out)
    of_study(many)
    assert for_few == len(flows)
    assert len(laid_out) == 2 * for_few


def test_sweep_tells_how_far_it_is_in_plain_lines_where_there_is_no_terminal(
    study_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, text, err = run(capsys, "sweep", study_file, "--out", tmp_path / "out", "--workers", 2, "--json")
    assert (code, json.loads(text)["n_done"]) == (0, 12)
    assert re.search(r"wzsumo: 0 of 12 cases finished\n(.*\n)*wzsumo: 12 of 12 cases finished", err)
    assert "\r" not in err


def test_interrupted_sweep_ends_with_130_and_says_that_what_was_finished_is_kept(
    study_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_fleet: bytes, _cases: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(engine, "evaluate_cases", interrupted)
    code, _, err = run(capsys, "sweep", study_file, "--out", tmp_path / "out")
    assert code == 130
    assert "what was finished is kept" in err


def test_reason_of_lost_cases_is_told_on_stderr(
    study_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(_scenario: object) -> None:
        raise RuntimeError("no netconvert")

    monkeypatch.setattr(engine, "simulate", lost)
    code, text, err = run(capsys, "sweep", study_file, "--out", tmp_path / "out", "--json")
    assert (code, json.loads(text)["n_failed"]) == (1, 12)
    assert "wzsumo: 12 case(s) failed twice: simulation: no netconvert" in err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--case", "zzz"], "has no such case"),
        (["--case", ""], "has no such case"),
        (["--case", "a", "--seed", "3"], "leave --seed and --method out"),
    ],
)
def test_case_that_cannot_be_run_alone_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    sweep(a_study(), tmp_path / "study")
    code, _, err = run(capsys, "run", tmp_path / "study", *words, "--out", tmp_path / "out")
    assert code == 2
    assert says in err
    assert not (tmp_path / "out").exists()


def test_beginning_that_several_cases_share_is_refused_with_two_of_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = a_study(crowd__used=list(range(1, 20)))  # more than the sixteen digits that a name can begin with
    sweep(study, tmp_path / "study")
    firsts = [case.id[0] for case in study.cases]
    shared = next(first for first in firsts if firsts.count(first) > 1)
    code, _, err = run(capsys, "run", tmp_path / "study", "--case", shared, "--out", tmp_path / "out")
    assert code == 2
    assert f"{firsts.count(shared)} cases begin so" in err


def test_sweep_whose_cases_fail_ends_with_1_and_says_that_they_can_be_tried_again(
    study_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(fleet: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
        if any(case.scenario.crowd.used == 5 for case in cases):
            raise RuntimeError("lost")
        return evaluate_cases(fleet, cases)

    monkeypatch.setattr(engine, "evaluate_cases", fails)
    code, text, err = run(capsys, "sweep", study_file, "--out", tmp_path / "out", "--json")
    assert (code, json.loads(text)["n_failed"], json.loads(text)["n_done"]) == (1, 6, 6)
    assert err.splitlines()[-1].startswith("wzsumo: 6 of 12 cases failed; the same command tries them again")
    monkeypatch.setattr(engine, "evaluate_cases", evaluate_cases)
    assert run(capsys, "sweep", study_file, "--out", tmp_path / "out")[0] == 0


def test_sweep_all_of_whose_cases_fail_ends_with_1_and_does_not_advise_a_report(
    study_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_fleet: bytes, _cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
        raise RuntimeError("lost")

    monkeypatch.setattr(engine, "evaluate_cases", fails)
    code, text, err = run(capsys, "sweep", study_file, "--out", tmp_path / "out")
    assert (code, "next:" in text) == (1, False)
    assert err.splitlines()[-1].startswith("wzsumo: 12 of 12 cases failed; the same command tries them again")
    code, _, err = run(capsys, "report", tmp_path / "out")
    assert (code, err.count("\n")) == (2, 1)
    monkeypatch.setattr(engine, "evaluate_cases", evaluate_cases)
    code, text, _ = run(capsys, "sweep", study_file, "--out", tmp_path / "out")
    assert (code, "next: wzsumo report" in text) == (0, True)


def test_sweep_without_a_possible_case_ends_with_2_and_the_reason(
    study_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(_fleet: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
        return [{"case": case.id, "status": "REFUSED", "reason": "no traffic"} for case in cases]

    monkeypatch.setattr(engine, "evaluate_cases", refused)
    code, _, err = run(capsys, "sweep", study_file, "--out", tmp_path / "out")
    assert code == 2
    assert err.splitlines()[-1].endswith("none of its 12 cases is possible, the first because: no traffic")
