"""Traces of the whole fleet: a simulation by SUMO's binary from start to end, logged by its own FCD output (Parquet)."""

import tempfile
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from wzsumo.errors import SimulationError, SpecError
from wzsumo.frames import FloatArray, advance, heading_from_sumo_angle
from wzsumo.simulation.connection import connected_program
from wzsumo.simulation.demand import CAR, TRUCK
from wzsumo.simulation.edge_records import edge_record_options
from wzsumo.simulation.files import SumoFiles
from wzsumo.simulation.gridlock import CHECK_S, Gridlock
from wzsumo.simulation.trips import TRIP_OPTIONS, trips_file

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
    with tempfile.TemporaryDirectory(dir=files.config.parent) as name:
        folder = Path(name)
        fcd = folder / "fcd.parquet"
        # SUMO's default of two decimals is 1 cm and 0.01 degrees.
        options = ["--fcd-output", str(fcd), "--fcd-output.attributes", "x,y,angle,speed,type", "--precision", "3"]
        if files.surroundings:
            options += ["--fcd-output.filter-edges.input-file", str(_write_edge_list(files.surroundings.along, folder))]
        run_to_end(files, options=(*options, *record_options(files)), on_second=on_second)
        return _traces_of_fcd(fcd, files)


def record_options(files: SumoFiles) -> tuple[str, ...]:
    """SUMO's options for its own records: of every trip, and in a network of every edge (see `trips` and `edge_records`)."""
    trips = ("--tripinfo-output", str(trips_file(files)), *TRIP_OPTIONS)
    return trips if files.surroundings is None else (*trips, *edge_record_options(files.config.parent, files.surroundings))


def run_to_end(files: SumoFiles, *, options: tuple[str, ...], on_second: Callable[[float], None]) -> None:
    """Run the simulation of `files` to its end, with further options of SUMO's such as its outputs.

    `on_second` is called with the time [s] from the beginning once a simulated second. Vehicles that wait for each other where
    lanes merge make way (see `gridlock`). Raises SimulationError where SUMO fails, OSError where the disk is full.
    """
    arguments = ("--configuration-file", str(files.config), *options, "--no-warnings")
    edges = files.surroundings.along if files.surroundings else [edge.id for edge in files.edges]
    with connected_program(arguments, folder=files.config.parent) as api:
        gridlock = Gridlock(api, edges)
        on_second(0.0)
        for second in np.append(np.arange(1.0, files.duration), files.duration):
            api.simulationStep(files.begin + second)
            if second % CHECK_S == 0:
                gridlock.resolve()
            on_second(float(second))


def _write_edge_list(edges: Iterable[str], folder: Path) -> Path:
    path = folder / "edges.txt"
    path.write_text("".join(f"edge:{id_}\n" for id_ in edges), encoding="utf-8")
    return path


def _traces_of_fcd(path: Path, files: SumoFiles) -> pd.DataFrame:
    has_vehicles = set(_FCD_COLUMNS) <= set(pq.read_schema(path).names)  # SUMO names a column when it first has a value for it
    table = pq.read_table(path, columns=list(_FCD_COLUMNS) if has_vehicles else []).to_pandas().rename(columns=_FCD_COLUMNS)
    table = table[table["vehicle_id"].notna()] if has_vehicles else table  # a time step without vehicles is a row of nulls
    if not has_vehicles or table.empty:
        raise SpecError(
            "simulation.demand: no vehicle entered the road by the end of the simulation; raise flow_vph or "
            "duration_s, or take another seed"
        )
    length, width = _sizes_of(table["type"], files)
    bumper = np.column_stack([table["x"], table["y"], heading_from_sumo_angle(table["angle"])])
    centre = advance(bumper, -length / 2)
    traces = pd.DataFrame(
        {
            "vehicle_id": table["vehicle_id"].astype(str),
            "time_s": table["time_s"].astype(float) - files.begin,
            "x_m": centre[:, 0],
            "y_m": centre[:, 1],
            "heading_rad": centre[:, 2],
            "speed_mps": table["speed_mps"].astype(float),
            "length_m": length,
            "width_m": width,
        }
    )
    return traces.sort_values(["vehicle_id", "time_s"], kind="stable", ignore_index=True)


def _sizes_of(types: pd.Series, files: SumoFiles) -> tuple[FloatArray, FloatArray]:
    """Lengths and widths (n,) [m] of vehicles by their types."""
    if files.surroundings is None:
        truck = types.str.startswith("truck").to_numpy()
        length, width = (np.where(truck, TRUCK[key], CAR[key]) for key in ("length_m", "width_m"))
        return length, width
    sizes = files.surroundings.vehicle_sizes
    own = {name: _inserted_type(name, sizes) for name in types.unique()}
    unknown = sorted(set(own.values()) - sizes.keys())
    if unknown:
        raise SimulationError(f"{files.config}: vehicle type {unknown[0]!r} is in none of its route or additional files")
    both = np.array([sizes[own[name]] for name in types], dtype=np.float64)
    return both[:, 0], both[:, 1]


def _inserted_type(name: str, known: Collection[str]) -> str:
    """The type that a vehicle was inserted with: SUMO gives a vehicle with a value of its own a copy, type@vehicle."""
    while name not in known and "@" in name:
        name = name.rpartition("@")[0]
    return name
