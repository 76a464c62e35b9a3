import os
import signal
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from worker_tasks import compile_a_kernel, divide, kill_self, read_a_temporary_file, start_a_program

from wzsumo.sweep.worker_process import WorkerProcess
from wzsumo.sweep.workers import LocalWorkers, TaskLost

LIMIT_S = 60.0


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in "ZX"  # one that has ended, and for which the system has not waited yet


@pytest.fixture(scope="module")
def workers() -> Iterator[LocalWorkers]:
    with LocalWorkers(1) as crew:
        yield crew


def test_a_task_gives_its_result_and_its_process_is_used_again(workers: LocalWorkers) -> None:
    pids = [workers.start(os.getpid, limit_s=LIMIT_S).result() for _ in range(2)]
    assert pids[0] == pids[1] != os.getpid()


def test_a_task_whose_process_is_killed_is_lost_and_the_next_one_is_not(workers: LocalWorkers) -> None:
    killed, after = workers.start(kill_self, limit_s=LIMIT_S), workers.start(divide, 6, 3, limit_s=LIMIT_S)
    assert isinstance(killed.exception(), TaskLost)
    assert "signal 9 (SIGKILL)" in str(killed.exception())
    assert after.result() == 2


def test_a_task_that_raises_is_lost_with_what_it_raised(workers: LocalWorkers) -> None:
    assert str(workers.start(divide, 1, 0, limit_s=LIMIT_S).exception()) == "ZeroDivisionError: division by zero"


def test_reason_names_no_temporary_file_so_that_reasons_can_be_counted(workers: LocalWorkers) -> None:
    reasons = {str(workers.start(read_a_temporary_file, limit_s=LIMIT_S).exception()) for _ in range(2)}
    assert reasons == {f"FileNotFoundError: [Errno 2] No such file or directory: '{tempfile.gettempdir()}'"}


def test_a_task_that_hangs_is_stopped_at_its_limit(workers: LocalWorkers) -> None:
    assert "took longer than 1 s" in str(workers.start(time.sleep, 600, limit_s=1.0).exception())
    assert workers.start(divide, 6, 3, limit_s=LIMIT_S).result() == 2


def test_processes_end_with_the_block_even_in_the_middle_of_a_task() -> None:
    with LocalWorkers(1) as crew:
        pid = crew.start(os.getpid, limit_s=LIMIT_S).result()
        crew.start(time.sleep, 600, limit_s=LIMIT_S)
    assert not alive(pid)


def test_what_a_task_has_started_has_ended_with_the_block() -> None:
    with LocalWorkers(1) as crew:
        pid = crew.start(start_a_program, limit_s=LIMIT_S).result()
        assert alive(pid)
    assert not alive(pid)


def test_what_a_task_has_started_ends_with_a_task_that_is_lost(workers: LocalWorkers) -> None:
    pid = workers.start(start_a_program, limit_s=LIMIT_S).result()
    assert isinstance(workers.start(kill_self, limit_s=LIMIT_S).exception(), TaskLost)
    assert not alive(pid)


def test_workers_say_once_that_they_compile(capfd: pytest.CaptureFixture[str]) -> None:
    with LocalWorkers(2, tells=True) as crew:
        futures = [crew.start(compile_a_kernel, number, limit_s=LIMIT_S) for number in range(6)]
        assert [future.result() for future in futures] == [1, 2, 3, 4, 5, 6]
    assert capfd.readouterr().err.count("compiling the kernels that this takes;") == 1
    with LocalWorkers(1) as crew:
        assert crew.start(compile_a_kernel, 1, limit_s=LIMIT_S).result() == 2
    assert capfd.readouterr().err == ""


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C acts as in a terminal; a shell's background jobs ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_signal_while_workers_end_leaves_no_folder_and_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    kill, pids = WorkerProcess.kill, []

    def kill_late(process: WorkerProcess) -> None:
        if threading.current_thread() is threading.main_thread():
            signal.raise_signal(signal.SIGINT)
        kill(process)

    monkeypatch.setattr(WorkerProcess, "kill", kill_late)
    with pytest.raises(KeyboardInterrupt), LocalWorkers(1) as crew:
        pids.append(crew.start(os.getpid, limit_s=LIMIT_S).result())
    assert list(tmp_path.iterdir()) == []
    assert not alive(pids[0])


@pytest.mark.usefixtures("ctrl_c")
def test_signal_while_workers_start_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    start = threading.Thread.start

    def start_late(thread: threading.Thread) -> None:
        start(thread)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(threading.Thread, "start", start_late)
    with pytest.raises(KeyboardInterrupt), LocalWorkers(1):
        pass
    assert list(tmp_path.iterdir()) == []
