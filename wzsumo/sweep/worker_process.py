"""A process of a local worker: `WorkerProcess` is the sweep's end of it, `run_calls` what runs in it.

It is started as any program is, not by multiprocessing: that starts a tracker of resources, too, which outlives the command.
"""

import multiprocessing
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import nullcontext, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Any

from wzsumo.sweep.compiling import compiling_told

Call = tuple[Callable[..., Any], tuple[Any, ...], float]  # function, arguments, time limit [s]
_PROGRAM = "import sys; sys.path[:] = {path}; from {module} import run_calls; run_calls({pipe}, {alive}, {scratch}, {tells})"
_GROUP_END_S = 10.0  # for processes that were killed; they need some ms, more where the machine is busy
_LOOK_AGAIN_S = 0.002


class WorkerProcess:
    """One worker process and the pipe to it. It leads a process group, to which what it starts, such as SUMO, belongs."""

    def __init__(self, scratch: str, *, tells: bool) -> None:
        self._pipe, its_pipe = multiprocessing.Pipe()
        its_alive, self._alive = multiprocessing.Pipe(duplex=False)  # the process sees it close once this one has ended
        handles = (its_pipe.fileno(), its_alive.fileno())
        program = _PROGRAM.format(
            path=ascii(sys.path), module=__name__, pipe=handles[0], alive=handles[1], scratch=ascii(scratch), tells=tells
        )
        self._process = subprocess.Popen(
            [sys.executable, "-c", program], stdin=subprocess.DEVNULL, pass_fds=handles, start_new_session=True
        )
        its_pipe.close()  # otherwise the pipe would stay open after the process has ended
        its_alive.close()

    def run(self, call: Call) -> tuple[bool, Any]:
        """(True, result) or (False, why there is no result)."""
        function, args, limit_s = call
        try:
            self._pipe.send((function, args))
            if not self._pipe.poll(limit_s):
                return False, f"took longer than {limit_s:.0f} s and was stopped"
            done, answer = self._pipe.recv()
        except (EOFError, OSError):
            return False, _describe_end(self._process.wait())
        return done, answer

    def kill(self) -> None:
        """Kill the process and all that it started, and wait until they have ended."""
        with suppress(ProcessLookupError):  # they have ended
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        until = time.monotonic() + _GROUP_END_S
        while _runs(self._process.pid) and time.monotonic() < until:
            time.sleep(_LOOK_AGAIN_S)


def _runs(group: int) -> bool:
    """Whether a process of a group runs still. Nobody waits for those that a killed process had started but the system."""
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has just ended
            state, _parent, of_group = entry.read_text(errors="replace").rpartition(")")[2].split()[:3]
            if int(of_group) == group and state not in "ZX":  # zombie, dead
                return True
    return False


def _describe_end(exitcode: int) -> str:
    if exitcode < 0:
        return f"its process was ended by signal {-exitcode} ({signal.Signals(-exitcode).name})"
    return f"its process ended with exit code {exitcode}"


def run_calls(pipe_handle: int, alive_handle: int, scratch: str, tells: bool) -> None:
    """Run the calls that come through the pipe until it closes. A call that raises ends the process."""
    pipe: Connection[Any, Any] = Connection(pipe_handle)
    for handle in (pipe_handle, alive_handle):
        os.set_inheritable(handle, False)
    tempfile.tempdir = scratch
    threading.Thread(target=_end_with_parent, args=(alive_handle,), daemon=True).start()
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
            self._pipe.send((False, f"{kind.__name__}: {_without_scratch(str(error))}"))


def _without_scratch(text: str) -> str:
    """The text with the folder of temporary files in the place of their names, which are others each time."""
    scratch = Path(tempfile.gettempdir())
    return re.sub(rf"{re.escape(str(scratch))}[^\s']*", lambda _name: str(scratch.parent), text)


def _end_with_parent(alive_handle: int) -> None:
    """Kill this process and what it started once the process that started it has ended."""
    os.read(alive_handle, 1)
    os.killpg(0, signal.SIGKILL)
