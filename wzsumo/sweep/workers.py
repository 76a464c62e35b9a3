"""Workers: the interface of what runs a sweep's tasks. LocalWorkers: processes on this machine (for Dask see `cluster`).

Each local worker is a process with a pipe of its own. The process pools of the standard library share one queue: a process
that is killed while it holds the queue's lock blocks all others. Here a killed process costs only its own task.
"""

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any, Protocol, Self

from wzsumo.files.work_folder import work_folder
from wzsumo.sweep.compiling import compiling_told

Call = tuple[Callable[..., Any], tuple[Any, ...], float]  # function, arguments, time limit [s]
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class TaskLost(Exception):  # noqa: N818 - never raised here: it is the exception of a task's future
    """The task's process ended without a result, or took too long; the message says which."""


class Workers(Protocol):
    """What runs tasks, as a context manager: at its end all tasks that still run are stopped."""

    count: int

    def start(self, function: Callable[..., Any], *args: Any, limit_s: float) -> Future[Any]:
        """The future result of `function(*args)`; its exception is TaskLost or the one that the task raised."""

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None: ...


class LocalWorkers:
    """`count` processes on this machine. Each is started when it is first needed, and again after it is lost.

    Where `tells`, the first of them that compiles kernels says so on stderr.
    """

    def __init__(self, count: int, *, tells: bool = False) -> None:
        self.count, self._tells = count, tells
        self._tasks: SimpleQueue[tuple[Future[Any], Call] | None] = SimpleQueue()
        self._stopping = threading.Event()
        self._processes: list[_Process | None] = [None] * count
        # The temporary files of killed processes stay in this folder until the pool deletes it.
        self._at_end = ExitStack()
        self._scratch = str(self._at_end.enter_context(work_folder(Path(tempfile.gettempdir()))))
        self._threads = [threading.Thread(target=self._serve, args=(slot,), daemon=True) for slot in range(count)]

    def start(self, function: Callable[..., Any], *args: Any, limit_s: float) -> Future[Any]:
        """The future result of `function(*args)`; TaskLost where the call itself takes longer than `limit_s` seconds."""
        future: Future[Any] = Future()
        self._tasks.put((future, (function, args, limit_s)))
        return future

    def __enter__(self) -> Self:
        with _signals_blocked():  # threads and their processes inherit it, so that only the sweep itself reacts to Ctrl-C
            for thread in self._threads:
                thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._stopping.set()
        for _ in self._threads:
            self._tasks.put(None)
        for process in self._processes:
            if process is not None:
                process.kill()
        for thread in self._threads:
            thread.join()
        self._at_end.close()

    def _serve(self, slot: int) -> None:
        while (item := self._tasks.get()) is not None and not self._stopping.is_set():
            future, call = item
            process = self._processes[slot] or _Process(self._scratch, tells=self._tells)
            self._processes[slot] = process
            if self._stopping.is_set():  # checked once `__exit__` can see the process, so that one of the two threads kills it
                break
            done, answer = process.run(call)
            if done:
                future.set_result(answer)
            else:
                process.kill()
                self._processes[slot] = None
                future.set_exception(TaskLost(answer))
        if (last := self._processes[slot]) is not None:
            last.kill()


class _Process:
    """One worker process and the pipe to it. It leads a process group, to which what it starts, such as SUMO, belongs."""

    def __init__(self, scratch: str, *, tells: bool) -> None:
        spawn = multiprocessing.get_context(
            "spawn"
        )  # a forked process would inherit locks that other threads hold at that moment
        self._pipe, other_end = spawn.Pipe()
        self._process = spawn.Process(target=_run_calls, args=(other_end, scratch, tells), daemon=True)
        self._process.start()
        other_end.close()  # otherwise the pipe would stay open after the process has ended

    def run(self, call: Call) -> tuple[bool, Any]:
        """(True, result) or (False, why there is no result)."""
        function, args, limit_s = call
        try:
            self._pipe.send((function, args))
            if not self._pipe.poll(limit_s):
                return False, f"took longer than {limit_s:.0f} s and was stopped"
            done, answer = self._pipe.recv()
        except (EOFError, OSError):
            self._process.join()
            return False, _describe_end(self._process.exitcode)
        return done, answer

    def kill(self) -> None:
        """Kill the process and all that it started."""
        with suppress(ProcessLookupError):  # the process has not made its group yet, or the group has ended
            os.killpg(self._process.pid or 0, signal.SIGKILL)
        self._process.kill()
        self._process.join()


def _describe_end(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"its process was ended by signal {-exitcode} ({signal.Signals(-exitcode).name})"
    return f"its process ended with exit code {exitcode}"


def _run_calls(pipe: "Connection[Any, Any]", scratch: str, tells: bool) -> None:
    """Run the calls that come through the pipe until it closes. A call that raises ends the process."""
    os.setsid()
    tempfile.tempdir = scratch
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _silence_libraries()
    with compiling_told(lambda line: _say_once(line, scratch)) if tells else nullcontext():
        while True:
            try:
                function, args = pipe.recv()
            except EOFError:
                return
            with _ErrorsSent(pipe):
                pipe.send((True, function(*args)))


def _say_once(line: str, scratch: str) -> None:
    """Print a line on stderr, unless another process of this pool has printed one."""
    with suppress(FileExistsError):
        (Path(scratch) / "told").touch(exist_ok=False)
        sys.stderr.write(f"{line}\n")


def _silence_libraries() -> None:
    """Discard what libraries write to file descriptor 2, such as SUMO's warnings; Python's own stderr stays."""
    sys.stderr = os.fdopen(os.dup(2), "w", buffering=1)
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 2)


class _ErrorsSent:
    """Sends an exception's text through the pipe. The exception is raised on, so that stderr shows its traceback."""

    def __init__(self, pipe: "Connection[Any, Any]") -> None:
        self._pipe = pipe

    def __enter__(self) -> None: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is not None:
            self._pipe.send((False, f"{kind.__name__}: {error}"))


def _end_with_parent() -> None:
    """Kill this process and what it started once the process that started it has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os.killpg(0, signal.SIGKILL)


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Block SIGINT and SIGTERM for threads and processes that are started in the block; their libraries use one thread each."""
    for name in _ONE_THREAD:  # small matrices are slower with more threads, and every core has a process already
        os.environ.setdefault(name, "1")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
