"""Tasks for workers, in a module that their processes can import: pytest gives the names of test modules itself."""

import os
import signal


def kill_self() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def divide(a: float, b: float) -> float:
    return a / b
