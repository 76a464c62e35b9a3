"""SUMO on this machine: its programs, and a connection to a simulation as a library or in the window of sumo-gui.

No other module imports libsumo or traci. Both have the same functions under the same names.
"""

import errno
import io
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import IO, Any

from wzsumo.errors import DisplayError, SimulationError, SumoMissingError, uninterrupted

WINDOW_DELAY_MS = 40  # a step of 50 ms then takes about real time, with 10 ms for drawing
WINDOW_ZOOM = 1200.0  # of sumo-gui: some 150 m of road
OPENING_TRIES = 30  # one a second; chosen by us for large networks
MARK_RGBA = (213, 94, 0, 255)  # vermilion; Okabe and Ito 2008, "Color universal design"
SYSTEM_LIBRARIES = "libgl1 libx11-6 libxext6 libxrender1 libatomic1 libexpat1"  # what libsumo 1.28 links on Debian 12
REMEDY = f"on Debian or Ubuntu: apt-get install {SYSTEM_LIBRARIES}; Python packages: make setup"
LEAST_FREE_BYTES = 100_000  # with less, the disk counts as full
_VIEW = "View #0"  # sumo-gui's name of its first window
_CONNECTING_S = 0.02  # between two tries to reach a SUMO that still loads its files
_ANY_NUMBER = 10**9  # of tries: they end when SUMO does


@contextmanager
def connected_library(arguments: Sequence[str]) -> Iterator[Any]:
    """Libsumo with a simulation that was started with SUMO's command-line arguments. Raises SumoMissingError."""
    libsumo = _load_libsumo()
    libsumo.start(["sumo", *arguments])
    try:
        yield libsumo
    finally:
        libsumo.close()


@contextmanager
def connected_program(arguments: Sequence[str], *, folder: Path) -> Iterator[Any]:
    """Traci with a simulation by SUMO's own binary, which takes less time than the library; its files go to `folder`.

    Raises SimulationError where SUMO fails, OSError where the disk is full, SumoMissingError.
    """
    traci = _load_traci()
    port = traci.getFreeSocketPort()
    command = [str(sumo_binary("sumo")), *arguments, "--remote-port", str(port)]
    ended_early = False
    with tempfile.TemporaryFile("w+") as errors:
        with _started(command, errors) as process:
            try:
                with redirect_stdout(io.StringIO()):  # traci prints each try
                    api = _connect(traci, port, process)
                _refuse_another(api, command)
                yield api
                api.close()
            except traci.FatalTraCIError:
                ended_early = True
        # SUMO that writes to a full disk ends in one of two ways: killed, or with 0 and files that are cut short.
        if process.returncode == -signal.SIGXFSZ or shutil.disk_usage(folder).free < LEAST_FREE_BYTES:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))
        if process.returncode != 0 or ended_early:
            errors.seek(0)
            raise SimulationError(f"SUMO ended with {process.returncode}: {' '.join(errors.read().split())[-300:]}")


@contextmanager
def connected_window(arguments: Sequence[str]) -> Iterator[Any]:
    """Traci with a simulation that runs in a window. Raises SumoMissingError, and DisplayError without a window."""
    refuse_without_display()
    traci = _load_traci()
    command = window_command(sumo_binary("sumo-gui"), arguments)
    try:
        # Told a port, traci starts one window and no other if that fails; it prints each second that it waits.
        with redirect_stdout(io.StringIO()):
            traci.start(command, port=traci.getFreeSocketPort(), numRetries=OPENING_TRIES, stdout=sys.stderr)
        try:
            yield traci
        finally:
            traci.close()
    except traci.FatalTraCIError as error:
        raise DisplayError(
            f"--gui: the window of sumo-gui was closed or could not be opened ({error}); leave --gui out"
        ) from None


