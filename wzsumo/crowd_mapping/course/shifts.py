"""Shifts of a course: ramps between two kinks on a road that may bend."""

from dataclasses import dataclass

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.tapers import merging_taper_m

RAMP_LENGTHS_M = np.arange(40.0, 261.0, 20.0)  # L/2 of MUTCD 11th ed., Table 6B-3: 3 ft at 45 mph to 14 ft at 75 mph
WINDOW_M = 150.0  # beside the ramp, where the road itself is taken for a cubic
LEAST_SHIFT_M, MOST_SHIFT_M = 0.6, 5.0  # a lane's width and some more
MOST_SHIFTS = 4  # of one zone: away from the work and back, each in two steps at most
LEAST_GAIN = 0.7  # share of the squares that the cubic leaves and the ramp explains
MOST_OFF = 1.7  # factor between a ramp's length and the manual's for its size: zones are set out by pacing, ends are blurred


@dataclass(frozen=True, kw_only=True)
class Shift:
    """The course moves by `size` [m, positive to the left] from station `start` to `end` [m]."""

    start: float
    end: float
    size: float


def find_shifts(stations: FloatArray, course: FloatArray, *, speed_mps: float) -> list[Shift]:
    """Shifts of a course (n,) [m] at equally spaced stations (n,) [m], in order along it; none overlap.

    A shift is about as long as a shifting taper for its size at the zone's speed, L/2: what is far longer is the road's own.
    So are shifts without end.
    """
    found: list[tuple[float, Shift]] = []
    for length in RAMP_LENGTHS_M:
        shapes: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}
        for at, start in enumerate(stations):
            if start < stations[0] + 20.0 or start > stations[-1] - length - 20.0:
                continue
            first, last = np.searchsorted(stations, (start - WINDOW_M, start + length + WINDOW_M))
            # The stations are equally spaced: away from the ends all windows of one length have the same shape.
            key = (at - int(first), int(last - first))
            if key not in shapes:
                shapes[key] = _ramp_beside_cubic(stations[first:last] - start, length)
            basis, own = shapes[key]
            rest = course[first:last] - basis @ (basis.T @ course[first:last])
            norm = float(own @ own)
            size = float(own @ rest) / max(norm, 1e-9)
            gain = size * size * norm / max(float(rest @ rest), 1e-9)
            usual = merging_taper_m(speed_mps, width_m=max(abs(size), LEAST_SHIFT_M)) / 2
            as_usual = usual / MOST_OFF < length < usual * MOST_OFF
            if norm > 1e-3 and LEAST_SHIFT_M <= abs(size) <= MOST_SHIFT_M and as_usual and gain >= LEAST_GAIN:
                found.append((size * size * norm * gain, Shift(start=float(start), end=float(start + length), size=size)))
    found.sort(key=lambda item: -item[0])
    kept: list[Shift] = []
    for _, shift in found:
        if all(shift.end < other.start + 10 or shift.start > other.end - 10 for other in kept):
            kept.append(shift)
    # A winding road leaves as many ramps as it has turns, where its line was found from traces and cuts them.
    return sorted(kept, key=lambda shift: shift.start) if len(kept) <= MOST_SHIFTS else []


def _ramp_beside_cubic(s: FloatArray, length: float) -> tuple[FloatArray, FloatArray]:
    """(orthonormal cubics (n, 4), the ramp's part (n,) that they cannot stand for) at stations s from the ramp's start."""
    basis = np.linalg.qr(np.vander((s - length / 2) / (WINDOW_M + length / 2), 4))[0]
    ramp = np.clip(s / length, 0, 1) - 0.5
    return basis, ramp - basis @ (basis.T @ ramp)
