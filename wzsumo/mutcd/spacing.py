"""Channelizing devices and advance-warning signs: how far apart, and how large the devices are."""

import math

from wzsumo.units import METRES_PER_INCH
from wzsumo.work_zone import DeviceKind, RoadType

# Height and radius of the outline on the ground [m]. Heights: MUTCD 11th ed., Sections 6K.03 (cones) and 6K.07 (drums,
# 18 in wide). A 28 or 36 in cone stands on a base of about 14 in square: radius 7 in. An F-shape concrete barrier is 32 in
# high and about 24 in wide at its foot (AASHTO Roadside Design Guide, ch. 9).
DEVICE_SIZE_M = {
    DeviceKind.CONE_28_IN: (28 * METRES_PER_INCH, 7 * METRES_PER_INCH),
    DeviceKind.CONE_36_IN: (36 * METRES_PER_INCH, 7 * METRES_PER_INCH),
    DeviceKind.DRUM: (36 * METRES_PER_INCH, 9 * METRES_PER_INCH),
    DeviceKind.BARRIER: (32 * METRES_PER_INCH, 12 * METRES_PER_INCH),
}
BARRIER_SEGMENT_FT = 12.5  # length of one piece of the wall (AASHTO Roadside Design Guide, ch. 9: 8 to 30 ft in use)
SHORT_TAPER_SPACING_FT = 20.0  # in downstream and one-lane two-way tapers: MUTCD 11th ed., Section 6B.08

# Distances A, B, C [ft]: from the first taper to the nearest sign, from it to the second, from that to the third.
# Source: MUTCD 11th ed., Table 6B-1, p. 773.
SIGN_SPACING_FT = {
    RoadType.URBAN_LOW_SPEED: (100, 100, 100),
    RoadType.URBAN_HIGH_SPEED: (350, 350, 350),
    RoadType.RURAL: (500, 500, 500),
    RoadType.FREEWAY: (1000, 1500, 2640),
}


def taper_spacing_ft(speed_mph: float) -> float:
    """Largest device spacing [ft] in a taper: the speed in mph. Source: MUTCD 11th ed., Section 6K.01, p. 815."""
    return speed_mph


def tangent_spacing_ft(speed_mph: float) -> float:
    """Largest device spacing [ft] in a tangent: twice the speed in mph. Source: MUTCD 11th ed., Section 6K.01, p. 815."""
    return 2 * speed_mph


def device_gaps(length_ft: float, *, spacing_ft: float) -> int:
    """Number of equal gaps that a stretch needs to keep the spacing; one device more than gaps stands on it.

    >>> device_gaps(720, spacing_ft=60)
    12
    """
    return max(1, math.ceil(length_ft / spacing_ft - 1e-9))
