"""Taper and buffer lengths by the MUTCD, in feet and mph as printed there, and the merging taper in SI units."""

import math

from wzsumo.errors import SpecError
from wzsumo.units import METRES_PER_FOOT, feet_from_metres, mph_from_mps

# Stopping sight distance as longitudinal buffer [ft] by speed [mph]: MUTCD 11th ed., Table 6B-2, p. 775.
STOPPING_SIGHT_DISTANCE_FT = {
    20: 115, 25: 155, 30: 200, 35: 250, 40: 305, 45: 360, 50: 425, 55: 495, 60: 570, 65: 645, 70: 730, 75: 820,
}  # fmt: skip
SHORT_TAPER_FT = (50.0, 100.0)  # one-lane two-way tapers, and downstream tapers per lane: MUTCD 11th ed., Table 6B-3, p. 775
FORMULAS_MEET_MPH = 42.5  # for measured speeds: the middle between 40 and 45 mph, between which the manual has no formula


def merging_taper_length_ft(speed_mph: float, *, offset_ft: float) -> float:
    """Minimum merging-taper length L [ft] for a lateral offset [ft] at a posted speed [mph].

    Raises SpecError between 40 and 45 mph, where the manual gives no formula.
    Source: MUTCD 11th ed., Section 6B.08, Tables 6B-3 (p. 775) and 6B-4: L = W S^2 / 60 up to 40 mph, L = W S from 45 mph.

    >>> merging_taper_length_ft(60, offset_ft=12)
    720
    """
    if not 0 <= offset_ft < math.inf:
        raise SpecError(f"offset_ft={offset_ft} must be a width of 0 or more feet")
    if not 20 <= speed_mph <= 75:
        raise SpecError(f"posted_speed_mph={speed_mph} must be 20 to 75 mph, the range of the manual's tables")
    if 40 < speed_mph < 45:
        raise SpecError(
            f"posted_speed_mph={speed_mph}: the MUTCD gives no taper formula between 40 and 45 mph; post 40 or 45 mph"
        )
    return offset_ft * _length_per_offset(speed_mph)


def merging_taper_m(speed_mps: float, *, width_m: float) -> float:
    """Length L [m] of a merging taper over a width [m] at a measured speed [m/s], which may be any.

    Source: as above; between 40 and 45 mph the formula of the nearer of the two speeds.
    """
    width_ft = feet_from_metres(width_m)
    return METRES_PER_FOOT * width_ft * _length_per_offset(mph_from_mps(speed_mps))


def shifting_taper_length_ft(speed_mph: float, *, offset_ft: float) -> float:
    """Minimum shifting-taper length [ft], L / 2. Source: MUTCD 11th ed., Table 6B-3."""
    return merging_taper_length_ft(speed_mph, offset_ft=offset_ft) / 2


def shoulder_taper_length_ft(speed_mph: float, *, offset_ft: float) -> float:
    """Minimum shoulder-taper length [ft], L / 3. Source: MUTCD 11th ed., Table 6B-3."""
    return merging_taper_length_ft(speed_mph, offset_ft=offset_ft) / 3


def downstream_taper_length_ft(lane_count: int, *, per_lane_ft: float) -> float:
    """Length [ft] of the taper behind the work space, 50 to 100 ft per lane. Source: MUTCD 11th ed., Table 6B-3.

    >>> downstream_taper_length_ft(2, per_lane_ft=100)
    200
    """
    return lane_count * _short_taper_ft(per_lane_ft, key="downstream_taper_ft")


def one_lane_two_way_taper_length_ft(length_ft: float) -> float:
    """Length [ft] of the taper into a lane that both directions share, 50 to 100 ft. Source: MUTCD 11th ed., Table 6B-3.

    It is short because traffic has stopped, or can stop, ahead of it.
    """
    return _short_taper_ft(length_ft, key="one_lane_two_way_taper_ft")


def buffer_length_ft(speed_mph: float) -> float:
    """Longitudinal buffer [ft]: the stopping sight distance of the lowest speed in the manual's table that is no lower.

    Source: MUTCD 11th ed., Table 6B-2. Raises SpecError above 75 mph.
    """
    for speed, length in STOPPING_SIGHT_DISTANCE_FT.items():
        if speed_mph <= speed:
            return length
    raise SpecError(f"posted_speed_mph={speed_mph} must be 20 to 75 mph, the range of the manual's tables")


def _length_per_offset(speed_mph: float) -> float:
    """L / W of a merging taper: S from 45 mph, S^2 / 60 up to 40 mph (MUTCD 11th ed., Table 6B-4)."""
    return speed_mph if speed_mph >= FORMULAS_MEET_MPH else speed_mph**2 / 60


def _short_taper_ft(length_ft: float, *, key: str) -> float:
    shortest, longest = SHORT_TAPER_FT
    if not shortest <= length_ft <= longest:
        raise SpecError(f"{key}={length_ft} must be {shortest:g} to {longest:g} ft (MUTCD 11th ed., Table 6B-3)")
    return length_ft
