"""From the coordinates of anybody's table to metres of a frame, and what tells that they are not what they seem.

Degrees become metres of a frame around them. Coordinates that cannot be what their columns say are refused with the remedy: the
speeds that they would mean decide, and reported speeds where there are any. What is ambiguous is never converted silently.
"""

from dataclasses import dataclass

import numpy as np

from wzsumo.errors import TraceError
from wzsumo.files.fixes.dialects import Column
from wzsumo.files.fixes.speeds import MAX_USUAL_MPS, SPEED_UNITS, UNIT_TOLERANCE, Steps, unit_of_ratio
from wzsumo.frames import FloatArray
from wzsumo.geography import LocalFrame, crs_name, frame_of_crs, local_frame, lonlat_of_crs, read_crs
from wzsumo.units import METRES_PER_FOOT

METRES_PER_UNIT = {None: 1.0, "m": 1.0, "ft": METRES_PER_FOOT, "cm": 0.01}
# Degrees per unit: integers of SAE J2735 and of phones (1e-7, 1e-6), and the semicircles of receivers (FIT, NMEA 2000).
METRES_PER_DEGREE = 111_320.0  # of latitude; of longitude at the equator
DEGREES_PER_UNIT = {"e7": 1e-7, "e6": 1e-6, "semicircles": 180 / 2**31}
MAX_LATITUDE_DEG = 75.0  # no road of a work zone lies nearer to a pole (Nordkapp: 71 degrees)
WEB_MERCATOR_FROM_M, WEB_MERCATOR_UNTIL_M = 2.5e6, 20_037_509.0  # |x| beyond any UTM or State Plane easting in metres
MIN_ADVANCE_SHARE = 0.5  # of the way that one vehicle goes; what jumps to and fro is several under one id. Chosen by us
MAX_DECIMALS = 9  # of numbers that were rounded for a purpose; a double of three digits before the point holds 13
COARSE_M = 0.5  # steps of rounded coordinates that are told: a seventh of a lane. Chosen by us
DEGREES_SPAN = 5.0  # coordinates of one file that are degrees lie within this; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """Points (n, 2) [m], their frame (None: no place on earth), what was done, and what to doubt.

    `as_given` says that the points are the table's own numbers.
    """

    points: FloatArray
    frame: LocalFrame | None
    as_given: bool = False
    said: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def place_degrees(
    lon: FloatArray, lat: FloatArray, steps: Steps, *, columns: tuple[Column, Column], reported: FloatArray | None,
    crs: str | None, frame: LocalFrame | None, source: str,
) -> Placed:  # fmt: skip
    """Points of longitudes and latitudes (n,), in `frame` or else in one around them.

    `reported` (n,) are speeds [m/s], where there are any whose unit is known. Raises TraceError where they are no degrees.
    """
    degrees, said = _degrees(lon, lat, steps, columns=columns, reported=reported, source=source)
    _refuse_swapped(degrees, steps, columns=columns, reported=reported, source=source)
    if crs is not None and not read_crs(crs).is_geographic:
        raise TraceError(f"{source}: {columns[1].name} and {columns[0].name} are degrees, but --crs {crs} is no CRS of degrees")
    if crs is not None:
        degrees = lonlat_of_crs(crs, degrees)
    found = frame or local_frame(degrees)
    points = found.from_lonlat(degrees)
    return Placed(
        points=np.where(np.isfinite(points), points, np.nan),
        frame=found,
        said=(*said, f"{columns[1].name} and {columns[0].name} are projected to metres"),
        doubts=_coarse_steps(degrees, METRES_PER_DEGREE, columns=columns),
    )


def place_metres(
    x: FloatArray, y: FloatArray, steps: Steps, *, columns: tuple[Column, Column], reported: FloatArray | None,
    crs: str | None, frame: LocalFrame | None, source: str,
) -> Placed:  # fmt: skip
    """Points of plane coordinates (n,), in the frame of their CRS where one is given, else in none.

    Raises TraceError where they cannot be metres, or the CRS does not hold them.
    """
    unit = columns[0].unit
    if unit not in METRES_PER_UNIT or columns[1].unit != unit:
        units = " and ".join(str(column.unit) for column in columns)
        raise TraceError(f"{source}: {columns[0].name} and {columns[1].name} in {units}: give both in m, ft or cm")
    points = np.column_stack([x, y])
    if crs is not None:
        found, in_frame = frame_of_crs(crs, points)
        if frame is not None and frame != found:
            in_frame = frame.from_lonlat(lonlat_of_crs(crs, points))
        kept = frame or found
        said = () if kept.crs == crs else (f"coordinates in {crs_name(crs)} are projected to {crs_name(kept.crs)}",)
        _refuse_other_units(in_frame, steps, remedy=f"see whether --crs {crs_name(crs)} is theirs", source=source)
        doubts = _coarse_steps(points, 1.0, columns=columns)
        return Placed(points=in_frame, frame=kept, as_given=not said, said=said, doubts=doubts)
    points = points * METRES_PER_UNIT[unit]
    if _look_like_degrees(points, steps):
        if columns[0].own:
            raise TraceError(_degrees_words(points, steps, columns, source=source))
        return place_degrees(x, y, steps, columns=columns, reported=reported, crs=None, frame=frame, source=source)
    if frame is not None:
        raise TraceError(
            f"{source}: its coordinates are metres without a CRS, but those of the files before, or of the road, have a place: "
            "give --crs, or map them apart"
        )
    doubts = _check_metres(points, steps, columns=columns, reported=reported, source=source)
    doubts += _coarse_steps(points, 1.0, columns=columns)
    return Placed(points=points, frame=None, as_given=unit == "m", doubts=doubts)


def speed_doubts(points: FloatArray, steps: Steps) -> tuple[str, ...]:
    """A doubt where vehicles get on faster than any traffic, or so slowly that their times are milliseconds."""
    speed = steps.usual_speed(points)
    in_ms = speed < 0.1 and 1.0 < 1000 * speed < MAX_USUAL_MPS
    if not (speed > MAX_USUAL_MPS or in_ms) or steps.advance_share(points) <= MIN_ADVANCE_SHARE:
        return ()
    return (f"vehicles would move at {speed:.3g} m/s from fix to fix: see the units of the times and coordinates",)


def _degrees(
    lon: FloatArray, lat: FloatArray, steps: Steps, *, columns: tuple[Column, Column], reported: FloatArray | None, source: str
) -> tuple[FloatArray, tuple[str, ...]]:
    """(longitudes and latitudes (n, 2) [degrees], what was done)."""
    raw = np.column_stack([lon, lat])
    unit = columns[0].unit
    if unit in DEGREES_PER_UNIT:
        return raw * DEGREES_PER_UNIT[unit], ()
    size = np.nanmedian(np.abs(raw), axis=0)
    if (size <= 180).all():
        if size.min() > 90:
            raise TraceError(f"{source}: {columns[1].name} {raw[0, 1]:g} is no latitude; it lies between -90 and 90 degrees")
        return raw, ()
    names = f"{columns[1].name} {raw[0, 1]:g} and {columns[0].name} {raw[0, 0]:g}"
    fitting: dict[str, float] = {}  # how far the speeds are off, as a logarithm; 0 where none are reported
    remedies: dict[str, str] = {}
    for unit_name, per_unit in DEGREES_PER_UNIT.items():
        # What can be no latitude may be a longitude: then the columns are exchanged.
        exchanged = bool(size[1] * per_unit > MAX_LATITUDE_DEG >= size[0] * per_unit)
        ways = raw[:, ::-1] if exchanged else raw
        of_lon, of_lat = columns[::-1] if exchanged else columns
        remedies[unit_name] = f"--columns lat_{unit_name}={of_lat.name} lon_{unit_name}={of_lon.name}"
        if 1.0 < size.max() * per_unit <= 180 and (exchanged or size[1] * per_unit <= MAX_LATITUDE_DEG):
            points = local_frame(ways * per_unit).from_lonlat(ways * per_unit)
            off = abs(np.log(steps.ratio_to(reported, points))) if reported is not None else 0.0
            if not off > UNIT_TOLERANCE and 1.0 < steps.usual_speed(points) < MAX_USUAL_MPS:
                fitting[unit_name] = off
    best = sorted(fitting, key=fitting.__getitem__)
    if best and (len(best) == 1 or fitting[best[0]] < fitting[best[1]] / 2):
        per_unit = DEGREES_PER_UNIT[best[0]]
        return raw * per_unit, (f"{names} are read as {best[0]} ({per_unit:.3g} degrees a unit), by the speeds",)
    tried = " or ".join(remedies[unit_name] for unit_name in fitting or remedies)
    raise TraceError(f"{source}: {names} are no degrees; say what they are: {tried}")


def _refuse_swapped(
    degrees: FloatArray, steps: Steps, *, columns: tuple[Column, Column], reported: FloatArray | None, source: str
) -> None:
    """Raise TraceError where latitude and longitude are exchanged: no road is there, or only so do speeds agree."""
    size = np.nanmedian(np.abs(degrees), axis=0)
    swapped = degrees[:, ::-1]
    reason = ""
    if size[1] > MAX_LATITUDE_DEG >= size[0]:
        reason = f"no road lies at latitude {np.nanmedian(degrees[:, 1]):.4f}"
    elif reported is not None and size[0] <= MAX_LATITUDE_DEG:
        ratios = [steps.ratio_to(reported, local_frame(way).from_lonlat(way)) for way in (degrees, swapped)]
        if abs(np.log(ratios[0])) > UNIT_TOLERANCE > abs(np.log(ratios[1])):
            reason = f"vehicles would move {ratios[0]:.2f} times as fast as they report, and exchanged {ratios[1]:.2f} times"
    if reason:
        lat, lon = columns[1].name, columns[0].name
        raise TraceError(f"{source}: {lat} and {lon} seem exchanged: {reason}; give --columns lat={lon} lon={lat}")


def _look_like_degrees(points: FloatArray, steps: Steps) -> bool:
    """Whether points can be degrees and vehicles would stand still if they were metres."""
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite) or not ((np.abs(finite) <= (180, 90)).all() and np.ptp(finite, axis=0).max() <= DEGREES_SPAN):
        return False
    in_metres = steps.usual_speed(local_frame(finite).from_lonlat(points))
    return bool(0.5 < in_metres < 2 * MAX_USUAL_MPS and steps.usual_speed(points) < 0.05)


def _degrees_words(points: FloatArray, steps: Steps, columns: tuple[Column, Column], *, source: str) -> str:
    x, y = columns[0].name, columns[1].name
    speed = steps.usual_speed(local_frame(points).from_lonlat(points))
    return (
        f"{source}: {x} {points[0, 0]:.5f} and {y} {points[0, 1]:.5f} look like longitude and latitude in degrees, not metres "
        f"(as degrees, vehicles move at about {speed:.0f} m/s); give --columns lon={x} lat={y}"
    )


def _check_metres(
    points: FloatArray, steps: Steps, *, columns: tuple[Column, Column], reported: FloatArray | None, source: str
) -> tuple[str, ...]:
    """Doubts about coordinates that are called metres. Raises TraceError where they are feet, Mercator or of another clock."""
    x, y = columns[0].name, columns[1].name
    size = np.nanmedian(np.abs(points), axis=0)
    if WEB_MERCATOR_FROM_M < size[0] < WEB_MERCATOR_UNTIL_M and size[1] < WEB_MERCATOR_UNTIL_M:
        raise TraceError(
            f"{source}: {x} {points[0, 0]:.0f} and {y} {points[0, 1]:.0f} look like Web Mercator, whose metres are none on the "
            "ground; give --crs EPSG:3857, or the CRS that they are in"
        )
    as_feet = f"give --columns x_ft={x} y_ft={y} if they are feet"
    _refuse_other_units(points, steps, remedy=f"{as_feet}, and see that times are seconds", source=source)
    speed = steps.usual_speed(points)
    if speed < 0.1 and 1.0 < 1000 * speed < MAX_USUAL_MPS and steps.advance_share(points) > MIN_ADVANCE_SHARE:
        raise TraceError(
            f"{source}: vehicles would move at {speed:.3f} m/s, at {1000 * speed:.0f} m/s if the times are milliseconds; give "
            "--columns time_ms=NAME with the name of their column"
        )
    if reported is None:
        return ()
    ratio = steps.ratio_to(reported, points)
    if not abs(np.log(ratio)) > UNIT_TOLERANCE:
        return ()
    if abs(np.log(ratio * METRES_PER_FOOT)) < UNIT_TOLERANCE:
        raise TraceError(f"{source}: vehicles move {ratio:.2f} times as fast as they report, as in feet; {as_feet}")
    unit = unit_of_ratio(ratio)
    other = f"as if speeds were in {unit} ({SPEED_UNITS[unit]:.3g} m/s)" if unit else "as in Web Mercator or other units"
    return (
        f"vehicles move {ratio:.2f} times as fast from fix to fix as they report, {other}; see the units of {x}, {y} and speed",
    )


def _refuse_other_units(points: FloatArray, steps: Steps, *, remedy: str, source: str) -> None:
    """Raise TraceError where vehicles would be faster than any traffic in metres, and in feet would not."""
    speed = steps.usual_speed(points)
    if MAX_USUAL_MPS < speed < MAX_USUAL_MPS / METRES_PER_FOOT and steps.advance_share(points) > MIN_ADVANCE_SHARE:
        raise TraceError(
            f"{source}: in metres and seconds vehicles would move at {speed:.0f} m/s ({speed / 0.44704:.0f} mph), in feet at "
            f"{speed * METRES_PER_FOOT:.0f} m/s; {remedy}"
        )


def _coarse_steps(values: FloatArray, metres_per_unit: float, *, columns: tuple[Column, Column]) -> tuple[str, ...]:
    """A doubt where both coordinates (n, 2) were rounded to steps that a map of lanes feels."""
    some = values[np.isfinite(values).all(axis=1)][:: max(1, len(values) // 2000)]
    steps_m = [_rounding_step(axis) * metres_per_unit for axis in some.T]
    step_m = max(steps_m)
    if min(steps_m) <= 0 or step_m < COARSE_M:
        return ()
    names = f"{columns[1].name} and {columns[0].name}"
    return (f"{names} are rounded to steps of {step_m:.2g} m: the map can be no finer",)


def _rounding_step(values: FloatArray) -> float:
    """The step to which all values (n,) were rounded, by decimals or as numbers of 4 bytes; 0 where they were not."""
    if not len(values):
        return 0.0
    for decimals in range(MAX_DECIMALS + 1):
        if (np.abs(values - np.round(values, decimals)) < 1e-9 * 10.0**-decimals + 1e-15 * np.abs(values)).all():
            return float(10.0**-decimals)
    if np.abs(values).max() > np.finfo(np.float32).max:
        return 0.0
    short = values.astype(np.float32)
    return float(np.spacing(np.abs(short).max())) if (short == values).all() else 0.0
