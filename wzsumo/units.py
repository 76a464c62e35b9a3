"""SI values of the US customary units in which the MUTCD and spec files speak."""

METRES_PER_INCH = 0.0254  # exact, international yard and pound agreement 1959
METRES_PER_FOOT = 0.3048  # exact, ibid.
METRES_PER_MILE = 1609.344  # exact, ibid.


def metres_from_feet(length_ft: float) -> float:
    """Length [m] of a length [ft]."""
    return length_ft * METRES_PER_FOOT


def feet_from_metres(length_m: float) -> float:
    """Length [ft] of a length [m]."""
    return length_m / METRES_PER_FOOT


def metres_from_inches(length_in: float) -> float:
    """Length [m] of a length [in]."""
    return length_in * METRES_PER_INCH


def mps_from_mph(speed_mph: float) -> float:
    """Speed [m/s] of a speed [mph].

    >>> round(mps_from_mph(60), 4)
    26.8224
    """
    return speed_mph * METRES_PER_MILE / 3600


def mph_from_mps(speed_mps: float) -> float:
    """Speed [mph] of a speed [m/s]."""
    return speed_mps * 3600 / METRES_PER_MILE
