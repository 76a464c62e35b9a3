import json
import operator
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from sweep_trials import a_study, evaluate_cases, simulate, sweep

from wzsumo.errors import InputError, WorkersLostError
from wzsumo.sweep import cluster
from wzsumo.sweep import task_queue as engine
from wzsumo.sweep.cluster import ClusterWorkers
from wzsumo.sweep.results import read_results
from wzsumo.sweep.version import code_version

LIMIT_S = 60.0


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with running_cluster(tmp_path_factory.mktemp("cluster")) as (address, _):
        yield address


@contextmanager
def running_cluster(folder: Path) -> "Iterator[tuple[str, list[subprocess.Popen[bytes]]]]":
    """A Dask scheduler and two workers on this machine, as a user would start them; its address and the three processes."""
    file = folder / "scheduler.json"
    paths = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[1]), *sys.path[1:]])}
    run = [sys.executable, "-m"]
    scheduler = [*run, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    worker = [*run, "distributed.cli.dask_worker", "--no-nanny", "--nthreads", "1", "--no-dashboard"]
    with (folder / "log").open("w") as log:
        commands = [[*command, "--scheduler-file", str(file)] for command in (scheduler, worker, worker)]
        processes = [subprocess.Popen(command, stdout=log, stderr=log, cwd=folder, env=paths) for command in commands]
        try:
            yield wait_for(file, workers=2), processes
        finally:
            for process in reversed(processes):
                process.kill()
                process.wait()


def wait_for(file: Path, *, workers: int) -> str:
    from distributed import Client

    while not file.exists() or not file.read_text().endswith("}"):
        time.sleep(0.05)
    address = json.loads(file.read_text())["address"]
    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(workers, timeout=60)
    return address


def test_table_of_a_cluster_is_that_of_this_machine(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "simulate", simulate)
    monkeypatch.setattr(engine, "evaluate_cases", evaluate_cases)
    study = a_study(seed=[1, 2, 3], crowd__used=[1, 2])
    with ClusterWorkers(address, version=code_version) as workers:
        assert workers.count == 2
    summary, _ = sweep(study, tmp_path / "cluster", ClusterWorkers(address, version=code_version))
    sweep(study, tmp_path / "here")
    assert summary.n_done == 6
    tables = [(tmp_path / name / "results.parquet").read_bytes() for name in ("cluster", "here")]
    assert tables[0] == tables[1]


def test_task_that_raises_or_takes_too_long_is_known_by_its_future(address: str) -> None:
    with ClusterWorkers(address, version=code_version) as workers:
        assert workers.start(operator.mul, 6, 7, limit_s=LIMIT_S).result() == 42
        assert isinstance(workers.start(operator.truediv, 1, 0, limit_s=LIMIT_S).exception(), ZeroDivisionError)
        assert "took longer than 1 s" in str(workers.start(time.sleep, 3, limit_s=1.0).exception())


def test_worker_with_another_version_of_the_code_is_refused_by_name(address: str) -> None:
    with pytest.raises(InputError, match=r"worker tcp://.* has wzsumo .*, this is .*; install the same everywhere"):
        ClusterWorkers(address, version=lambda: str(os.getpid()))


def test_scheduler_that_goes_away_ends_the_sweep_in_one_line_and_keeps_what_was_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "simulate", simulate)
    monkeypatch.setattr(engine, "evaluate_cases", evaluate_cases)
    monkeypatch.setattr(cluster, "CONNECT_TIMEOUT_S", 2.0)
    with running_cluster(tmp_path) as (address, processes):
        study = a_study(seed=[1], crowd__used=list(range(1, 31)))
        workers = ClusterWorkers(address, version=code_version)
        start, begun = workers.start, []

        def start_and_lose(function: Any, *args: Any, limit_s: float) -> Any:
            begun.append(function.__name__)
            if len(begun) == 3:  # the simulation is done, and one batch is begun
                processes[0].kill()
                processes[0].wait()
            return start(function, *args, limit_s=limit_s)

        monkeypatch.setattr(workers, "start", start_and_lose)
        with pytest.raises(WorkersLostError, match="the scheduler no longer answers; what was finished is kept"):
            sweep(study, tmp_path / "out", workers)
    table = read_results(tmp_path / "out")
    assert not (table["status"] == "FAILED").any()
    summary, _ = sweep(study, tmp_path / "out")
    assert summary.n_done == 30


@pytest.mark.parametrize("address", ["nowhere", "tcp://127.0.0.1", "127.0.0.1:port"])
def test_address_that_is_none_is_refused_with_its_form(address: str) -> None:
    with pytest.raises(InputError, match=r"must be \[protocol://\]host:port"):
        ClusterWorkers(address, version=code_version)


def test_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wzsumo.sweep.cluster.CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(InputError, match=r"--scheduler tcp://127\.0\.0\.1:9: no Dask scheduler answers there"):
        ClusterWorkers("tcp://127.0.0.1:9", version=code_version)
