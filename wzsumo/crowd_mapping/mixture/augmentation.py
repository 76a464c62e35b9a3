"""Copies of few traces, moved to the side as other drivers would have driven: augmentation for low penetration.

Chen et al. 2022 name the idea for few equipped vehicles. What it is worth: docs/results/how_many_traces.md.
"""

import numpy as np
import pandas as pd

from wzsumo.tables import check_traces


def with_copies(traces: pd.DataFrame, *, copies: int, driver_sd_m: float, seed: int) -> pd.DataFrame:
    """The trace table and `copies` of each trace, each at an offset of its own across its way, normal of sd `driver_sd_m`."""
    table = check_traces(traces, source="traces")
    random = np.random.default_rng(seed)
    parts = [table]
    for vehicle_id, trace in table.groupby("vehicle_id", sort=True):
        if len(trace) < 2:
            continue
        xy = trace[["x_m", "y_m"]].to_numpy()
        way = np.gradient(xy, axis=0)
        across = np.column_stack([-way[:, 1], way[:, 0]]) / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        for number in range(copies):
            moved = xy + driver_sd_m * random.standard_normal() * across
            parts.append(trace.assign(vehicle_id=f"{vehicle_id} copy {number}", x_m=moved[:, 0], y_m=moved[:, 1]))
    return pd.concat(parts, ignore_index=True)
