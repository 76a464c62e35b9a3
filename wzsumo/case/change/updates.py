"""What a live map tells the ego, trace by trace: new lanes, and places at which they are doubtful."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.crowd_mapping.lanes.lane_mapping import map_lanes
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.frames import BoolArray
from wzsumo.lane_map import LaneMap
from wzsumo.live.alarms import Alarm
from wzsumo.live.live_map import LiveMap, live_map, with_trace
from wzsumo.live.stream.arrivals import Arrival
from wzsumo.live.stream.replay import evidence_by_cell
from wzsumo.live.trace.reading import read_trace

YOUNG_MARGIN_M = 100.0  # beside a stretch that is being drawn anew: its ends may lie off by that. Chosen by us
MIN_DOUBTFUL_M = 100.0  # a doubtful place is at least so long, and so are gaps between two; chosen by us

Stretches = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Update:
    """The live map after a trace that changed its lanes or its doubts.

    `lanes` are those to drive on, `doubtful` the stations (from, to) [m] at which they may be wrong; `redrawn` says whether
    `lanes` differ from those of the update before. `n_traces` counts the traces since the change of the zone.
    """

    time_s: float
    lanes: LaneMap
    redrawn: bool
    doubtful: Stretches
    alarm: Alarm | None
    n_traces: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Settled:
    """A live map that knows the zone as it was, and the alarms that it raised without a change."""

    live: LiveMap
    false_alarms: tuple[Alarm, ...]


def settled_map(before: Sequence[Arrival], road: MapBefore, *, mapped_traces: int) -> Settled:
    """The live map that begins with a map of the first traces, after all the others."""
    lanes = map_lanes(_table(before[:mapped_traces]), before=road).lanes
    live, alarms = live_map(lanes), []
    for after, alarm, _ in _steps(live, before[mapped_traces:]):
        live = after
        alarms += [alarm] if alarm else []
    return Settled(live=live, false_alarms=tuple(alarms))


def updates_of(live: LiveMap, arrivals: Sequence[Arrival], *, doubtful_share: float) -> tuple[Update, ...]:
    """The updates after the traces, in their order; the first is the live map as it is given, known all along.

    A place is doubtful where the evidence is `doubtful_share` of an alarm's, and for a time where lanes were drawn anew.
    """
    doubtful = doubtful_stretches(live, doubtful_share=doubtful_share)
    found = [Update(time_s=-np.inf, lanes=live.ground.lanes, redrawn=False, doubtful=doubtful, alarm=None, n_traces=0)]
    version = live.version
    for number, (after, alarm, end_s) in enumerate(_steps(live, arrivals), start=1):
        doubtful = doubtful_stretches(after, doubtful_share=doubtful_share)
        redrawn = after.version > version
        if redrawn or doubtful != found[-1].doubtful:
            found.append(
                Update(time_s=end_s, lanes=after.ground.lanes, redrawn=redrawn, doubtful=doubtful, alarm=alarm, n_traces=number)
            )
        version = after.version
    return tuple(found)


def doubtful_stretches(live: LiveMap, *, doubtful_share: float) -> Stretches:
    """Stations (from, to) [m] at which the lanes may be wrong, in order."""
    ground = live.ground
    doubtful = evidence_by_cell(live) >= doubtful_share
    if live.redrawing is not None:
        before, now = live.redrawing.before.lanes, ground.lanes
        doubtful |= np.interp(ground.cells, now.stations, _differs(before, now), left=0, right=0) > 0
        reach = round(YOUNG_MARGIN_M / ground.spacing)
        doubtful = np.convolve(doubtful, np.ones(2 * reach + 1), mode="same") > 0
    reach = max(1, round(MIN_DOUBTFUL_M / 2 / ground.spacing))
    wide = np.convolve(doubtful, np.ones(2 * reach + 1), mode="same") > 0
    ends = np.flatnonzero(np.diff(np.r_[False, wide, False].astype(int)))
    half = ground.spacing / 2
    return tuple(
        (float(ground.cells[a] - half), float(ground.cells[b - 1] + half)) for a, b in zip(ends[::2], ends[1::2], strict=True)
    )


def _differs(before: LaneMap, now: LaneMap) -> BoolArray:
    """Whether the lanes of two maps on the same stations (n,) differ there."""
    return np.any(
        [
            (a.p_open != b.p_open).any(axis=1) | (a.right != b.right) | (a.left != b.left)
            for a, b in zip(before.lanes, now.lanes, strict=True)
        ],
        axis=0,
    )


def _steps(live: LiveMap, arrivals: Sequence[Arrival]) -> Iterator[tuple[LiveMap, Alarm | None, float]]:
    for arrival in arrivals:
        stations, offsets = live.ground.lanes.axis.to_sd(arrival.points)
        reading = read_trace(live.ground, stations, offsets, arrival.times, length=arrival.length)
        if reading is not None:
            step = with_trace(live, reading)
            live = step.live
            yield live, step.alarm, arrival.end_s


def _table(arrivals: Sequence[Arrival]) -> pd.DataFrame:
    parts = [
        pd.DataFrame({"vehicle_id": f"t{number:05d}", "time_s": one.times, "x_m": one.points[:, 0], "y_m": one.points[:, 1]})
        for number, one in enumerate(arrivals)
    ]
    return pd.concat(parts, ignore_index=True)
