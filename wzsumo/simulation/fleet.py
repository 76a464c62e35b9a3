"""Traces of the whole fleet: a simulation by SUMO's binary from start to end, logged by its own FCD output (Parquet)."""

import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from wzsumo.errors import SimulationError
from wzsumo.frames import advance, heading_from_sumo_angle
from wzsumo.simulation.connection import sumo_binary
from wzsumo.simulation.demand import CAR, TRUCK
from wzsumo.simulation.files import SumoFiles
from wzsumo.simulation.trips import TRIP_OPTIONS, trips_file

_STEP_LOG_PREFIX = "Step #"  # SUMO prints it before the simulated time
_FCD_COLUMNS = {
    "timestep_time": "time_s",
    "vehicle_id": "vehicle_id",
    "vehicle_x": "x",
    "vehicle_y": "y",
    "vehicle_angle": "angle",
    "vehicle_speed": "speed_mps",
    "vehicle_type": "type",
}


def simulate_fleet(files: SumoFiles, *, on_second: Callable[[float], None]) -> pd.DataFrame:
    """Trace table (see `tables`) of every vehicle at every step, with length_m and width_m.

    `on_second` is called with the simulated time [s] about once a simulated second. SUMO's own record of every trip is then in
    `trips_file(files)`.
    """
    with tempfile.TemporaryDirectory(dir=files.config.parent) as folder:
        fcd = Path(folder) / "fcd.parquet"
        # SUMO's default of two decimals is 1 cm and 0.01 degrees.
        fcd_options = ("--fcd-output", str(fcd), "--fcd-output.attributes", "x,y,angle,speed,type", "--precision", "3")
        options = (*fcd_options, "--tripinfo-output", str(trips_file(files)), *TRIP_OPTIONS)
        run_to_end(files, options=options, on_second=on_second)
        return _traces_of_fcd(fcd)


def run_to_end(files: SumoFiles, *, options: tuple[str, ...], on_second: Callable[[float], None]) -> None:
    """Run the simulation of `files` to its end, with further options of SUMO's such as its outputs.

    `on_second` is called with the simulated time [s] about once a simulated second. Raises SimulationError where SUMO fails.
    """
    steps_a_second = max(1, round(1 / files.step_length))
    log = ("--no-step-log", "false", "--step-log.period", str(steps_a_second), "--no-warnings")
    command = [str(sumo_binary("sumo")), "--configuration-file", str(files.config), *options, *log]
    with tempfile.TemporaryFile("w+") as errors:
        # Text mode takes the carriage return that ends each of SUMO's progress lines for the end of a line.
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process:
            try:
                for line in process.stdout or ():
                    if line.startswith(_STEP_LOG_PREFIX):
                        on_second(float(line.removeprefix(_STEP_LOG_PREFIX).split()[0]))
            except BaseException:
                process.kill()  # an interrupted program leaves no SUMO behind
                raise
        if process.returncode != 0:
            errors.seek(0)
            raise SimulationError(f"SUMO ended with {process.returncode}: {' '.join(errors.read().split())[-300:]}")


def _traces_of_fcd(path: Path) -> pd.DataFrame:
    table = pq.read_table(path, columns=list(_FCD_COLUMNS)).to_pandas().rename(columns=_FCD_COLUMNS)
    table = table[table["vehicle_id"].notna()]  # a time step without vehicles is a row of nulls
    if table.empty:
        raise SimulationError(f"{path}: the simulation logged no vehicle")
    truck = table["type"].str.startswith("truck").to_numpy()
    length = np.where(truck, TRUCK["length_m"], CAR["length_m"])
    bumper = np.column_stack([table["x"], table["y"], heading_from_sumo_angle(table["angle"])])
    centre = advance(bumper, -length / 2)
    traces = pd.DataFrame(
        {
            "vehicle_id": table["vehicle_id"].astype(str),
            "time_s": table["time_s"].astype(float),
            "x_m": centre[:, 0],
            "y_m": centre[:, 1],
            "heading_rad": centre[:, 2],
            "speed_mps": table["speed_mps"].astype(float),
            "length_m": length,
            "width_m": np.where(truck, TRUCK["width_m"], CAR["width_m"]),
        }
    )
    return traces.sort_values(["vehicle_id", "time_s"], kind="stable", ignore_index=True)
