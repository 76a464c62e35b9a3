"""Poses along a chain of arcs."""

import numpy as np

from wzsumo.frames import FloatArray, wrap_angle


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
