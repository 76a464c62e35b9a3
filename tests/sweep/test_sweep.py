import resource
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from sweep_trials import FLEET, AtOnce, a_study, evaluate_cases, simulate, sweep

from wzsumo.errors import InputError, OutputError
from wzsumo.scenario.scenario import Scenario
from wzsumo.sweep import task_queue as engine
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.results import column_of, read_results
from wzsumo.sweep.store import read_study


@pytest.fixture(autouse=True)
def quick_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "simulate", simulate)
    monkeypatch.setattr(engine, "evaluate_cases", evaluate_cases)


def test_sweep_simulates_each_fleet_once_and_gives_a_row_a_case_in_the_order_of_the_study(tmp_path: Path) -> None:
    study, workers = a_study(seed=[1, 2, 3], crowd__used=list(range(1, 21)), crowd__collected=[20]), AtOnce()
    summary, _ = sweep(study, tmp_path, workers)
    assert Counter(name for name, _ in workers.started)["simulate"] == 3
    assert (summary.n_cases, summary.n_done, summary.n_found, summary.n_simulations) == (60, 60, 0, 3)
    table = read_results(tmp_path)
    assert table["case"].tolist() == [case.id for case in study.cases]
    assert table["crowd.used"].tolist() == list(range(1, 21)) * 3
    assert table["iou"].tolist() == pytest.approx([0.01] * 20 + [0.02] * 20 + [0.03] * 20)
    assert table.attrs["factors"] == ["seed", "crowd.used", "crowd.collected"]


def test_cases_of_one_crowd_go_to_one_task_and_a_task_holds_about_a_batch(tmp_path: Path) -> None:
    study, workers = a_study(methods=("swept", "lanes", "paper"), crowd__used=list(range(1, 26))), AtOnce()
    sweep(study, tmp_path, workers)
    batches = [args[1] for name, args in workers.started if name == "evaluate_cases"]
    assert all(len(batch) < 32 + 3 for batch in batches)
    crowds = [{case.source for case in batch} for batch in batches]
    assert sum(map(len, crowds)) == len(set().union(*crowds)) == 25


def test_last_tasks_are_small_so_that_no_worker_waits_long_for_another(tmp_path: Path) -> None:
    study, workers = a_study(crowd__used=list(range(1, 41)), gnss__error_m=[0.0, 1.0, 2.0]), AtOnce()
    sweep(study, tmp_path, workers)
    sizes = [len(args[1]) for name, args in workers.started if name == "evaluate_cases"]
    assert sum(sizes) == 120
    assert sizes == sorted(sizes, reverse=True)
    assert max(sizes) > 2 * 4
    assert sum(sizes[-3:]) <= 3 * 4


def test_next_fleet_is_simulated_while_cases_of_the_one_before_are_left(tmp_path: Path) -> None:
    study, workers = a_study(seed=[1, 2, 3, 4], crowd__used=list(range(1, 31))), AtOnce()
    sweep(study, tmp_path, workers)
    order = [name for name, _ in workers.started]
    last = [at for at, name in enumerate(order) if name == "simulate"][3]  # the first three begin at once
    handed_out = sum(len(args[1]) for name, args in workers.started[:last] if name == "evaluate_cases")
    assert handed_out < 60


def test_second_sweep_does_nothing_and_a_wider_one_only_what_is_missing(tmp_path: Path) -> None:
    sweep(a_study(seed=[1, 2]), tmp_path)
    before = (tmp_path / "results.parquet").read_bytes()
    workers = AtOnce()
    summary, _ = sweep(a_study(seed=[1, 2]), tmp_path, workers)
    assert (summary.n_found, summary.n_done, workers.started) == (2, 2, [])
    assert (tmp_path / "results.parquet").read_bytes() == before
    summary, _ = sweep(a_study(seed=[1, 2, 3]), tmp_path, workers)
    assert [(name, args[0].seed) for name, args in workers.started if name == "simulate"] == [("simulate", 3)]
    assert read_results(tmp_path)["seed"].tolist() == [1, 2, 3]


