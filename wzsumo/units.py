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


# The ends of keys and columns that name a unit.
UNITS = {
    "ft": "ft", "m": "m", "m2": "m2", "mm": "mm", "mps": "m/s", "mps2": "m/s2", "mps3": "m/s3", "mph": "mph", "kph": "km/h",
    "s": "s", "ms": "ms", "h": "h", "vph": "veh/h", "pcphpl": "pc/h/lane", "hz": "Hz", "kg": "kg", "kgm2": "kg m2",
    "deg": "deg", "rad": "rad", "radps": "rad/s", "nprad": "N/rad", "1pm": "1/m", "1ps": "1/s", "1ps2": "1/s2", "pct": "%",
}  # fmt: skip


def unit_of(key: str) -> str:
    """The unit that a key or column names at its end; "" where it names none.

    >>> unit_of("target_speed_mps"), unit_of("gyro_bias_deg_per_s"), unit_of("lane_count")
    ('m/s', 'deg/s', '')
    """
    name, per, below = key.partition("_per_")
    unit = UNITS.get(name.rpartition("_")[2], "")
    if not per:
        return unit if "_" in key else ""
    root = below.removeprefix("sqrt_")
    under = UNITS.get(root, root)
    under = f"sqrt({under})" if root != below else f"({under})" if "/" in under else under
    return f"{unit or '1'}/{under}"


def without_unit(key: str) -> str:
    """A key or column in words, without the unit at its end.

    >>> without_unit("target_speed_mps"), without_unit("n_traces")
    ('target speed', 'n traces')
    """
    name = key.partition("_per_")[0]
    bare = name.rpartition("_")[0] if unit_of(key) and name.rpartition("_")[2] in UNITS else name
    return bare.replace("_", " ")
