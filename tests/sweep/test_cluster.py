import json
import operator
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from sweep_trials import a_study, evaluate_cases, simulate, sweep

from wzsumo.errors import InputError
from wzsumo.sweep import task_queue as engine
from wzsumo.sweep.cluster import ClusterWorkers
from wzsumo.sweep.version import code_version

LIMIT_S = 60.0


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A Dask scheduler and two workers on this machine, as a user would start them."""
    folder = tmp_path_factory.mktemp("cluster")
    file = folder / "scheduler.json"
    paths = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[1]), *sys.path[1:]])}
    run = [sys.executable, "-m"]
    scheduler = [*run, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    worker = [*run, "distributed.cli.dask_worker", "--no-nanny", "--nthreads", "1", "--no-dashboard"]
    with (folder / "log").open("w") as log:
        commands = [[*command, "--scheduler-file", str(file)] for command in (scheduler, worker, worker)]
        processes = [subprocess.Popen(command, stdout=log, stderr=log, cwd=folder, env=paths) for command in commands]
        try:
            yield wait_for(file, workers=2)
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


@pytest.mark.parametrize("address", ["nowhere", "tcp://127.0.0.1", "127.0.0.1:port"])
def test_address_that_is_none_is_refused_with_its_form(address: str) -> None:
    with pytest.raises(InputError, match=r"must be \[protocol://\]host:port"):
        ClusterWorkers(address, version=code_version)


def test_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wzsumo.sweep.cluster.CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(InputError, match=r"--scheduler tcp://127\.0\.0\.1:9: no Dask scheduler answers there"):
        ClusterWorkers("tcp://127.0.0.1:9", version=code_version)
