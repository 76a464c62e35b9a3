"""ClusterWorkers: the workers of a running Dask cluster, with the same interface as LocalWorkers (see `workers`)."""

import re
import threading
from collections.abc import Callable
from concurrent.futures import Future
from types import TracebackType
from typing import Any, Self

from wzsumo.errors import InputError, WorkersLostError
from wzsumo.sweep.workers import TaskLost

CONNECT_TIMEOUT_S = 15.0


class ClusterWorkers:
    """The workers of the running Dask cluster whose scheduler has this address."""

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
            self._client = Client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(
                f"--scheduler {address}: no Dask scheduler answers there ({error}); give the address that `dask scheduler` "
                "prints, such as tcp://10.0.0.1:8786"
            ) from None
        self._address = address
        self._check_workers(address, version)
        self.count = sum(self._client.nthreads().values())

    def _check_workers(self, address: str, version: Callable[[], str]) -> None:
        if not self._client.nthreads():
            self._client.close()
            raise InputError(f"--scheduler {address}: the cluster has no workers; start some: dask worker {address}")
        other_versions = {worker: its for worker, its in self._client.run(version).items() if its != version()}
        if other_versions:
            self._client.close()
            worker, its_version = next(iter(other_versions.items()))
            raise InputError(
                f"--scheduler {address}: worker {worker} has wzsumo {its_version}, this is {version()}; install the same "
                "everywhere"
            )

    def start(self, function: Callable[..., Any], *args: Any, limit_s: float) -> Future[Any]:
        """The future result of `function(*args)` on one of the workers; TaskLost after `limit_s` seconds.

        WorkersLostError where the scheduler no longer answers.
        """
        future: Future[Any] = Future()
        try:
            on_cluster = self._client.submit(function, *args, pure=False, retries=0)
        except (OSError, RuntimeError):  # the connection was closed
            future.set_exception(self._lost())
            return future
        too_long = threading.Event()

        def stop() -> None:
            too_long.set()
            on_cluster.cancel(force=True)

        timer = threading.Timer(limit_s, stop)
        timer.daemon = True
        timer.start()

        def copy_result(done: Any) -> None:
            timer.cancel()
            if done.status == "finished":
                future.set_result(done.result())
            elif done.status == "error":
                future.set_exception(done.exception())
            elif too_long.is_set():
                future.set_exception(TaskLost(f"took longer than {limit_s:.0f} s and was cancelled"))
            elif self._client.status != "running":
                future.set_exception(self._lost())
            else:
                future.set_exception(TaskLost("its worker was lost"))

        on_cluster.add_done_callback(copy_result)
        return future

    def _lost(self) -> WorkersLostError:
        return WorkersLostError(
            f"--scheduler {self._address}: the scheduler no longer answers; what was finished is kept: start it again, then "
            "run the same command, which goes on with what is missing"
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._client.close()
