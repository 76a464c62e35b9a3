"""What changed, by the traces since the change, and the lanes with that change: only its stretch is drawn anew."""

from dataclasses import replace

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.lane_map import LaneMap, MappedLane
from wzsumo.live.alarms import Change, Kind
from wzsumo.live.charts.findings import Family, Finding
from wzsumo.live.charts.lane_charts import MOVES_M
from wzsumo.live.charts.passing_charts import END_REACH_M
from wzsumo.live.charts.shape_charts import SIZES_M
from wzsumo.live.ground import Ground
from wzsumo.live.shift_fit import Shift, fit_shift
from wzsumo.live.trace.lane_use import REACH_M
from wzsumo.live.trace.recent import Recent
from wzsumo.live.trace.shape import BUMP_GAPS, EDGE_GAPS

P_CLOSED, P_OPEN = 0.08, 0.9  # that closed ground is open; that ground is which traces drove again
USED_SHARE = 0.05  # of the passing traces, up to which a lane counts as not driven
ODD_SHARE = 0.1  # of traces, or one, may seem to drive all along a closed lane: a receiver that is a lane off. Chosen by us
ODD_REACH_CELLS = 12  # inside a closure, from its end on, in which they are looked for
CONFIRMED_SHARE, CONFIRMED_SDS = 0.5, 3.0  # of the size that a chart looks for, and deviations, that a fitted shift must have
ALONE_SHARE = 0.5  # of a stretch on which no other lane is open
LATEST_STARTS = 12  # of the last traces, before each of which lanes may have moved; beyond, evidence grew slowly anyway
LEAST_USERS = 2  # traces that open ground


