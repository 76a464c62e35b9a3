"""Lines that drivers see on the pavement: edge lines, lane lines between lanes of one direction, centre lines between two."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Literal

import numpy as np

from wzsumo.files.result_folder import ResultFolder
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.work_zone import OpenLane

Kind = Literal["edge", "lane", "centre"]
STEP_M = 5.0  # between points of a line
SAME_LINE_M = 0.3  # two lanes whose edges are nearer to each other share a line; a line is 4 to 6 in wide (MUTCD 3A.04)


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneLine:
    """A line on the pavement: stations and offsets (n,) [m]."""

    kind: Kind
    stations: FloatArray
    offsets: FloatArray


def lane_lines(run: ResultFolder) -> list[LaneLine]:
    """The lines of all open lanes of a run, each once."""
    return [line for lane in run.lanes for line in _lines_of(lane, run.lanes)]


def _lines_of(lane: OpenLane, lanes: tuple[OpenLane, ...]) -> Iterator[LaneLine]:
    breaks = [profile.stations for profile in (lane.right, lane.left)]
    stations = np.unique(np.concatenate([np.arange(lane.start, lane.end, STEP_M), [lane.start, lane.end], *breaks]))
    stations = stations[(stations >= lane.start) & (stations <= lane.end)]
    for profile, is_left in ((lane.left, True), (lane.right, False)):
        offsets = profile(stations)
        alike, facing = (np.zeros(len(stations), dtype=bool) for _ in range(2))
        for other in lanes:
            if other is not lane:
                beside = _shares_line(other, stations, offsets, on_its_right=is_left)
                alike |= beside & (other.opposing == lane.opposing)
                facing |= beside & (other.opposing != lane.opposing)
        if is_left:
            names = np.select([alike, facing], ["lane", "centre"], default="edge")
        else:
            names = np.where(alike | facing, "", "edge")  # the lane to the right has drawn it as its left line
        yield from _runs(names, stations, offsets)


def _shares_line(other: OpenLane, stations: FloatArray, offsets: FloatArray, *, on_its_right: bool) -> BoolArray:
    profile = other.right if on_its_right else other.left
    there = (stations >= other.start) & (stations <= other.end)
    return np.asarray(there & (np.abs(profile(stations) - offsets) < SAME_LINE_M))


def _runs(names: FloatArray, stations: FloatArray, offsets: FloatArray) -> Iterator[LaneLine]:
    """Lines of the stretches with one name; a stretch goes on to the first point of the next, so that no gap is left."""
    for name, group in groupby(range(len(names)), key=lambda at: str(names[at])):
        rows = list(group)
        rows = [*rows, min(rows[-1] + 1, len(names) - 1)]
        if name and rows[-1] > rows[0]:
            yield LaneLine(kind=name, stations=stations[rows], offsets=offsets[rows])  # type: ignore[arg-type]  # one of Kind
