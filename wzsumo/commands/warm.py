"""The command `warm`: compile all kernels once."""

import argparse
from typing import Any

import numpy as np
import pandas as pd

from wzsumo.case.crowd import Crowd
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add nothing: the command has no arguments."""


def run(args: argparse.Namespace) -> dict[str, Any]:  # noqa: ARG001 - every command gets its arguments
    """Compile every numba kernel once, so that the first run does not wait for it."""
    from wzsumo.crowd_mapping.lanes.lane_mapping import map_lanes
    from wzsumo.crowd_mapping.reference_line import axis_of
    from wzsumo.lidar_mapping import slam_map
    from wzsumo.metrics import fleet_conflicts
    from wzsumo.planning import plan
    from wzsumo.sensing import gnss, raycast

    for stage in (fleet_conflicts, plan, gnss, raycast, slam_map):
        stage.compile_kernels()
    s = np.arange(0.0, 300.0, 5.0)
    traces = pd.concat(
        pd.DataFrame({"vehicle_id": f"v{n}", "time_s": s / 20, "x_m": s, "y_m": 0.2 * n + 0.01 * np.sin(s)}) for n in range(4)
    )
    _ = Crowd(traces=traces, road=axis_of(np.array([[0.0, 0.0], [300.0, 0.0]])), spec=MixtureSpec(k_max=4), seed=1).sweep
    map_lanes(traces)
    return {"warm": True}
