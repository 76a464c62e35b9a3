"""Tasks for workers, in a module that their processes can import: pytest gives the names of test modules itself."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

_PROGRAMS: list["subprocess.Popen[bytes]"] = []  # that run on after their task


def kill_self() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def divide(a: float, b: float) -> float:
    return a / b


def start_a_program() -> int:
    """The number of a process that holds so much memory that it takes some time to end."""
    words = [sys.executable, "-c", "held = b'1' * 400_000_000; print(flush=True); input()"]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    _PROGRAMS.append(process)
    return process.pid


def compile_a_kernel(number: int) -> int:
    import numba

    def kernel(x: int) -> int:
        return x + 1

    kernel.__module__ = "wzsumo.a_module_with_kernels"
    return int(numba.njit(kernel)(number))


def read_a_temporary_file() -> bytes:
    return (Path(tempfile.mkdtemp()) / "none.bin").read_bytes()
