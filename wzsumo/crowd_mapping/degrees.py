"""Latitude and longitude where metres belong: recognised by name or by what they would mean, and refused with the remedy."""

import numpy as np
import pandas as pd

from wzsumo.errors import TraceError

METRES_PER_DEGREE = 111_195.0  # of latitude, on a sphere of 6371 km
LARGEST_ZONE_DEG = 0.5  # a zone given in degrees spreads over less
SLOW_MPS, FAST_MPS = 0.5, 75.0  # between them vehicles move that are worth a map
REMEDY = "project them to metres of a local frame first (the UTM zone of the place, for example with pyproj)"


def refuse_named_degrees(table: pd.DataFrame, *, source: str) -> None:
    """Raise TraceError where x_m or y_m is missing and columns are named latitude and longitude."""
    if {"x_m", "y_m"} <= set(table.columns):
        return
    named = [
        str(name) for name in table.columns if str(name).lower().split("_")[0] in {"lat", "latitude", "lon", "lng", "longitude"}
    ]
    if named:
        raise TraceError(f"{source}: x_m and y_m missing, {', '.join(named)} given; {REMEDY}, in columns x_m and y_m")


def refuse_degrees(fixes: pd.DataFrame, *, source: str) -> None:
    """Raise TraceError where x_m, y_m of finite fixes can be degrees and vehicles would stand still if they were metres."""
    xy = fixes[["x_m", "y_m"]].to_numpy()
    if not ((np.abs(xy) <= 180).all() and np.ptp(xy, axis=0).max() <= LARGEST_ZONE_DEG):
        return
    order = np.lexsort((fixes["time_s"].to_numpy(), pd.factorize(fixes["vehicle_id"])[0]))
    same = np.diff(pd.factorize(fixes["vehicle_id"])[0][order]) == 0
    elapsed = np.diff(fixes["time_s"].to_numpy()[order])
    moving = same & (elapsed > 0)
    if not moving.any():
        return
    east = METRES_PER_DEGREE * np.cos(np.deg2rad(np.median(xy[:, 1])))
    steps = np.diff(xy[order], axis=0)[moving] * (east, METRES_PER_DEGREE)
    speed = float(np.median(np.hypot(*steps.T) / elapsed[moving]))
    if SLOW_MPS < speed < FAST_MPS:
        raise TraceError(
            f"{source}: x_m {xy[0, 0]:.5f} and y_m {xy[0, 1]:.5f} look like longitude and latitude in degrees, not metres "
            f"(as degrees, vehicles move at about {speed:.0f} m/s); {REMEDY}"
        )
