"""Shifts of a course: ramps between two kinks on a road that may bend.

In a window around each place that a shift may have, least squares fit a cubic (the road itself) and a ramp (the shift). What
counts as a shift is a ramp of a plausible size and length that explains most of what the cubic alone leaves.
"""

from dataclasses import dataclass

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.tapers import merging_taper_m

RAMP_LENGTHS_M = np.arange(40.0, 261.0, 20.0)  # L/2 of MUTCD 11th ed., Table 6B-3: 3 ft at 45 mph to 14 ft at 75 mph
WINDOW_MARGIN_M = 150.0  # on either side of the ramp, where the road itself is taken for a cubic; chosen by us
END_MARGIN_M = 20.0  # a shift neither begins nor ends as close to an end of the course; chosen by us
MIN_SIZE_M, MAX_SIZE_M = 0.6, 5.0  # up to a lane's width and some more; chosen by us
MIN_EXPLAINED_SHARE = 0.7  # of the squares that the cubic alone leaves, by the ramp; set on our simulated traffic
# Between a ramp's length and the manual's for its size, either way: zones are set out by pacing, and ends are blurred. By us.
MAX_LENGTH_FACTOR = 1.7
MAX_OVERLAP_M = 10.0  # of two shifts: a station's spacing
MAX_SHIFTS = 4  # of one zone: away from the work and back, each in two steps at most


@dataclass(frozen=True, kw_only=True)
class Shift:
    """The course moves by `size` [m, positive to the left] from station `start` to `end` [m]."""

    start: float
    end: float
    size: float


def find_shifts(stations: FloatArray, course: FloatArray, *, speed_mps: float) -> list[Shift]:
    """Shifts of a course (n,) [m] at equally spaced stations (n,) [m], in order along it.

    A shift is about as long as a shifting taper for its size at the zone's speed, L/2: a far longer one is the road's own.
    """
    candidates: list[tuple[float, Shift]] = []
    for length in RAMP_LENGTHS_M:
        # The stations are equally spaced: away from the ends all windows of one length have the same shape.
        shapes: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}
        for at, start in enumerate(stations):
            if start < stations[0] + END_MARGIN_M or start > stations[-1] - length - END_MARGIN_M:
                continue
            first, last = np.searchsorted(stations, (start - WINDOW_MARGIN_M, start + length + WINDOW_MARGIN_M))
            key = (at - int(first), int(last - first))
            if key not in shapes:
                shapes[key] = _ramp_beside_cubic(stations[first:last] - start, length)
            cubics, ramp = shapes[key]
            rest = course[first:last] - cubics @ (cubics.T @ course[first:last])
            norm = float(ramp @ ramp)
            size = float(ramp @ rest) / max(norm, 1e-9)
            explained = size * size * norm / max(float(rest @ rest), 1e-9)
            if norm > 1e-3 and explained >= MIN_EXPLAINED_SHARE and _is_plausible(size, length, speed_mps=speed_mps):
                shift = Shift(start=float(start), end=float(start + length), size=size)
                candidates.append((size * size * norm * explained, shift))
    return _best_apart(candidates)


def _ramp_beside_cubic(s: FloatArray, length: float) -> tuple[FloatArray, FloatArray]:
    """(orthonormal cubics (n, 4), the part (n,) of a ramp that they cannot stand for) at stations s from the ramp's start."""
    cubics = np.linalg.qr(np.vander((s - length / 2) / (WINDOW_MARGIN_M + length / 2), 4))[0]
    ramp = np.clip(s / length, 0, 1) - 0.5
    return cubics, ramp - cubics @ (cubics.T @ ramp)


def _is_plausible(size: float, length: float, *, speed_mps: float) -> bool:
    """Whether a ramp may be the shift of a work zone, by its size and by its length for that size."""
    usual = merging_taper_m(speed_mps, width_m=max(abs(size), MIN_SIZE_M)) / 2
    return MIN_SIZE_M <= abs(size) <= MAX_SIZE_M and usual / MAX_LENGTH_FACTOR < length < usual * MAX_LENGTH_FACTOR


def _best_apart(candidates: list[tuple[float, Shift]]) -> list[Shift]:
    """The shifts of highest score that lie apart, in order along the course; none where there are too many for a zone."""
    candidates.sort(key=lambda candidate: -candidate[0])
    kept: list[Shift] = []
    for _, shift in candidates:
        if all(shift.end < other.start + MAX_OVERLAP_M or shift.start > other.end - MAX_OVERLAP_M for other in kept):
            kept.append(shift)
    # A winding road whose line was found from traces leaves as many ramps as it has turns: the line cuts them.
    return sorted(kept, key=lambda shift: shift.start) if len(kept) <= MAX_SHIFTS else []
