"""Tasks for workers, in a module that their processes can import: pytest gives the names of test modules itself."""

import os
import signal


def kill_self() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def divide(a: float, b: float) -> float:
    return a / b


def compile_a_kernel(number: int) -> int:
    import numba

    def kernel(x: int) -> int:
        return x + 1

    kernel.__module__ = "wzsumo.a_module_with_kernels"
    return int(numba.njit(kernel)(number))
