"""Workers: the interface of what runs a sweep's tasks. LocalWorkers: processes on this machine (for Dask see `cluster`).

Each local worker is a process with a pipe of its own. The process pools of the standard library share one queue: a process
that is killed while it holds the queue's lock blocks all others. Here a killed process costs only its own task.
"""

import os
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any, Protocol, Self

from wzsumo.errors import uninterrupted
from wzsumo.files.work_folder import work_folder
from wzsumo.sweep.worker_process import Call, WorkerProcess

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
        self._processes: list[WorkerProcess | None] = [None] * count
        # The temporary files of killed processes stay in this folder until the pool deletes it.
        self._at_end = ExitStack()
        self._scratch = ""
        self._threads = [threading.Thread(target=self._serve, args=(slot,), daemon=True) for slot in range(count)]

    def start(self, function: Callable[..., Any], *args: Any, limit_s: float) -> Future[Any]:
        """The future result of `function(*args)`; TaskLost where the call itself takes longer than `limit_s` seconds."""
        future: Future[Any] = Future()
        self._tasks.put((future, (function, args, limit_s)))
        return future

    def __enter__(self) -> Self:
        try:
            with _signals_blocked():  # threads and their processes inherit it: only the sweep itself reacts to Ctrl-C
                self._scratch = str(self._at_end.enter_context(work_folder(Path(tempfile.gettempdir()))))
                for thread in self._threads:
                    thread.start()
        except BaseException:  # a signal that was blocked
            self._end()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._end()

    def _end(self) -> None:
        with uninterrupted():
            self._stopping.set()
            for _ in self._threads:
                self._tasks.put(None)
            for process in self._processes:
                if process is not None:
                    process.kill()
            for thread in self._threads:
                if thread.ident is not None:  # it was started
                    thread.join()
            self._at_end.close()

    def _serve(self, slot: int) -> None:
        while (item := self._tasks.get()) is not None and not self._stopping.is_set():
            future, call = item
            process = self._processes[slot] or WorkerProcess(self._scratch, tells=self._tells)
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
