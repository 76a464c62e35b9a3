"""Flow, density and speed on a grid of time and station, from all vehicles' traces.

Source: Edie 1963, Discussion of traffic stream measurements and definitions: over an area of time x road the flow is the
distance that vehicles drive in it, the density the time that they spend in it, both by the area; the speed is their ratio.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.frames import FloatArray

MAX_QUEUE_HEAD_M = 500.0  # from the bottleneck to the queue's head, where drivers who merge early slow others; chosen by us
MAX_QUEUE_GAP_M = 200.0  # length of free road within one queue, as in stop-and-go traffic; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class SpaceTime:
    """Cells (n_times, n_stations) of `time_edges` [s] and `station_edges` [m]."""

    time_edges: FloatArray
    station_edges: FloatArray
    time_spent: FloatArray  # vehicle-seconds in each cell
    distance: FloatArray  # vehicle-metres in each cell

    @property
    def speed(self) -> FloatArray:
        """Space-mean speed [m/s] of every cell, NaN where no vehicle was."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.time_spent > 0, self.distance / self.time_spent, np.nan)

    @property
    def flow(self) -> FloatArray:
        """Flow [veh/h] of every cell, all lanes together."""
        return 3600 * self.distance / self._areas

    @property
    def density(self) -> FloatArray:
        """Density [veh/km] of every cell, all lanes together."""
        return 1000 * self.time_spent / self._areas

    def table(self) -> pd.DataFrame:
        """time_s and station_m of every cell's start, flow_vph, density_vpkm, speed_mps; one row a cell."""
        time, station = np.meshgrid(self.time_edges[:-1], self.station_edges[:-1], indexing="ij")
        columns = {"time_s": time, "station_m": station, "flow_vph": self.flow, "density_vpkm": self.density}
        return pd.DataFrame({name: cells.ravel() for name, cells in (columns | {"speed_mps": self.speed}).items()})

    @property
    def _areas(self) -> FloatArray:
        return np.outer(np.diff(self.time_edges), np.diff(self.station_edges))


def space_time_grid(
    time: npt.ArrayLike, station: npt.ArrayLike, speed: npt.ArrayLike, *, dt: float, cell_s: float, cell_m: float
) -> SpaceTime:
    """Grid over all fixes (n,): times [s], stations [m] and speeds [m/s], one fix per vehicle every `dt` [s].

    Each fix stands for dt seconds and speed x dt metres in the cell that it lies in. Cells begin at 0 s and 0 m. Fixes at
    stations below 0 do not count.
    """
    t, s, v = (np.asarray(values, dtype=float) for values in (time, station, speed))
    time_edges = np.arange(np.floor(t.max() / cell_s + 1e-9) + 2) * cell_s
    station_edges = np.arange(np.floor(max(s.max(), 0.0) / cell_m) + 2) * cell_m
    edges = (time_edges, station_edges)
    # A fix at a cell's edge belongs to the later cell, also where the rounding of k dt puts it just below the edge.
    at = (t + 1e-6, s)
    return SpaceTime(
        time_edges=time_edges,
        station_edges=station_edges,
        time_spent=np.histogram2d(*at, bins=edges, weights=np.full_like(t, dt))[0],
        distance=np.histogram2d(*at, bins=edges, weights=v * dt)[0],
    )


def queue_lengths(grid: SpaceTime, *, bottleneck: float, slow: float) -> FloatArray:
    """Length [m] of the queue upstream of station `bottleneck` [m] in every time cell; 0 without one.

    A cell is queued where its speed is below `slow` [m/s]. The queue's head is the nearest queued cell upstream of the
    bottleneck, its tail the farthest one that is joined to it. Queued cells are joined where at most MAX_QUEUE_GAP_M of free or
    empty road lies between them.
    """
    upstream = np.flatnonzero(grid.station_edges[1:] <= bottleneck + 1e-6)[::-1]
    away, cell = bottleneck - grid.station_edges[upstream], np.diff(grid.station_edges)[0]
    with np.errstate(invalid="ignore"):
        is_slow = grid.speed[:, upstream] < slow
    lengths = np.zeros(len(is_slow))
    for row, cells in enumerate(is_slow):
        reached = away[cells]
        if reached.size and reached[0] <= MAX_QUEUE_HEAD_M + cell:
            joined = np.cumprod(np.diff(reached) <= MAX_QUEUE_GAP_M + cell).astype(bool)
            lengths[row] = reached[1:][joined].max(initial=reached[0])
    return lengths
