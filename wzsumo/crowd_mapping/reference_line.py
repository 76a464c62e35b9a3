"""The line that traces follow: a smooth road axis with arc length, found from the traces alone.

Of the longest traces the one that most others follow is smoothed by a least-squares cubic spline. The spline is then moved, a
few times, to the smooth course of all fixes' lateral offsets from it.
"""

from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.interpolate import make_lsq_spline

from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray, IntArray, arc_length
from wzsumo.road import Road

# Knots far enough apart that the axis follows bends and not the lateral shifts of a work zone, which last 35 to 250 m
# (MUTCD 11th ed., Table 6B-3, half of L): those stay in the lateral offsets, where they are found as kinks.
KNOT_SPACING_M = 300.0
# Where the line turns away from the points by more, as at a street corner, the knots lie nearer. A lane's shift stays below
MAX_OFF_AXIS_M, SHORTEST_KNOT_SPACING_M = 4.0, 20.0
N_NEIGHBOURS = 3  # points that together say that the line is off; chosen by us
POINT_SPACING_M = 5.0  # of the axis; chosen by us
CENTRING_ROUNDS = 3  # on bends of 300 m radius the axis moves by less than 1 cm in the third
MAX_FIXES = 100_000  # that are taken, evenly, for the axis: some per metre and lane of any zone
N_CANDIDATES = 6  # longest traces that are tried as the road; chosen by us
N_COMPARED_FIXES = 12  # of a trace, that tell whether it follows another; chosen by us
MAX_FOLLOWING_OFFSET_M = 20.0  # five lanes
MIN_EXTENT_M = 50.0  # a shorter trace says nothing about a road's direction; chosen by us
MIN_ADVANCE_M = 2.0  # between fixes that count: what is less is noise, or a vehicle that creeps or stands
MIN_CHORD_SHARE = 0.5  # of a trace's arc length: where its ends are nearer, its chord says nothing about its direction


def axis_of(line: FloatArray) -> Road:
    """A Road without width along points (n, 2): the frame in which stations and lateral offsets are counted."""
    return Road(reference_line=line, lane_widths=(0.0,), left_shoulder=0.0, right_shoulder=0.0)


