"""VerifiedZone: where a lane map shows a work zone to start and end, and what it does to the lanes on the way.

P(closed) along a lane is read as the distribution of where its closure begins, and backwards of where it ends: the median is
the end, half the distance from the 16 % to the 84 % point its standard deviation. A lane is shifted where it leaves its place
as quickly as lanes do in a shifting taper; slow drifts are those of the map's axis.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import FREE_THRESHOLD, OCCUPIED_THRESHOLD
from wzsumo.lane_map import LaneMap, MappedLane

SHIFTED_M = 1.0  # off its place; chosen by us
ON_PLACE_M = 0.3  # a shifted lane has left its place, or is back on it; three deviations of a good map. Chosen by us
# Sideways over along, of a lane that shifts: half of 2 / S at S = 75 mph, the flattest shifting taper (MUTCD 11th ed., Table
# 6B-3: 0.5 L = 0.5 W S).
MIN_SHIFT_RATE = 0.013
MIN_STRETCH_M = 20.0  # a shorter stretch belongs to the one before it; chosen by us
LOW, MIDDLE, HIGH = 0.16, 0.5, 0.84  # one standard deviation of a normal distribution to each side of its median


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Stations [m] between which the same lanes are closed or shifted; `statuses` are those of WZDx, from the right.

    The deviations [m] are those of the zone's own ends; None where another stretch goes on.
    """

    start: float
    end: float
    start_sd: float | None
    end_sd: float | None
    statuses: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class VerifiedZone:
    """Where a map shows a zone to start and end [m along its axis], with standard deviations [m], and the lanes it closes.

    A deviation is infinite where the map begins or ends within the zone. `shifted` are lanes that stay open and move aside.
    """

    start_m: float
    end_m: float
    start_sd_m: float
    end_sd_m: float
    closed_lanes: tuple[int, ...]
    shifted: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class _Span:
    lane: int
    status: str
    start: float
    end: float
    start_sd: float
    end_sd: float


def verified_zone(lanes: LaneMap) -> VerifiedZone | None:
    """The zone that a map shows; None where no lane is closed or shifted."""
    stretches = zone_stretches(lanes)
    if not stretches:
        return None
    by_lane = [{stretch.statuses[number] for stretch in stretches} for number in range(len(lanes.lanes))]
    first, last = stretches[0], stretches[-1]
    return VerifiedZone(
        start_m=first.start, end_m=last.end,
        start_sd_m=np.inf if first.start_sd is None else first.start_sd,
        end_sd_m=np.inf if last.end_sd is None else last.end_sd,
        closed_lanes=tuple(number for number, found in enumerate(by_lane) if "closed" in found),
        shifted=tuple(n for n, found in enumerate(by_lane) if "closed" not in found and found != {"open"}),
    )  # fmt: skip


def zone_stretches(lanes: LaneMap) -> list[Stretch]:
    """The stretches of a map along which some lane is closed or shifted, in the order of travel."""
    spans = [span for number, lane in enumerate(lanes.lanes) for span in _spans(lanes.stations, number, lane)]
    if not spans:
        return []
    ends = sorted({end for span in spans for end in (span.start, span.end)})
    cuts = [ends[0], *(cut for before, cut in pairwise(ends) if cut - before >= MIN_STRETCH_M)]
    cuts[-1] = ends[-1]
    found = []
    for start, end in pairwise(cuts):
        statuses = ["open"] * len(lanes.lanes)
        for span in sorted(spans, key=lambda span: span.status == "closed"):
            if span.start <= (start + end) / 2 <= span.end:
                statuses[span.lane] = span.status
        start_sd = max((span.start_sd for span in spans if span.start == start), default=None) if start == cuts[0] else None
        end_sd = max((span.end_sd for span in spans if span.end == end), default=None) if end == cuts[-1] else None
        found.append(Stretch(start=start, end=end, start_sd=start_sd, end_sd=end_sd, statuses=tuple(statuses)))
    return [stretch for stretch in found if set(stretch.statuses) != {"open"}]


def _spans(s: FloatArray, number: int, lane: MappedLane) -> list[_Span]:
    """Where a lane is closed, and where it is shifted."""
    found = []
    p_closed = 1 - lane.p_open.min(axis=1)
    for first, last in _runs(p_closed > MIDDLE, holding=p_closed > OCCUPIED_THRESHOLD):
        start, start_sd = _end(s, p_closed, first, -1)
        end, end_sd = _end(s, p_closed, last, 1)
        found.append(_Span(lane=number, status="closed", start=start, end=end, start_sd=start_sd, end_sd=end_sd))
    shift, drivable = _quick_shift(s, lane.middle), lane.p_open_middle > 1 - FREE_THRESHOLD
    for status, side in (("shift-left", shift), ("shift-right", -shift)):
        for first, last in _runs(side > ON_PLACE_M, holding=(side > SHIFTED_M) & drivable):
            # Along a shifting taper a lane's lines are as uncertain along the road as across it, over the taper's slope.
            across = np.maximum(lane.right_sd, lane.left_sd) / MIN_SHIFT_RATE
            start_sd, end_sd = (float(across[k]) if 0 < k < len(s) - 1 else np.inf for k in (first, last))
            found.append(
                _Span(lane=number, status=status, start=float(s[first]), end=float(s[last]), start_sd=start_sd, end_sd=end_sd)
            )
    return found


def _quick_shift(s: FloatArray, middle: FloatArray) -> FloatArray:
    """Offset (n,) [m] from a lane's place where the map begins, by its quick moves alone."""
    steps, along = np.diff(middle), np.diff(s)
    quick = np.where(np.abs(steps) > MIN_SHIFT_RATE * along, steps, 0.0)
    return np.concatenate([[0.0], np.cumsum(quick)])


def _end(s: FloatArray, p_closed: FloatArray, at: int, step: int) -> tuple[float, float]:
    """(median, standard deviation) [m] of where a closure ends, seen from station number `at` outwards by `step`."""
    outer, middle, inner = (_crossing(s, p_closed, at, step, level) for level in (LOW, MIDDLE, HIGH))
    if middle is None or outer is None:
        edge = float(s[-1] if step > 0 else s[0])  # the map ends before the lane is surely open
        return edge if middle is None else middle, float("inf")
    parts = [abs(outer - middle)] if inner is None else [abs(outer - middle), abs(middle - inner)]
    spacing = float(np.median(np.diff(s)))
    return middle, float(np.hypot(np.mean(parts), spacing / np.sqrt(12)))


def _crossing(s: FloatArray, p_closed: FloatArray, at: int, step: int, level: float) -> float | None:
    """The station at which P(closed) falls to a level outwards; None where the map ends before, or it is never so high."""
    number = at
    while p_closed[number] <= level:  # less sure than that here: look inwards
        number -= step
        if not 0 <= number < len(s) or p_closed[number] <= MIDDLE:
            return None
    while 0 <= number + step < len(s):
        if p_closed[number + step] <= level:
            a, b = p_closed[number], p_closed[number + step]
            return float(s[number] + (level - a) / (b - a) * (s[number + step] - s[number]))
        number += step
    return None


def _runs(chosen: BoolArray, *, holding: BoolArray) -> list[tuple[int, int]]:
    """(first, last) number of each run of `chosen` in which `holding` holds somewhere."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    runs = [(int(first), int(end) - 1) for first, end in zip(ends[::2], ends[1::2], strict=True)]
    return [(first, last) for first, last in runs if holding[first : last + 1].any()]
