"""Copies of traces, each moved to the side by an offset of its own: augmentation where few vehicles are equipped.

Chen et al. 2022 name the idea for few equipped vehicles. docs/results/how_many_traces.md says what it is worth.
"""

import numpy as np
import pandas as pd

from wzsumo.tables import check_traces


def with_copies(traces: pd.DataFrame, *, copies: int, driver_sd_m: float, seed: int) -> pd.DataFrame:
    """The trace table and `copies` of each trace, moved across its course by a normal offset of sd `driver_sd_m` [m]."""
    table = check_traces(traces, source="traces")
    random = np.random.default_rng(seed)
    parts = [table]
    for vehicle_id, trace in table.groupby("vehicle_id", sort=True):
        if len(trace) < 2:
            continue
        xy = trace[["x_m", "y_m"]].to_numpy()
        along = np.gradient(xy, axis=0)
        left = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
        for number in range(copies):
            moved = xy + driver_sd_m * random.standard_normal() * left
            parts.append(trace.assign(vehicle_id=f"{vehicle_id} copy {number}", x_m=moved[:, 0], y_m=moved[:, 1]))
    return pd.concat(parts, ignore_index=True)