def reference_line_from_traces(traces: pd.DataFrame) -> Road:
    """The axis that most traces of a trace table follow, in the direction in which most of them drive.

    Its lateral place among the lanes is arbitrary. Raises TraceError where no trace is long enough.
    """
    by_vehicle = [xy for xy in _lines(traces) if len(xy) > 1]
    extent = np.array([float(np.hypot(*np.ptp(xy, axis=0))) for xy in by_vehicle])
    by_extent = np.argsort(-extent, kind="stable")
    if not len(extent) or extent[by_extent[0]] < MIN_EXTENT_M:
        raise TraceError(
            f"the longest of {traces['vehicle_id'].nunique()} traces extends over {extent.max(initial=0.0):.1f} m; "
            f"a road's line needs one of at least {MIN_EXTENT_M:g} m; check that the coordinates are metres"
        )
    compared = [xy[np.unique(np.linspace(0, len(xy) - 1, N_COMPARED_FIXES).astype(int))] for xy in by_vehicle]
    # The longest trace may be one that went elsewhere, or the wrong way: what most others follow, driven as it is, is the road.
    longest = [i for i in _longest_either_way(by_vehicle, by_extent) if extent[i] > MIN_EXTENT_M]
    axis = max((axis_of(_smooth(by_vehicle[i])) for i in longest), key=lambda axis: _following(axis, compared))
    points = traces[["x_m", "y_m"]].to_numpy()[:: max(1, len(traces) // MAX_FIXES)]
    for _ in range(CENTRING_ROUNDS):
        axis = axis_of(_centred(axis, points))
    return axis


def _lines(traces: pd.DataFrame) -> list[FloatArray]:
    """Fixes (n, 2) [m] of each vehicle, in the order of their ids and of the table."""
    code, _ = pd.factorize(traces["vehicle_id"], sort=True)
    order = np.argsort(code, kind="stable")
    return np.split(np.column_stack([traces["x_m"], traces["y_m"]])[order], np.flatnonzero(np.diff(code[order])) + 1)


def _longest_either_way(by_vehicle: list[FloatArray], by_extent: IntArray) -> list[int]:
    """The N_CANDIDATES longest traces, up to half of them driven against the very longest, where there are such."""
    ways = np.array([xy[-1] - xy[0] for xy in by_vehicle])[by_extent]
    against = ways @ ways[0] < 0
    back = by_extent[against][: N_CANDIDATES // 2]
    return [int(i) for i in (*by_extent[~against][: N_CANDIDATES - len(back)], *back)]


def _following(axis: Road, compared: list[FloatArray]) -> float:
    """Length [m] along the axis that traces follow in its direction, summed over the traces."""
    starts = np.cumsum([0, *(len(fixes) for fixes in compared)])
    s, d = axis.to_sd(np.vstack(compared))
    near = (np.abs(d) < MAX_FOLLOWING_OFFSET_M) & (s >= 0) & (s <= axis.length)
    along = 0.0
    for first, end in pairwise(starts):
        beside = s[first:end][near[first:end]]
        if len(beside) > 1:
            along += max(float(beside[-1] - beside[0]), 0.0)
    return along


def _smooth(trace: FloatArray) -> FloatArray:
    """Points of a smooth line along the fixes (n, 2) of one trace, in time order."""
    # A vehicle that stands, or noise along its way, would fold the line back: only steps forward count.
    direction = trace[-1] - trace[0]
    chord = trace @ direction / np.hypot(*direction)
    furthest = np.floor(np.maximum.accumulate(chord - chord[0]) / MIN_ADVANCE_M)
    fixes = (
        trace[np.concatenate([[True], np.diff(furthest) > 0])]
        if np.hypot(*direction) > MIN_CHORD_SHARE * arc_length(trace)[-1]
        else _thinned(trace)
    )
    return _spline(arc_length(fixes), fixes)


def _thinned(trace: FloatArray) -> FloatArray:
    """Fixes of a trace at least POINT_SPACING_M apart, for roads that turn by more than a right angle."""
    kept = [trace[0]]
    for fix in trace[1:]:
        if np.hypot(*(fix - kept[-1])) >= POINT_SPACING_M:
            kept.append(fix)
    return np.array(kept)


def _centred(axis: Road, points: FloatArray) -> FloatArray:
    """Points (n, 2) of the axis moved to the smooth course of the fixes' lateral offsets, as long as the fixes reach."""
    s, d = axis.to_sd(points)
    near = np.abs(d - np.median(d)) < 5 * (np.median(np.abs(d - np.median(d))) + 1.0)
    order = np.argsort(s[near], kind="stable")
    s, d = s[near][order], d[near][order]
    # Means over short stretches weigh every place alike, however many fixes it has.
    cell = np.floor((s - s[0]) / POINT_SPACING_M).astype(int)
    count = np.bincount(cell)
    filled = count > 0
    mean_s = np.bincount(cell, weights=s)[filled] / count[filled]
    mean_d = np.bincount(cell, weights=d)[filled] / count[filled]
    return _spline(mean_s, axis.to_xy(mean_s, mean_d))


def _spline(along: FloatArray, points: FloatArray) -> FloatArray:
    """Points every POINT_SPACING_M of the least-squares cubic spline through points (n, 2) at arc lengths (n,) [m]."""
    length = along[-1] - along[0]
    ends = np.linspace(along[0], along[-1], max(2, int(np.ceil(length / KNOT_SPACING_M)) + 1))
    while True:
        # A knot interval without a point of its own would leave the spline undetermined (Schoenberg-Whitney).
        inner = [b for a, b in pairwise(ends[:-1]) if ((along > a) & (along < b)).sum() > 1]
        inner = inner if len(along) > 2 * len(inner) + 8 else []
        degree = min(3, len(along) - 1)
        full = np.concatenate([[along[0]] * (degree + 1), inner, [along[-1]] * (degree + 1)])
        spline = make_lsq_spline(along, points, full, k=degree)
        off = np.hypot(*(points - spline(along)).T)
        halves = [
            (a + b) / 2 for a, b in pairwise(ends)
            if b - a > 2 * SHORTEST_KNOT_SPACING_M and _longest_mean(off[(along >= a) & (along <= b)]) > MAX_OFF_AXIS_M
        ]  # fmt: skip
        if not halves:
            break
        ends = np.sort(np.concatenate([ends, halves]))
    return np.asarray(spline(np.linspace(along[0], along[-1], max(2, int(length / POINT_SPACING_M) + 1))))


def _longest_mean(off: FloatArray) -> float:
    """The largest of the means over some neighbours: single points may err."""
    width = min(N_NEIGHBOURS, len(off))
    return float(np.convolve(off, np.full(width, 1 / width), mode="valid").max()) if width else 0.0