def window_command(program: Path, arguments: Sequence[str]) -> list[str]:
    """The command line of a sumo-gui that starts at once, slowly enough to be watched, and closes at the end."""
    return [str(program), *arguments, "--start", "--quit-on-end", "--delay", str(WINDOW_DELAY_MS)]


def follow_in_window(api: Any, vehicle: str) -> None:
    """Let the window follow a vehicle in a colour of its own, close enough to see its place in the lane."""
    api.vehicle.setColor(vehicle, MARK_RGBA)
    api.gui.trackVehicle(_VIEW, vehicle)
    api.gui.setZoom(_VIEW, WINDOW_ZOOM)


def refuse_without_display() -> None:
    """Raise DisplayError on a machine that has no display to open a window on."""
    needs_name = sys.platform.startswith("linux")  # elsewhere SUMO finds the desktop without a name
    if needs_name and not os.environ.get("DISPLAY"):
        raise DisplayError(
            "--gui: there is no display here (DISPLAY is not set); run it on a desktop or through `ssh -X`, or leave --gui "
            "out: report.html plays the drive"
        )


def sumo_binary(name: str) -> Path:
    """Path of one of SUMO's programs (netconvert, sumo, sumo-gui). Raises SumoMissingError."""
    try:
        import sumo
    except ImportError as error:
        raise SumoMissingError(f"SUMO is not installed ({error}); {REMEDY}") from None
    program = Path(sumo.SUMO_HOME) / "bin" / name
    if not os.access(program, os.X_OK):
        raise SumoMissingError(f"SUMO's program {name} is not at {program}; {REMEDY}")
    return program


@contextmanager
def _started(command: Sequence[str], errors: IO[str]) -> Iterator["subprocess.Popen[bytes]"]:
    """A process of SUMO, which has ended at the end of the block: by itself, or killed where the block raises."""
    with uninterrupted() as interruptible:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors)
        try:
            with interruptible():
                yield process
        except BaseException:
            process.kill()
            raise
        finally:
            process.wait()


def _connect(traci: Any, port: int, process: "subprocess.Popen[bytes]") -> Any:
    """A connection to a SUMO that may still be loading its files. Raises FatalTraCIError where it ends instead."""
    try:
        return traci.connect(port, numRetries=_ANY_NUMBER, proc=process, waitBetweenRetries=_CONNECTING_S)
    except traci.TraCIException as error:
        raise traci.FatalTraCIError(str(error)) from None


def _refuse_another(api: Any, command: Sequence[str]) -> None:
    """Raise SimulationError where another SUMO answers at this port: two that start at once may be given the same."""
    answers = api.simulation.getOption("configuration-file")
    if answers not in command:
        raise SimulationError(f"SUMO's port was taken by another simulation, of {answers}; start this one again")


def _load_libsumo() -> Any:
    # Unless told to be quiet, it prints a line about pyarrow on stdout. It sets PROJ_LIB for the whole process, which breaks
    # other users of PROJ (rasterio). It imports traci, which is then libsumo for the rest of the process unless it is there.
    _load_traci()
    with _import_environment("quiet"):
        try:
            import libsumo
        except ImportError as error:
            raise SumoMissingError(f"libsumo cannot be loaded ({error}); {REMEDY}") from None
    return libsumo


def _load_traci() -> Any:
    with _import_environment(None):  # else traci would be libsumo, which has no window
        try:
            import traci
        except ImportError as error:
            raise SumoMissingError(f"traci cannot be loaded ({error}); {REMEDY}") from None
    return traci


@contextmanager
def _import_environment(libsumo_as_traci: str | None) -> Iterator[None]:
    """LIBSUMO_AS_TRACI as given while SUMO's packages are imported; afterwards it and what they set are as before."""
    before = {name: os.environ.pop(name, None) for name in ("LIBSUMO_AS_TRACI", "PROJ_LIB", "PROJ_DATA")}
    if libsumo_as_traci is not None:
        os.environ["LIBSUMO_AS_TRACI"] = libsumo_as_traci
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
