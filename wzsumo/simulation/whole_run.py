"""A simulation from its start to its end by SUMO's own binary, for what needs no hand on it while it runs.

The same steps take 15 to 20 % longer in libsumo 1.28 than in the binary; the results are the same.
"""

import subprocess
import tempfile
from collections.abc import Callable

from wzsumo.errors import SimulationError
from wzsumo.simulation.files import SumoFiles
from wzsumo.simulation.installation import sumo_binary

_STEP = "Step #"  # what SUMO prints before the simulated time


def run_to_end(files: SumoFiles, *, options: tuple[str, ...], on_second: Callable[[float], None]) -> None:
    """Run the simulation of `files` with more options of SUMO's, such as its outputs.

    `on_second` is called with the simulated time [s] about once a simulated second. Raises SimulationError where SUMO fails.
    """
    steps_a_second = max(1, round(1 / files.step_length))
    log = ("--no-step-log", "false", "--step-log.period", str(steps_a_second), "--no-warnings")
    command = [str(sumo_binary("sumo")), "--configuration-file", str(files.config), *options, *log]
    with tempfile.TemporaryFile("w+") as errors:
        # Text mode takes the carriage return that ends each of SUMO's progress lines for the end of a line.
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process:
            for line in process.stdout or ():
                if line.startswith(_STEP):
                    on_second(float(line.removeprefix(_STEP).split()[0]))
        if process.returncode != 0:
            errors.seek(0)
            raise SimulationError(f"SUMO ended with {process.returncode}: {' '.join(errors.read().split())[-300:]}")
