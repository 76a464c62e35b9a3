"""Lattice: the arcs that the search tries, how finely it tells states apart, and what turning costs."""

import math
from typing import NamedTuple

import numpy as np

from wzsumo.frames import FloatArray, wrap_angle
from wzsumo.planning.footprint import Body, sweep_margin

# Share of the curvature limit that the search uses: smoothing overshoots by about a tenth where the curvature changes.
_CURVATURE_SHARE = 0.85
_CURVATURE_RATIOS = np.array([1, 1 / 4, 1 / 16])  # to the sharpest: from what the speed allows to a lane change; chosen by us
_MAX_STEP_M, _MAX_CHECK_M = 4.0, 1.0  # length of an arc, and of the interval between checked poses on it; chosen by us
_MAX_TURN_RAD = 0.35  # of one arc; chosen by us
_MAX_SWEEP_MARGIN_M = 0.07  # width that the body is given in checks, for what it sweeps between them; chosen by us
_BINS_PER_STEP = 8  # position and heading bins along one arc; chosen by us
_MIN_HEADING_BIN_RAD = math.radians(0.1)
_TURN_COST = 0.3  # chosen by us
_CHANGE_COST_M = 0.3  # chosen by us
_GOAL_RANGE_M = 40.0  # of any lattice, plus two shifts by a lane; chosen by us
_LANE_WIDTH_M = 3.6  # 12 ft, as in the metric AASHTO Green Book


class Lattice(NamedTuple):
    """How the search steps and what a step costs beyond its length times the multiplier. Lengths in metres."""

    curvatures: FloatArray  # (k,) 1/m, of the arcs tried at each state
    sharpest: float  # 1/m, largest of them
    step_m: float  # length of an arc
    check_m: float  # distance between checked poses
    sweep_margin: float  # times curvature: how much wider the body is in checks, for what it sweeps between two of them
    xy_bin_m: float  # states in one bin of position and heading count as one
    heading_bin: float  # rad
    turn_cost: float  # a metre at the sharpest curvature costs 1 + turn_cost
    change_cost_m: float  # cost of a change of curvature by as much as the sharpest
    goal_range_m: float  # states nearer to the goal than this are tried to be connected with it


def lattice_for(body: Body, *, max_curvature: float, resolution: float, fineness: int) -> Lattice:
    """The lattice for a curvature limit [1/m]; steps and bins shrink in proportion to 1 / `fineness`.

    At 10 m/s steps are 4 m long and bins are 0.5 m and 0.5 degrees wide: tapers turn by 1 to 2 degrees. At lower speeds, where
    arcs may be sharper, steps and bins are smaller.
    """
    sharpest = _CURVATURE_SHARE * max_curvature
    step = min(_MAX_STEP_M, _MAX_TURN_RAD / sharpest) / fineness
    length = max(body.front - body.rear, resolution)  # a point is checked in every cell
    check = min(_MAX_CHECK_M, step, length, _MAX_SWEEP_MARGIN_M / max(body.front * sharpest, 1e-9)) / fineness
    return Lattice(
        curvatures=np.concatenate([[0.0], sharpest * _CURVATURE_RATIOS, -sharpest * _CURVATURE_RATIOS]),
        sharpest=sharpest,
        step_m=step,
        check_m=check,
        sweep_margin=sweep_margin(body, step_m=check),
        xy_bin_m=step / _BINS_PER_STEP,
        heading_bin=max(sharpest * step / _BINS_PER_STEP, _MIN_HEADING_BIN_RAD),
        turn_cost=_TURN_COST,
        change_cost_m=_CHANGE_COST_M,
        # A shift by a lane's width takes two arcs, together 2 sqrt(width * radius) long.
        goal_range_m=_GOAL_RANGE_M + 4 * math.sqrt(_LANE_WIDTH_M / sharpest),
    )


def poses_along(start: FloatArray, segments: FloatArray, *, max_step_m: float) -> FloatArray:
    """Poses (n, 3), evenly spaced by at most `max_step_m`, from `start` (3,) along segments (m, 2) of length and curvature.

    Segments follow one another with the same heading; both ends of the chain are among the poses.
    """
    lengths, curvatures = segments[:, 0], segments[:, 1]
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    headings = start[2] + np.concatenate([[0.0], np.cumsum(lengths * curvatures)])
    chords = _chords(headings[:-1], lengths, curvatures)
    corners = start[:2] + np.vstack([np.zeros((1, 2)), np.cumsum(chords, axis=0)])
    n = max(int(np.ceil(ends[-1] / max_step_m)), 1) + 1
    s = np.linspace(0.0, ends[-1], n)
    segment = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(segments) - 1)
    into = s - ends[segment]
    points = corners[segment] + _chords(headings[segment], into, curvatures[segment])
    return np.column_stack([points, wrap_angle(headings[segment] + into * curvatures[segment])])


def _chords(headings: FloatArray, lengths: FloatArray, curvatures: FloatArray) -> FloatArray:
    """Chords (n, 2) from the start to the end of arcs: an arc that turns by a is longer than its chord by (a/2) / sin(a/2)."""
    half = lengths * curvatures / 2
    chord = lengths * np.sinc(half / np.pi)
    return np.column_stack([chord * np.cos(headings + half), chord * np.sin(headings + half)])
