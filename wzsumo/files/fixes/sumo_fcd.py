"""What SUMO's FCD output has and others have not: points of the front bumper, angles of the network's grid, empty steps."""

import numpy as np
import pandas as pd

from wzsumo.files.fixes.dialects import Column
from wzsumo.frames import FloatArray, advance

LENGTH_M = 5.0  # SUMO's default vehicle length (docs, Vehicle Type Parameter Defaults)
MAX_GRID_TURN_RAD = np.deg2rad(6.0)  # between a projection's grid and true north: UTM's is 4.5 degrees at 70 degrees latitude


def is_fcd(found: dict[str, Column]) -> bool:
    """Whether columns are those of SUMO's FCD output."""
    return "time" in found and found["time"].name == "timestep_time"


def without_empty_steps(raw: pd.DataFrame, found: dict[str, Column]) -> pd.DataFrame:
    """The rows of a FCD table that hold a vehicle: as CSV and Parquet it has a row for a step without any."""
    names = [found[key].name for key in ("vehicle_id", "x", "y") if key in found]
    empty = raw[names].isna().all(axis=1)
    return raw[~empty].reset_index(drop=True) if empty.any() else raw


def turned_to_north(heading: FloatArray, off: FloatArray) -> tuple[FloatArray, str | None]:
    """(headings [rad] in a frame of degrees, what was done), by how far `off` (k,) the way that is driven lies to their left.

    SUMO gives angles of its network's grid even where it gives longitudes and latitudes.
    """
    turn = float(np.median(off)) if off.size else 0.0
    if not 0 < abs(turn) < MAX_GRID_TURN_RAD:
        return heading, None
    said = f"SUMO's angles are of its network's grid: turned by {np.rad2deg(turn):.2f} degrees to the way that is driven"
    return heading + turn, said


def moved_from_bumper(table: pd.DataFrame) -> tuple[pd.DataFrame, str]:
    """(the table with its points moved from the front bumper to the middle of the vehicle, what was done)."""
    poses = table[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float)
    moved = advance(poses, -np.asarray(table.get("length_m", LENGTH_M), dtype=float) / 2)
    said = "half of their length" if "length_m" in table else f"{LENGTH_M / 2:g} m, half of SUMO's default length"
    return table.assign(x_m=moved[:, 0], y_m=moved[:, 1]), f"SUMO's points of the front bumper are moved back by {said}"
