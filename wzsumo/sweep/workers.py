"""Workers that carry out a sweep's tasks: what any of them do, and the processes of this machine (for Dask see `cluster`).

A local worker is one process with a pipe of its own. The pools of the standard library share one queue, and a process that
is killed while it holds the queue's lock stops them all; here it costs its own task, whatever moment it dies at.
"""

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any, Protocol, Self

Task = tuple[Callable[..., Any], tuple[Any, ...], float]  # function, arguments, longest time [s]
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class TaskLost(Exception):  # noqa: N818 - nobody raises it; it says in a future what became of a task
    """A task whose process ended before its result, or took too long; the message says which."""


class Workers(Protocol):
    """What carries out tasks. Used as a context: at its end whatever still runs is stopped."""

    count: int

    def start(self, function: Callable[..., Any], *args: Any, limit_s: float) -> Future[Any]:
        """The future result. Its exception says what went wrong: TaskLost, or the task's own."""

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None: ...


class LocalWorkers:
    """`count` processes of this machine, started when first needed and again after one is lost."""

    def __init__(self, count: int) -> None:
        self.count = count
        self._tasks: SimpleQueue[tuple[Future[Any], Task] | None] = SimpleQueue()
        self._stopping = threading.Event()
        self._processes: list[_Process | None] = [None] * count
        # A process that is killed leaves its temporary files; these go with the pool.
        self._scratch = tempfile.TemporaryDirectory(prefix="wzsumo-", ignore_cleanup_errors=True)
        self._threads = [threading.Thread(target=self._serve, args=(slot,), daemon=True) for slot in range(count)]

    def start(self, function: Callable[..., Any], *args: Any, limit_s: float) -> Future[Any]:
        """The future result of `function(*args)`, lost after `limit_s` seconds of its own."""
        future: Future[Any] = Future()
        self._tasks.put((future, (function, args, limit_s)))
        return future

    def __enter__(self) -> Self:
        with _interrupts_held():  # threads and their processes inherit it: Ctrl-C is the sweep's to answer, not theirs
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
        self._scratch.cleanup()

    def _serve(self, slot: int) -> None:
        while (item := self._tasks.get()) is not None and not self._stopping.is_set():
            future, task = item
            process = self._processes[slot] or _Process(self._scratch.name)
            self._processes[slot] = process
            if self._stopping.is_set():  # asked after the process can be seen, so that one of the two threads ends it
                break
            done, answer = process.carry_out(task)
            if done:
                future.set_result(answer)
            else:
                process.kill()
                self._processes[slot] = None
                future.set_exception(TaskLost(answer))
        if (last := self._processes[slot]) is not None:
            last.kill()


class _Process:
    """One process, the pipe to it, and with it the group of what it starts, such as SUMO."""

    def __init__(self, scratch: str) -> None:
        spawn = multiprocessing.get_context("spawn")  # a fork would copy the threads' locks as they happen to be
        self._pipe, theirs = spawn.Pipe()
        self._process = spawn.Process(target=_work, args=(theirs, scratch), daemon=True)
        self._process.start()
        theirs.close()  # else the pipe would not end with the process

    def carry_out(self, task: Task) -> tuple[bool, Any]:
        """(True, result) or (False, what became of the task)."""
        function, args, limit_s = task
        try:
            self._pipe.send((function, args))
            if not self._pipe.poll(limit_s):
                return False, f"took longer than {limit_s:.0f} s and was stopped"
            done, answer = self._pipe.recv()
        except (EOFError, OSError):
            self._process.join()
            return False, _ending(self._process.exitcode)
        return done, answer

    def kill(self) -> None:
        with suppress(ProcessLookupError):  # it has not come so far as to have a group, or its group has ended
            os.killpg(self._process.pid or 0, signal.SIGKILL)
        self._process.kill()
        self._process.join()


def _ending(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"its process was ended by signal {-exitcode} ({signal.Signals(-exitcode).name})"
    return f"its process ended with exit code {exitcode}"


def _work(pipe: "Connection[Any, Any]", scratch: str) -> None:
    """Carry out what comes through the pipe until it ends. A task that raises ends the process: the next one starts clean."""
    os.setsid()
    tempfile.tempdir = scratch
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _hush_libraries()
    while True:
        try:
            function, args = pipe.recv()
        except EOFError:
            return
        with _Telling(pipe):
            pipe.send((True, function(*args)))


def _hush_libraries() -> None:
    """SUMO writes warnings of every vehicle straight to file descriptor 2; only what Python says goes on to stderr."""
    sys.stderr = os.fdopen(os.dup(2), "w", buffering=1)
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 2)


class _Telling:
    """Tells through the pipe what was raised; it goes on being raised, and so lands on stderr with its traceback."""

    def __init__(self, pipe: "Connection[Any, Any]") -> None:
        self._pipe = pipe

    def __enter__(self) -> None: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is not None:
            self._pipe.send((False, f"{kind.__name__}: {error}"))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os.killpg(0, signal.SIGKILL)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    for name in _ONE_THREAD:  # small matrices are slower with more, and every process has a core
        os.environ.setdefault(name, "1")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
