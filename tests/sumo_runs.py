"""Runs of SUMO's own binary on a few vehicles whose places are given: where each is in every step."""

import subprocess
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
from builders import vehicle_outlines

from wzsumo.frames import advance, heading_from_sumo_angle
from wzsumo.simulation.connection import sumo_binary

OPTIONS = "--step-length 0.1 --lateral-resolution 0.45 --end 30 --xml-validation never --collision.action none --no-step-log"


def driven(net: Path, content: str, folder: Path) -> pd.DataFrame:
    """Half a minute of the <routes> whose content is given: SUMO's FCD, columns id, x, y, ... without the prefix."""
    routes, fcd = folder / "given.rou.xml", folder / "fcd.csv"
    routes.write_text(f"<routes>{content}</routes>")
    files = ("-n", str(net), "-r", str(routes), "--fcd-output", str(fcd))
    subprocess.run([str(sumo_binary("sumo")), *files, *OPTIONS.split()], check=True, capture_output=True)
    rows = pd.read_csv(fcd, sep=";")
    return rows.rename(columns=lambda name: name.split("_", 1)[1])


def outlines_in(rows: pd.DataFrame, *, length: float, width: float) -> npt.NDArray[np.object_]:
    """Rectangles (n,) of a vehicle of that size [m] in rows of `driven`."""
    bumper = np.column_stack([rows["x"], rows["y"], heading_from_sumo_angle(rows["angle"])])
    x, y, heading = advance(bumper, -length / 2).T
    return vehicle_outlines(pd.DataFrame({"x_m": x, "y_m": y, "heading_rad": heading, "length_m": length, "width_m": width}))