def test_case_that_fails_whenever_it_runs_is_lost_alone_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails_at_4(fleet: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
        if any(case.scenario.crowd.used == 4 for case in cases):
            raise RuntimeError("four is too much")
        return evaluate_cases(fleet, cases)

    monkeypatch.setattr(engine, "evaluate_cases", fails_at_4)
    study = a_study(crowd__used=list(range(1, 9)))
    summary, _ = sweep(study, tmp_path)
    assert (summary.n_done, summary.n_failed, dict(summary.failures)) == (7, 1, {"four is too much": 1})
    failed = read_results(tmp_path).query("status == 'FAILED'")
    assert failed[["crowd.used", "reason"]].to_numpy().tolist() == [[4, "four is too much"]]
    monkeypatch.setattr(engine, "evaluate_cases", evaluate_cases)
    again, _ = sweep(study, tmp_path)
    assert (again.n_found, again.n_done, again.n_failed) == (7, 8, 0)


def test_simulation_that_fails_once_is_tried_again_and_costs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tries = []

    def fails_first(scenario: Scenario) -> bytes:
        tries.append(scenario.seed)
        if tries.count(1) == 1 and scenario.seed == 1:
            raise RuntimeError("lost")
        return FLEET

    monkeypatch.setattr(engine, "simulate", fails_first)
    summary, _ = sweep(a_study(seed=[1, 2]), tmp_path)
    assert (summary.n_done, summary.n_failed, sorted(tries)) == (2, 0, [1, 1, 2])


def test_simulation_that_fails_twice_costs_its_cases_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails_for_1(scenario: Scenario) -> bytes:
        if scenario.seed == 1:
            raise RuntimeError("no road")
        return FLEET

    monkeypatch.setattr(engine, "simulate", fails_for_1)
    summary, _ = sweep(a_study(seed=[1, 2], crowd__used=[2, 3]), tmp_path)
    assert (summary.n_done, summary.n_failed) == (2, 2)
    table = read_results(tmp_path)
    assert table.loc[table["seed"] == 1, "reason"].tolist() == ["simulation: no road"] * 2
    assert table["status"].tolist() == ["FAILED", "FAILED", "DONE", "DONE"]


@pytest.mark.parametrize(
    "damage", [lambda data: data[: len(data) // 2], lambda data: data[:100] + b"\xff" + data[101:], lambda _data: b""]
)
def test_damaged_batch_is_named_put_aside_and_done_again(tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    study = a_study(seed=[1, 2])
    sweep(study, tmp_path)
    whole = (tmp_path / "results.parquet").read_bytes()
    batch = next((tmp_path / "batches").glob("*.parquet"))
    batch.write_bytes(damage(batch.read_bytes()))
    summary, lines = sweep(study, tmp_path)
    assert summary.n_found == 1
    assert any(str(batch) in line and "damaged" in line for line in lines)
    assert (tmp_path / "results.parquet").read_bytes() == whole
    assert batch.with_suffix(".damaged").exists()


def test_damaged_or_missing_fleet_is_simulated_again(tmp_path: Path) -> None:
    sweep(a_study(seed=[1]), tmp_path)
    fleet = next((tmp_path / "simulations").glob("*.parquet"))
    fleet.write_bytes(fleet.read_bytes()[:-7])
    workers = AtOnce()
    sweep(a_study(seed=[1], crowd__used=[3]), tmp_path, workers)
    assert [name for name, _ in workers.started] == ["simulate", "evaluate_cases"]


def test_fleets_beyond_the_limit_go_and_finished_cases_stay(tmp_path: Path) -> None:
    limit = 2.5 * len(FLEET) / 1e6
    sweep(a_study(seed=[1, 2, 3, 4]), tmp_path, cache_limit_mb=limit)
    assert len(list((tmp_path / "simulations").glob("*.parquet"))) == 2
    assert len(read_results(tmp_path)) == 4


def test_what_a_kill_left_half_written_is_cleared_away_and_nothing_else(tmp_path: Path) -> None:
    """A killed `wzsumo run --case` leaves its folder below cases/, to which other results belong."""
    sweep(a_study(seed=[1]), tmp_path)
    left = [tmp_path / "batches" / f".wzsumo-unfinished-{1:016x}", tmp_path / f".wzsumo-unfinished-{2:016x}"]
    of_case = tmp_path / "cases" / "abc" / f".wzsumo-unfinished-{3:016x}"
    for folder in (*left, of_case, tmp_path / ".unfinished-thesis"):
        folder.mkdir(parents=True)
        (folder / "half").write_text("half")
    (tmp_path / "batches" / ".unfinished-mine.txt").write_text("mine")
    summary, _ = sweep(a_study(seed=[1, 2]), tmp_path)
    assert (summary.n_found, summary.n_done) == (1, 2)
    assert not any(folder.exists() for folder in left)
    assert (of_case / "half").exists()  # the next run of that case removes it
    assert (tmp_path / ".unfinished-thesis" / "half").exists()
    assert (tmp_path / "batches" / ".unfinished-mine.txt").exists()


@pytest.mark.parametrize("name", ["batches", "simulations", ".lock", "study.json"])
def test_link_in_a_studys_folder_is_not_written_through(tmp_path: Path, name: str) -> None:
    (tmp_path / "out").mkdir()
    target = tmp_path / "elsewhere"
    target.mkdir() if name in {"batches", "simulations"} else target.write_text("precious")
    (tmp_path / "out" / name).symlink_to(target)
    if name == "study.json":  # it is read as the manifest of the folder
        target.unlink()
        sweep(a_study(seed=[1]), tmp_path / "out")
        assert not target.exists()
        return
    with pytest.raises(OutputError, match=r"link|symbolic"):
        sweep(a_study(seed=[1]), tmp_path / "out")
    assert list(target.iterdir()) == [] if target.is_dir() else target.read_text() == "precious"


def test_interrupt_keeps_what_was_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    finished: list[list[str]] = []

    def interrupted_at_third(fleet: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
        if len(finished) == 2:  # both are settled before a third begins where two go at a time
            raise KeyboardInterrupt
        finished.append([case.id for case in cases])
        return evaluate_cases(fleet, cases)

    monkeypatch.setattr(engine, "evaluate_cases", interrupted_at_third)
    with pytest.raises(KeyboardInterrupt):
        sweep(a_study(crowd__used=list(range(1, 41)), seed=[1]), tmp_path, AtOnce(count=1))
    assert set(read_results(tmp_path)["case"]) == set().union(*finished)
    assert len(finished) == 2


def test_folder_of_another_study_or_of_a_run_is_refused(tmp_path: Path) -> None:
    sweep(a_study(), tmp_path / "a")
    with pytest.raises(OutputError, match=r"holds the results of the study 'trial', not of 'other'"):
        sweep(a_study(name="other"), tmp_path / "a")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "result.json").write_text("{}")
    with pytest.raises(OutputError, match=r"holds the result of a `wzsumo run`"):
        sweep(a_study(), tmp_path / "b")


def test_folder_of_another_format_is_refused_and_not_touched(tmp_path: Path) -> None:
    sweep(a_study(), tmp_path)
    manifest = tmp_path / "study.json"
    manifest.write_text(manifest.read_text().replace('"format": 1', '"format": 0'))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(OutputError, match=r"another version of wzsumo \(format 0, this one reads 1\)"):
        sweep(a_study(), tmp_path)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_results_of_an_older_method_are_not_taken_for_new_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wzsumo.sweep.evaluation.study_case.code_version", lambda: "0.0.9")
    sweep(a_study(seed=[1]), tmp_path)
    monkeypatch.undo()
    monkeypatch.setattr(engine, "simulate", simulate)
    monkeypatch.setattr(engine, "evaluate_cases", evaluate_cases)
    summary, _ = sweep(a_study(seed=[1]), tmp_path)
    assert (summary.n_found, summary.n_done) == (0, 1)
    assert len(read_results(tmp_path)) == 1


def test_folder_in_use_is_refused(tmp_path: Path) -> None:
    class Nested(AtOnce):
        def start(self, function: Callable[..., Any], *args: Any, limit_s: float) -> Future[Any]:
            with pytest.raises(OutputError, match="another command is writing there"):
                sweep(a_study(), tmp_path)
            return super().start(function, *args, limit_s=limit_s)

    sweep(a_study(), tmp_path, Nested())


def test_full_disk_is_named_and_costs_only_what_could_not_be_written(tmp_path: Path) -> None:
    """A limit on the size of files is the full disk that a test can have: the system refuses the write."""
    sweep(a_study(seed=[1]), tmp_path)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, hard))
    try:
        with pytest.raises(OutputError, match="a file would be too large; what was there stays: make room"):
            sweep(a_study(seed=[1, 2]), tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not list(tmp_path.rglob(".wzsumo-unfinished-*"))
    summary, _ = sweep(a_study(seed=[1, 2]), tmp_path)
    assert (summary.n_found, summary.n_done) == (1, 2)


def test_study_of_a_folder_is_the_one_that_was_swept(tmp_path: Path) -> None:
    study = a_study(seed=[1, 2], crowd__used=[3])
    sweep(study, tmp_path)
    assert [case.id for case in read_study(tmp_path).cases] == [case.id for case in study.cases]


def test_folder_without_results_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no results\.parquet"):
        read_results(tmp_path)
    (tmp_path / "results.parquet").write_bytes(b"PAR1")
    with pytest.raises(InputError, match=r"results\.parquet: cannot be read"):
        read_results(tmp_path)


def test_every_column_is_described_in_the_documentation_with_its_unit(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "guide" / "studies.md").read_text()
    sweep(a_study(crowd__used=[1]), tmp_path)
    for name in read_results(tmp_path).columns.drop("crowd.used"):
        column = column_of(name)
        assert f"| `{name}` | {column.unit if column.unit != '1' else ''} | {column.meaning} |" in page
