"""Shifts of a course: ramps between two kinks on a road that may bend."""

from dataclasses import dataclass

import numpy as np

from wzsumo.frames import FloatArray

RAMP_LENGTHS_M = np.arange(40.0, 261.0, 20.0)  # L/2 of MUTCD 11th ed., Table 6B-3: 3 ft at 45 mph to 14 ft at 75 mph
WINDOW_M = 150.0  # beside the ramp, where the road itself is taken for a cubic
LEAST_SHIFT_M = 0.6
LEAST_GAIN = 0.7  # share of the squares that the cubic leaves and the ramp explains


@dataclass(frozen=True, kw_only=True)
class Shift:
    """The course moves by `size` [m, positive to the left] from station `start` to `end` [m]."""

    start: float
    end: float
    size: float


def find_shifts(stations: FloatArray, course: FloatArray) -> list[Shift]:
    """Shifts of a course (n,) [m] at equally spaced stations (n,) [m], in order along it; none overlap."""
    found: list[tuple[float, Shift]] = []
    for length in RAMP_LENGTHS_M:
        for start in np.arange(stations[0] + 20.0, stations[-1] - length - 20.0, stations[1] - stations[0]):
            near = (stations > start - WINDOW_M) & (stations < start + length + WINDOW_M)
            s = (stations[near] - start - length / 2) / (WINDOW_M + length / 2)
            ramp = np.clip((stations[near] - start) / length, 0, 1) - 0.5
            road = np.vander(s, 4)
            basis = np.linalg.qr(road)[0]
            rest = course[near] - basis @ (basis.T @ course[near])
            own = ramp - basis @ (basis.T @ ramp)
            norm = float(own @ own)
            if norm < 1e-3:
                continue
            size = float(own @ rest) / norm
            gain = size * size * norm / max(float(rest @ rest), 1e-9)
            if abs(size) >= LEAST_SHIFT_M and gain >= LEAST_GAIN:
                found.append((size * size * norm * gain, Shift(start=float(start), end=float(start + length), size=size)))
    found.sort(key=lambda item: -item[0])
    kept: list[Shift] = []
    for _, shift in found:
        if all(shift.end < other.start + 10 or shift.start > other.end - 10 for other in kept):
            kept.append(shift)
    return sorted(kept, key=lambda shift: shift.start)
