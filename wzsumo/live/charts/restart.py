"""Charts after an alarm: all evidence is spent, and the stretch that changed learns its habits anew."""

from dataclasses import replace

import numpy as np

from wzsumo.live.alarms import Change, Kind
from wzsumo.live.charts.lane_charts import LaneCharts
from wzsumo.live.charts.passing_charts import PassingCharts
from wzsumo.live.charts.shape_charts import ShapeCharts, first_shape_charts
from wzsumo.live.ground import Ground
from wzsumo.live.trace.lane_use import REACH_M

KNOWN_TO_END = (400.0, 0.0)  # traces that end and go on ahead of a closed road: so many that the prior does not count


def stretch_of(ground: Ground, change: Change) -> slice:
    """The cells whose habits a change may have changed: its own, and those within the reach of drivers who mind it."""
    if change.start_m is None or change.end_m is None:
        return slice(0, 0)
    first = np.searchsorted(ground.cells, change.start_m - REACH_M)
    last = np.searchsorted(ground.cells, change.end_m + REACH_M)
    return slice(int(first), int(last) + 1)


def restarted_shape(charts: ShapeCharts, ground: Ground, change: Change, *, number: int) -> ShapeCharts:
    """Charts of the shape after a change; where only probabilities changed, the shape's habits are kept."""
    known = charts.known.copy()
    if change.kind not in (Kind.SILENCE, Kind.EXIT_CLOSED, Kind.ROAD_CLOSED):
        stretch = stretch_of(ground, change)
        known[:, :, stretch] = first_shape_charts(ground).known[:, :, stretch]
    return replace(
        charts, evidence=np.zeros_like(charts.evidence), since=np.full_like(charts.since, number), known=known,
        pending=np.zeros_like(charts.pending),
    )  # fmt: skip


def restarted_lanes(charts: LaneCharts, ground: Ground, change: Change, *, number: int) -> LaneCharts:
    """Charts of the lanes after a change."""
    new = {name: value.copy() for name, value in vars(charts).items()}
    for name, value in new.items():
        if name in ("closing", "ends", "opening") or name.endswith("_pending"):
            value[:] = 0
        elif name.endswith("_since"):
            value[:] = number
    if change.kind in (Kind.LANE_CLOSED, Kind.LANE_OPEN, Kind.CLOSURE_START_MOVED, Kind.CLOSURE_END_MOVED):
        new["leaving"][:, :, :, stretch_of(ground, change)] = 0
        sides = {Kind.CLOSURE_START_MOVED: [0], Kind.CLOSURE_END_MOVED: [1]}.get(change.kind, [0, 1])
        for side in sides:
            new["places"][side, change.lane] = 0
            new["ratios"][side, change.lane] = 0
        new["using"][:, change.lane] = 0
    return LaneCharts(**new)


def restarted_passing(charts: PassingCharts, ground: Ground, change: Change, *, number: int) -> PassingCharts:
    """Charts of passing after a change."""
    ending, exiting = charts.ending.copy(), charts.exiting.copy()
    if change.kind is Kind.ROAD_CLOSED:
        ending[stretch_of(ground, change)] = KNOWN_TO_END  # traces that end there say nothing new
    if change.branch is not None:
        exiting[change.branch] = 0
    return replace(
        charts, ended=np.zeros_like(charts.ended), ended_since=np.full_like(charts.ended_since, number), ending=ending,
        ending_pending=np.zeros_like(charts.ending_pending), missed=np.zeros_like(charts.missed),
        missed_since=np.full_like(charts.missed_since, number), exiting=exiting,
        exiting_pending=np.zeros_like(charts.exiting_pending), silent=0.0,
    )  # fmt: skip