def shift_of(ground: Ground, finding: Finding, traces: Recent) -> tuple[int | None, Shift | None]:
    """(the lane that moved, None: all; by how much and where) of a finding about the lanes' shape."""
    chart, shape, size, cell = finding.at[:4]
    lane = None if chart == ground.n_lanes else chart
    if finding.family is Family.MOVED:
        gap = EDGE_GAPS[shape] + 1
        edges: tuple[int, int | None] = (cell + gap // 2, finding.at[4] + gap // 2)
    elif shape >= len(EDGE_GAPS):
        edges = (cell, cell + BUMP_GAPS[shape - len(EDGE_GAPS)] + 1)
    else:
        edges = (cell + EDGE_GAPS[shape] // 2, None)
    last = ground.closed.shape[1] if edges[1] is None else edges[1]
    others = np.delete(ground.closed, lane, axis=0)[:, edges[0] : last + 1] if lane is not None else None
    if others is not None and others.mean() > ALONE_SHARE:
        lane = None  # no other lane is open there, of which to say that it did not move
    return lane, fit_shift(ground, traces, lane=lane, edges=edges, positive=SIZES_M[size] > 0)


def change_point(ground: Ground, finding: Finding, traces: Recent) -> int:
    """Number of the last trace before the lanes moved: those behind it gain most by a shift."""
    gains = {}
    for first in range(max(0, len(traces) - LATEST_STARTS), len(traces)):
        _, shift = shift_of(ground, finding, traces[first:])
        gains[traces[first].number - 1] = -np.inf if shift is None else shift.gain
    return max(gains, key=lambda number: gains[number])


def confirmed(ground: Ground, finding: Finding, traces: Recent) -> bool:
    """Whether the traces since a change, fitted together, show the shift that a chart speaks for; true for other findings."""
    if finding.family not in (Family.STEP, Family.MOVED):
        return True
    _, shift = shift_of(ground, finding, traces)
    looked_for = abs(SIZES_M[finding.at[2]])
    return shift is not None and max(CONFIRMED_SHARE * looked_for, CONFIRMED_SDS * shift.size_sd) < abs(shift.size)


def with_shift(lanes: LaneMap, shift: Shift, *, lane: int | None) -> tuple[LaneMap, Change]:
    """The map with lanes moved by a shift."""
    by = shift.at(lanes.stations)
    sd = np.where(np.abs(by) > 0, shift.size_sd, 0.0)
    drawn = [
        replace(
            mapped, right=mapped.right + by, left=mapped.left + by, right_sd=np.hypot(mapped.right_sd, sd),
            left_sd=np.hypot(mapped.left_sd, sd),
        ) if lane in (None, number) else mapped
        for number, mapped in enumerate(lanes.lanes)
    ]  # fmt: skip
    change = Change(
        kind=Kind.SHIFTED, lane=lane, start_m=shift.start - shift.start_ramp / 2, start_sd_m=shift.start_sd,
        end_m=min(shift.end + shift.end_ramp / 2, float(lanes.stations[-1])), end_sd_m=shift.end_sd, size_m=shift.size,
        size_sd_m=shift.size_sd,
    )  # fmt: skip
    return replace(lanes, lanes=tuple(drawn)), change


def with_lane_change(ground: Ground, finding: Finding, traces: Recent) -> tuple[LaneMap, Change]:
    """The map with what a finding about lanes, exits or the road says, and the change in numbers."""
    lanes = ground.lanes
    if finding.family is Family.CLOSING:
        return _with_closed_lane(ground, finding.at[1], finding.at[2], traces)
    if finding.family is Family.OPENING:
        return _with_open_lane(ground, finding.at[0], traces)
    if finding.family is Family.END_MOVED:
        return _with_moved_end(ground, finding, traces)
    if finding.family is Family.ROAD_CLOSED:
        last = float(np.median([ground.cells[np.flatnonzero(t.in_lane.any(axis=0))[-1]] for t in traces]))
        change = Change(
            kind=Kind.ROAD_CLOSED, start_m=last, start_sd_m=END_REACH_M / 4, end_m=float(lanes.stations[-1]),
            end_sd_m=float(lanes.stations[-1]) - last,
        )  # fmt: skip
        drawn = [_with_p_open(lane, lanes.stations >= last, P_CLOSED) for lane in lanes.lanes]
        return replace(lanes, lanes=tuple(drawn)), change
    if finding.family is Family.EXIT_CLOSED:
        (branch,) = finding.at
        branches = list(lanes.branches)
        branches[branch] = replace(branches[branch], p_open=P_CLOSED)
        gate = ground.gates[branch]
        at = None if gate is None else gate[0]
        return replace(lanes, branches=tuple(branches)), Change(
            kind=Kind.EXIT_CLOSED, branch=branch, start_m=at, end_m=at, start_sd_m=ground.spacing, end_sd_m=ground.spacing
        )
    return lanes, Change(kind=Kind.SILENCE)


def _users(traces: Recent, lane: int) -> tuple[FloatArray, FloatArray]:
    """(traces (m,) that drove in a lane at each cell, traces that passed there)."""
    users = np.sum([trace.in_lane[lane] > 0.5 for trace in traces], axis=0)
    passing = np.sum([trace.in_lane.sum(axis=0) > 0.05 for trace in traces], axis=0)
    return np.asarray(users, dtype=float), np.asarray(passing, dtype=float)


def _odd_users(users: FloatArray, passing: FloatArray) -> float:
    """How many traces seem to drive in a lane all along cells (n,) in which it is closed: receivers that are a lane off."""
    if not users.size:
        return 0.0
    return float(min(users.min(), max(1.0, ODD_SHARE * passing.max())))


def _with_closed_lane(ground: Ground, lane: int, cell: int, traces: Recent) -> tuple[LaneMap, Change]:
    users, passing = _users(traces, lane)
    inside = slice(cell, cell + ODD_REACH_CELLS)
    users = users - _odd_users(users[inside], passing[inside])
    unused = (users <= USED_SHARE * passing) | ground.closed[lane]
    m = len(unused)
    first = cell
    while first < m - 1 and not unused[first]:
        first += 1
    start, end = first, first
    while start > 0 and unused[start - 1] and not ground.closed[lane, start - 1]:
        start -= 1
    while end < m - 1 and unused[end + 1]:
        end += 1
    # The last drivers leave ahead of the closure, and the first return behind it: half a gap between drivers off its ends.
    leaving = max(users[max(0, start - round(REACH_M / ground.spacing)) : start].max(initial=0.0), 1.0)
    returning = max(users[end + 1 : end + 1 + round(REACH_M / ground.spacing)].max(initial=0.0), 1.0)
    half = ground.spacing / 2
    start_m = ground.cells[start] - half + REACH_M / (leaving + 1) / 2
    end_m = ground.cells[end] + half - (REACH_M / (returning + 1) if end < m - 1 else 0.0)
    end_m = max(end_m, start_m + ground.spacing)
    # Drawn closed is all that nobody drives: between the last driver and the likeliest start nothing is known to be open.
    stations = ground.lanes.stations
    undriven = (stations >= ground.cells[start] - half) & (stations <= max(ground.cells[end] + half, end_m))
    mapped = _with_p_open(ground.lanes.lanes[lane], undriven, P_CLOSED)
    change = Change(
        kind=Kind.LANE_CLOSED, lane=lane, start_m=float(start_m), start_sd_m=float(np.hypot(half, REACH_M / (leaving + 1) / 2)),
        end_m=float(end_m), end_sd_m=float(np.hypot(half, REACH_M / (returning + 1))),
    )  # fmt: skip
    return _with_lane(ground.lanes, lane, mapped), change


def _with_open_lane(ground: Ground, lane: int, traces: Recent) -> tuple[LaneMap, Change]:
    users, _ = _users(traces, lane)
    start, end = ground.closures[lane]
    open_again = (users >= min(LEAST_USERS, max(users[start : end + 1].max(initial=0.0), 1.0))) & ground.closed[lane]
    cells = np.flatnonzero(open_again)
    first, last = (int(cells[0]), int(cells[-1])) if cells.size else (int(start), int(end))
    half = ground.spacing / 2
    start_m, end_m = float(ground.cells[first] - half), float(ground.cells[last] + half)
    stations = ground.lanes.stations
    inside = (stations >= start_m - half) & (stations <= end_m + half)
    mapped = _with_p_open(ground.lanes.lanes[lane], inside, P_OPEN)
    change = Change(
        kind=Kind.LANE_OPEN, lane=lane, start_m=start_m, start_sd_m=ground.spacing, end_m=end_m, end_sd_m=ground.spacing
    )
    return _with_lane(ground.lanes, lane, mapped), change


def _with_moved_end(ground: Ground, finding: Finding, traces: Recent) -> tuple[LaneMap, Change]:
    side, lane, move = finding.at
    start, end = ground.closures[lane]
    half = ground.spacing / 2
    old = float(ground.cells[start] - half if side == 0 else ground.cells[end] + half)
    new = _moved_end(ground, lane, side, traces, guess=old + MOVES_M[move])
    stations, mapped = ground.lanes.stations, ground.lanes.lanes[lane]
    between = (stations >= min(old, new)) & (stations <= max(old, new))
    closes = (new < old) == (side == 0)
    mapped = _with_p_open(mapped, between, P_CLOSED if closes else P_OPEN)
    sd = 25.0 + abs(MOVES_M[move]) / 6
    change = Change(
        kind=Kind.CLOSURE_START_MOVED if side == 0 else Kind.CLOSURE_END_MOVED, lane=lane, start_m=min(old, new),
        end_m=max(old, new), start_sd_m=sd, end_sd_m=sd, size_m=new - old, size_sd_m=sd,
    )  # fmt: skip
    return _with_lane(ground.lanes, lane, mapped), change


def _moved_end(ground: Ground, lane: int, side: int, traces: Recent, *, guess: float) -> float:
    """Station [m] of an end: where the last users leave the lane or the first return, if that is near what the charts say."""
    users, passing = _users(traces, lane)
    at = int(np.clip(np.searchsorted(ground.cells, guess), 1, len(ground.cells) - 2))
    step = -1 if side == 0 else 1
    inside = slice(at, at + ODD_REACH_CELLS) if side == 0 else slice(max(at - ODD_REACH_CELLS, 0), at)
    users = users - _odd_users(users[inside], passing[inside])
    unused = (users <= USED_SHARE * passing) & (passing > 0)
    inner = at - step * 4
    cell = int(np.clip(inner, 0, len(unused) - 1))
    while 0 < cell < len(unused) - 1 and unused[cell] and abs(cell - at) < 16:
        cell += step
    n = max(users[max(0, cell - 16) : cell + 16].max(initial=0.0), 1.0)
    found = float(ground.cells[cell] - step * (ground.spacing / 2 + REACH_M / (n + 1) / 2))
    return found if abs(found - guess) <= 75.0 else guess


def _with_p_open(lane: MappedLane, where: BoolArray, p_open: float) -> MappedLane:
    return replace(lane, p_open=np.where(where[:, None], p_open, lane.p_open))


def _with_lane(lanes: LaneMap, number: int, lane: MappedLane) -> LaneMap:
    drawn = list(lanes.lanes)
    drawn[number] = lane
    return replace(lanes, lanes=tuple(drawn))
