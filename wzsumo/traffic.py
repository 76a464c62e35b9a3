"""Traffic: the vehicles on the road at one moment. traffic_trace: the trace table of several moments."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.frames import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Traffic:
    """The vehicles around the ego at one moment: ids (n,), centre poses (n, 3), the other fields (n,) in SI units."""

    ids: tuple[str, ...]
    poses: FloatArray
    speeds: FloatArray
    accelerations: FloatArray  # along the heading
    lengths: FloatArray
    widths: FloatArray

    def near(self, x: float, y: float, *, reach_m: float) -> "Traffic":
        """The vehicles whose centre lies within `reach_m` of (x, y) [m]."""
        kept = np.hypot(self.poses[:, 0] - x, self.poses[:, 1] - y) <= reach_m
        return Traffic(
            ids=tuple(name for name, is_near in zip(self.ids, kept, strict=True) if is_near),
            poses=self.poses[kept], speeds=self.speeds[kept], accelerations=self.accelerations[kept],
            lengths=self.lengths[kept], widths=self.widths[kept],
        )  # fmt: skip


def traffic_trace(moments: Iterable[tuple[float, Traffic]]) -> pd.DataFrame:
    """The trace table, with all its columns, of the traffic at times [s]."""
    moments = list(moments)
    counts = [len(traffic.ids) for _, traffic in moments]
    poses = np.concatenate([np.empty((0, 3)), *(traffic.poses for _, traffic in moments)])

    def column(name: str) -> FloatArray:
        return np.concatenate([np.empty(0), *(getattr(traffic, name) for _, traffic in moments)])

    return pd.DataFrame({
        "vehicle_id": [name for _, traffic in moments for name in traffic.ids],
        "time_s": np.repeat([time for time, _ in moments], counts),
        "x_m": poses[:, 0], "y_m": poses[:, 1], "heading_rad": poses[:, 2],
        "speed_mps": column("speeds"), "length_m": column("lengths"), "width_m": column("widths"),
    })  # fmt: skip
