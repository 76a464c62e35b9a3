"""Lattice: the arcs that the search tries, how finely it tells states apart, and what turning costs."""

import math
from typing import NamedTuple

import numpy as np

from wzsumo.frames import FloatArray, wrap_angle
from wzsumo.planning.footprint import Body, sweep_margin

# Smoothing overshoots where the curvature changes, by about a tenth: the search keeps some of the limit in hand.
_SHARE_OF_LIMIT = 0.85
_LADDER = np.array([1, 1 / 4, 1 / 16])  # curvatures: from what the speed allows to a lane change
_LARGEST_TURN = 0.35  # rad, of one arc
_LARGEST_MARGIN_M = 0.07  # what checking at intervals may cost in width


class Lattice(NamedTuple):
    """How the search steps and what a step costs beyond its length times the multiplier. Lengths in metres."""

    curvatures: FloatArray  # (k,) 1/m, of the arcs tried at each state
    sharpest: float  # 1/m, largest of them
    step_m: float  # length of an arc
    check_m: float  # distance between checked poses
    sweep_margin: float  # times curvature: by how much the body is wider in checks, for what it sweeps between two of them
    xy_bin_m: float  # states in one bin of position and heading count as one
    heading_bin: float  # rad
    turn_cost: float  # a metre at the sharpest curvature costs 1 + turn_cost
    change_cost_m: float  # of a change of curvature as large as the sharpest
    goal_range_m: float  # from here on states are tried to be joined with the goal


def lattice_for(body: Body, *, max_curvature: float, resolution: float, fineness: int) -> Lattice:
    """The lattice for a curvature limit [1/m]; steps and bins shrink in proportion to 1 / `fineness`.

    Steps of 4 m and bins of 0.5 m and 0.5 degrees at 10 m/s; tapers turn by 1 to 2 degrees. Tight limits shorten them.
    """
    sharpest = _SHARE_OF_LIMIT * max_curvature
    step = min(4.0, _LARGEST_TURN / sharpest) / fineness
    longest = max(body.front - body.rear, resolution)  # a point is checked in every cell
    check = min(1.0, step, longest, _LARGEST_MARGIN_M / max(body.front * sharpest, 1e-9)) / fineness
    return Lattice(
        curvatures=np.concatenate([[0.0], sharpest * _LADDER, -sharpest * _LADDER]),
        sharpest=sharpest,
        step_m=step,
        check_m=check,
        sweep_margin=sweep_margin(body, step_m=check),
        xy_bin_m=step / 8,
        heading_bin=max(sharpest * step / 8, math.radians(0.1)),
        turn_cost=0.3,
        change_cost_m=0.3,
        # A shift by a lane's width takes two arcs, 2 sqrt(width * radius) together.
        goal_range_m=40 + 4 * math.sqrt(3.6 / sharpest),
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
    """Ways (n, 2) from the start to the end of arcs: an arc that turns by a is longer than its chord by (a/2) / sin(a/2)."""
    half = lengths * curvatures / 2
    chord = lengths * np.sinc(half / np.pi)
    return np.column_stack([chord * np.cos(headings + half), chord * np.sin(headings + half)])
