"""ClusterWorkers: the workers of a Dask cluster that runs already, used as those of this machine are (see `workers`)."""

import re
import threading
from collections.abc import Callable
from concurrent.futures import Future
from types import TracebackType
from typing import Any, Self

from wzsumo.errors import InputError
from wzsumo.sweep.workers import TaskLost

CONNECT_S = 15.0  # a scheduler that has not answered by then does not


class ClusterWorkers:
    """The workers of a Dask cluster that runs already, by its scheduler's address."""

    def __init__(self, address: str, *, version: Callable[[], str]) -> None:
        if not re.fullmatch(r"(\w+://)?[^:/\s]+:\d+", address):
            raise InputError(f"--scheduler {address}: must be [protocol://]host:port, such as tcp://10.0.0.1:8786")
        try:
            from distributed import Client
        except ImportError:
            raise InputError(
                f"--scheduler {address}: the package distributed is missing; pip install 'wzsumo[cluster]'"
            ) from None
        try:
            self._client = Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(
                f"--scheduler {address}: no Dask scheduler answers there ({error}); give the address that `dask scheduler` "
                "prints, such as tcp://10.0.0.1:8786"
            ) from None
        self._refuse_unfit_workers(address, version)
        self.count = sum(self._client.nthreads().values())

    def _refuse_unfit_workers(self, address: str, version: Callable[[], str]) -> None:
        if not self._client.nthreads():
            self._client.close()
            raise InputError(f"--scheduler {address}: the cluster has no workers; start some: dask worker {address}")
        others = {worker: theirs for worker, theirs in self._client.run(version).items() if theirs != version()}
        if others:
            self._client.close()
            worker, theirs = next(iter(others.items()))
            raise InputError(
                f"--scheduler {address}: worker {worker} has wzsumo {theirs}, this is {version()}; install the same everywhere"
            )

    def start(self, function: Callable[..., Any], *args: Any, limit_s: float) -> Future[Any]:
        """The future result of `function(*args)` on some worker, lost after `limit_s` seconds."""
        future: Future[Any] = Future()
        theirs = self._client.submit(function, *args, pure=False, retries=0)
        timer = threading.Timer(limit_s, lambda: theirs.cancel(force=True))
        timer.daemon = True
        timer.start()

        def settle(done: Any) -> None:
            timer.cancel()
            if done.status == "finished":
                future.set_result(done.result())
            elif done.status == "error":
                future.set_exception(done.exception())
            else:
                future.set_exception(TaskLost(f"took longer than {limit_s:.0f} s and was cancelled, or its worker was lost"))

        theirs.add_done_callback(settle)
        return future

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._client.close()
