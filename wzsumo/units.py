"""Conversions between SI units and the US customary units of the MUTCD and the spec files."""

METRES_PER_INCH = 0.0254  # exact, international yard and pound agreement 1959
METRES_PER_FOOT = 0.3048  # exact, ibid.
METRES_PER_MILE = 1609.344  # exact, ibid.


def feet_from_metres(length_m: float) -> float:
    """Length [ft] of a length [m]."""
    return length_m / METRES_PER_FOOT


def mps_from_mph(speed_mph: float) -> float:
    """Speed [m/s] of a speed [mph].

    >>> round(mps_from_mph(60), 4)
    26.8224
    """
    return speed_mph * METRES_PER_MILE / 3600


def mph_from_mps(speed_mps: float) -> float:
    """Speed [mph] of a speed [m/s]."""
    return speed_mps * 3600 / METRES_PER_MILE
