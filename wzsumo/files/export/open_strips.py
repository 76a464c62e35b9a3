"""The open part of each lane of a map, in sections between whose ends the same lanes are open.

A lane is open where the strips across it are free; along a taper the free strips become fewer, and the lane's open part ends in
a point at the line of devices.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import FREE_THRESHOLD
from wzsumo.lane_map import LaneMap, MappedLane

MIN_OPEN_WIDTH_M = 0.3  # narrower is closed; chosen by us
MIN_SECTION_M = 5.0  # shorter openings and closings are passed over; chosen by us
SHARED_LINE_M = 0.6  # lines of neighbouring lanes that lie closer than this are one, in their middle; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenStrip:
    """The open part of a lane at stations (k,): offsets of its right and left side, and their standard deviations [m]."""

    lane: int
    right: FloatArray
    left: FloatArray
    right_sd: FloatArray
    left_sd: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenSection:
    """Stations (k,) [m] between which the same lanes are open, and the open part of each, from the right."""

    stations: FloatArray
    strips: tuple[OpenStrip, ...]


def open_sections(lanes: LaneMap) -> list[OpenSection]:
    """The sections of a map, in the order of travel; they join end to end, some without an open lane."""
    sides = [_open_sides(lane) for lane in lanes.lanes]
    open_ = np.array([_without_short_runs(left - right > MIN_OPEN_WIDTH_M, lanes.stations) for right, left in sides])
    lines = _with_shared_lines(sides, open_)
    n = len(lanes.stations)
    # Between two stations a lane is open if it is at both.
    between = open_[:, 1:] & open_[:, :-1] if len(open_) else np.zeros((0, n - 1), dtype=bool)
    cuts = [0, *(np.flatnonzero((between[:, 1:] != between[:, :-1]).any(axis=0)) + 1).tolist(), n - 1]
    sections = []
    for first, last in pairwise(cuts):
        part = slice(first, last + 1)
        strips = [
            OpenStrip(
                lane=index, right=lines[index][0][part], left=lines[index][1][part],
                right_sd=lane.right_sd[part], left_sd=lane.left_sd[part],
            )
            for index, lane in enumerate(lanes.lanes) if between[index, first]
        ]  # fmt: skip
        sections.append(OpenSection(stations=lanes.stations[part], strips=tuple(strips)))
    return sections


def _open_sides(lane: MappedLane) -> tuple[FloatArray, FloatArray]:
    """Offsets (n,) of the right and left side of the widest run of free strips; both the same where none is free."""
    free = lane.p_open > 1 - FREE_THRESHOLD
    n, m = free.shape
    length = np.zeros((n, m + 1), dtype=int)  # of the free run that ends before strip j
    for j in range(m):
        length[:, j + 1] = np.where(free[:, j], length[:, j] + 1, 0)
    ends = length.argmax(axis=1)
    starts = ends - length[np.arange(n), ends]
    width = (lane.left - lane.right) / m
    return lane.right + starts * width, lane.right + ends * width


def _without_short_runs(chosen: BoolArray, stations: FloatArray) -> BoolArray:
    """The same with runs of either kind that are shorter than MIN_SECTION_M turned into their surroundings."""
    kept = chosen.copy()
    for kind in (False, True):
        ends = np.flatnonzero(np.diff(np.concatenate([[False], kept == kind, [False]]).astype(int)))
        for first, end in zip(ends[::2], ends[1::2], strict=True):
            inner = first > 0 and end < len(kept)
            if inner and stations[end - 1] - stations[first] < MIN_SECTION_M:
                kept[first:end] = not kind
    return kept


def _with_shared_lines(sides: list[tuple[FloatArray, FloatArray]], open_: BoolArray) -> list[tuple[FloatArray, FloatArray]]:
    """The sides with those of neighbours that are both open, and nearly touch, moved to one line."""
    lines = [(right.copy(), left.copy()) for right, left in sides]
    for index in range(len(lines) - 1):
        left, right = lines[index][1], lines[index + 1][0]
        near = open_[index] & open_[index + 1] & (np.abs(right - left) < SHARED_LINE_M)
        middle = (left + right) / 2
        left[near], right[near] = middle[near], middle[near]
    return lines
