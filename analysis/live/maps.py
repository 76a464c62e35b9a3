"""The map that a world deserves: as `wzsumo map` would give it of many traces, made in closed form."""

import numpy as np

from analysis.live.streams import EXIT_AT_M, EXIT_LENGTH_M, EXIT_SLOPE, LANES, LENGTH_M, WIDTH_M, World
from wzsumo.lane_map import LaneMap, MappedBranch, MappedLane
from wzsumo.road import Road


def map_of_world(world: World, *, sd_m: float = 0.08) -> LaneMap:
    """The lanes of a world on a straight axis, stations every 20 m."""
    axis = Road(
        reference_line=np.array([[0.0, WIDTH_M], [LENGTH_M, WIDTH_M]]), lane_widths=(WIDTH_M,) * LANES, left_shoulder=3.0,
        right_shoulder=3.0,
    )  # fmt: skip
    stations = np.arange(0.0, LENGTH_M + 1, 20.0)
    lanes = []
    for lane in range(LANES):
        shut = world.closed and lane == LANES - 1
        closed = shut & (stations >= world.closed_from) & (stations <= world.closed_to)
        sd = np.full(len(stations), sd_m)
        lanes.append(
            MappedLane(
                right=np.full(len(stations), lane * WIDTH_M),
                left=np.full(len(stations), (lane + 1) * WIDTH_M),
                right_sd=sd,
                left_sd=sd,
                p_open=np.repeat(np.where(closed, 0.03, 0.97)[:, None], 8, axis=1),
                n_traces=100,
            )
        )
    along = np.arange(0.0, EXIT_LENGTH_M, 10.0)
    line = axis.to_xy(EXIT_AT_M + along, WIDTH_M / 2 - EXIT_SLOPE * along)
    branch = MappedBranch(line=line, width=np.full(len(along), 3.2), p_open=0.95, n_traces=10)
    return LaneMap(
        axis=axis, stations=stations, lanes=tuple(lanes), branches=(branch,), n_traces=100, first_time_s=0.0, last_time_s=0.0
    )
