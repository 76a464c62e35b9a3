"""Fixes: a table of fixes in the toolkit's columns and units, from anybody's table."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from wzsumo.errors import TraceError, shown
from wzsumo.files.fixes.coordinates import METRES_PER_UNIT, Placed, place_degrees, place_metres, speed_doubts
from wzsumo.files.fixes.dialects import Column, columns_of, of_the_same_name
from wzsumo.files.fixes.speeds import SPEED_UNITS, Steps, steps_between, unit_of_ratio
from wzsumo.files.fixes.sumo_fcd import is_fcd, moved_from_bumper, turned_to_north, without_empty_steps
from wzsumo.files.fixes.times import Times, are_clock_times, numbers_of, times_of, with_date
from wzsumo.frames import FloatArray, heading_from_sumo_angle
from wzsumo.geography import LocalFrame

# Standard deviation of one coordinate for a dilution of precision of 1: 4 m user-equivalent range error (GPS SPS Performance
# Standard 2020 gives 95 % below 8 m, global average, which is 4 m of one standard deviation).
RANGE_ERROR_M = 4.0
RADIUS_68_PER_SD = 1.51  # of a round normal distribution: sqrt(-2 ln 0.32); Android and iOS report the radius of 68 %
MAX_HEADING_ERROR_RAD = np.pi / 4  # median against the way that is driven; beyond it the column is not used. Chosen by us
MAX_NAMES_SHOWN = 300  # letters of a file's column names in a message
PLAUSIBLE_M = {"length_m": (0.5, 30.0), "width_m": (0.3, 5.0)}  # bicycle to road train; median of a column in metres


@dataclass(frozen=True, kw_only=True, eq=False)
class Fixes:
    """A table of fixes in metres and seconds (see `tables`), its rows as they stood.

    `frame` is the place of its metres on earth, None where nobody said it; `utc` says that times count from 1970-01-01 UTC.
    `said` tells how the file was read, `doubts` what may be wrong with it.
    """

    table: pd.DataFrame
    frame: LocalFrame | None = None
    utc: bool = False
    said: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


@dataclass(kw_only=True)
class _Words:
    said: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)


def fixes_of(
    raw: pd.DataFrame,
    *,
    columns: Mapping[str, str],
    crs: str | None,
    frame: LocalFrame | None,
    source: str,
    drive: str | None = None,
) -> Fixes:
    """The fixes of a raw table. `columns` names columns for meanings, `crs` what the coordinates are in, `frame` one to take.

    `drive` is the id where the table has none. Raises TraceError, in one line with the remedy, where it holds no fixes or its
    values cannot be what their columns say.
    """
    raw.columns = raw.columns.map(str)
    found = columns_of(list(raw.columns), chosen=columns, source=source)
    _refuse_two_of_one_name(raw, found, source=source)
    if is_fcd(found):
        raw = without_empty_steps(raw, found)
    words = _Words(said=[f"{column.name} is taken for {meaning}" for meaning, column in found.items() if column.by_end])
    ids = _ids(raw, found, drive=drive, words=words)
    if not len(raw) and len(raw.columns):
        return Fixes(table=_as_it_stands(raw, found))  # that it is empty is told by the check of trace tables
    if ids is None or "time" not in found or not ({"x", "y"} <= set(found) or {"lat", "lon"} <= set(found)):
        raise TraceError(f"{source}: {_what_is_missing(raw, found, has_ids=ids is not None)}")
    times = _times(raw, found, source=source)
    codes = np.asarray(pd.factorize(ids)[0], dtype=np.int64)
    steps = steps_between(codes, times.seconds)
    speed, reported = _speed_column(raw, found)
    placed = _placed(raw, found, steps, reported=reported, crs=crs, frame=frame, source=source)
    words.said += [*times.said, *placed.said]
    words.doubts += placed.doubts
    moved = steps if steps.elapsed.size else steps_between(codes, times.seconds, apart=1e-9)  # all within a few seconds
    words.doubts += speed_doubts(placed.points, moved)
    table = pd.DataFrame({"vehicle_id": ids})
    table["time_s"] = times.seconds
    kept = placed.as_given and found["x"].own
    for axis, name in enumerate(("x", "y")):  # as they stand where they are metres, so that a bad value can be named
        table[f"{name}_m"] = raw[found[name].name] if kept else placed.points[:, axis]
    _add_motion(table, raw, found, steps=steps, placed=placed, speed=speed, words=words)
    _add_sizes(table, raw, found, words=words, source=source)
    _add_accuracy(table, raw, found, words=words)
    if is_fcd(found) and "heading_rad" in table:
        table, said = moved_from_bumper(table)
        words.said.append(said)
    elif is_fcd(found):
        words.doubts.append("without angles SUMO's points stay at the front bumper, some 2.5 m ahead of the vehicle's middle")
    if "elevation" in found:
        words.said.append(f"{found['elevation'].name} is not used: maps are flat")
    return Fixes(table=table, frame=placed.frame, utc=times.utc, said=tuple(words.said), doubts=tuple(words.doubts))


def _as_it_stands(raw: pd.DataFrame, found: dict[str, Column]) -> pd.DataFrame:
    """The raw table with the columns that were found under the toolkit's names."""
    names = {"vehicle_id": "vehicle_id", "time": "time_s", "x": "x_m", "y": "y_m"}
    return raw.rename(columns={column.name: names[key] for key, column in found.items() if key in names})


def _refuse_two_of_one_name(raw: pd.DataFrame, found: dict[str, Column], *, source: str) -> None:
    """Raise TraceError where a column that is used has a second one of its name with other values."""
    for column in found.values():
        for other in of_the_same_name(column.name, list(raw.columns)):
            if not raw[other].equals(raw[column.name]):
                raise TraceError(
                    f"{source}: two columns are called {column.name} ({column.name}, {other}) and differ; rename one of them"
                )


def _what_is_missing(raw: pd.DataFrame, found: dict[str, Column], *, has_ids: bool) -> str:
    """What a table needs and has no column for, with the remedy."""
    lacking = [] if has_ids else ["vehicle_id"]
    lacking += [] if "time" in found else ["time"]
    plane = bool({"x", "y"} & set(found))
    place = [key for key in (("x_m", "y_m") if plane else ("lat", "lon")) if key.removesuffix("_m") not in found]
    lacking += place
    named = ", ".join(lacking) + (" (or x_m, y_m)" if place and not plane else "")
    remedy = " ".join(f"{key}=NAME" for key in lacking)
    given = ", ".join(map(str, raw.columns))
    return f"no column for {named}; say which holds what with --columns {remedy}; the file has {given[:MAX_NAMES_SHOWN]}"


def _times(raw: pd.DataFrame, found: dict[str, Column], *, source: str) -> Times:
    """Times of the rows, of a column of dates beside it where it holds times of day. Raises TraceError where it holds none."""
    column = raw[found["time"].name]
    if "date" in found and found["date"].name != found["time"].name and are_clock_times(column):
        column = with_date(column, raw[found["date"].name])
    times = times_of(column, unit=found["time"].unit, source=source)
    if times is None:
        first = str(column.iloc[0])[:40]
        raise TraceError(
            f"{source}: {column.name} of row 0 is {shown(first)}: neither seconds nor a date of a known form; give ISO 8601 as "
            "2026-06-01T14:00:00Z, or seconds since 1970"
        )
    return times


def _ids(raw: pd.DataFrame, found: dict[str, Column], *, drive: str | None, words: _Words) -> "pd.Series[str] | None":
    """Ids of the rows; the file's own name where it names no vehicles and its clock never runs back. None: there are none."""
    if "vehicle_id" in found:
        ids = raw[found["vehicle_id"].name]
        first = next(iter(ids.dropna()), None)
        if isinstance(first, list | dict | np.ndarray):
            return None
        if isinstance(first, bytes):
            ids = ids.map(lambda each: each.decode("utf-8", "backslashreplace"), na_action="ignore")
        known = [each for each in ids.dropna().unique() if isinstance(each, str)]
        spaced = [each for each in known if each != each.strip()]
        bare = {each.strip() for each in known if each.strip()}
        if merged := len([each for each in known if each.strip()]) - len(bare):
            words.doubts.append(f"{merged} vehicle ids differ from others in spaces alone and are taken for the same vehicles")
        return ids.replace({each: each.strip() or None for each in spaced}) if spaced else ids
    if drive is None or "time" not in found or raw.empty:
        return None
    times = times_of(raw[found["time"].name], unit=None, source="")
    if times is None or (np.diff(times.seconds[np.isfinite(times.seconds)]) < 0).any():
        return None
    words.said.append(f"no column of vehicle ids: taken as one drive, {drive}")
    return pd.Series(drive, index=raw.index, dtype="str")


def _numbers(raw: pd.DataFrame, column: Column) -> FloatArray:
    return numbers_of(raw[column.name])


def _speed_column(raw: pd.DataFrame, found: dict[str, Column]) -> tuple[FloatArray | None, FloatArray | None]:
    """(speeds as they stand, speeds [m/s]); the second is None where no unit is said."""
    if "speed" not in found:
        return None, None
    speed, unit = _numbers(raw, found["speed"]), found["speed"].unit
    return speed, speed * SPEED_UNITS[unit] if unit in SPEED_UNITS else None


def _placed(
    raw: pd.DataFrame, found: dict[str, Column], steps: Steps, *, reported: FloatArray | None, crs: str | None,
    frame: LocalFrame | None, source: str,
) -> Placed:  # fmt: skip
    plane = {"x", "y"} <= set(found) and (found["x"].own or not {"lat", "lon"} <= set(found))
    pair = (found["x"], found["y"]) if plane else (found["lon"], found["lat"])
    first, second = (_numbers(raw, column) for column in pair)
    if not (np.isfinite(first) & np.isfinite(second)).any():
        bad = pair[0] if not np.isfinite(first).any() else pair[1]
        raise TraceError(f"{source}: {bad.name} of row 0 is {shown(raw[bad.name].iloc[0])}; every value must be a number")
    place = place_metres if plane else place_degrees
    return place(first, second, steps, columns=pair, reported=reported, crs=crs, frame=frame, source=source)


def _add_motion(
    table: pd.DataFrame, raw: pd.DataFrame, found: dict[str, Column], *, steps: Steps, placed: Placed,
    speed: FloatArray | None, words: _Words,
) -> None:  # fmt: skip
    if speed is not None:
        unit = found["speed"].unit
        if unit not in SPEED_UNITS:
            ratio = steps.ratio_to(speed, placed.points)
            unit = unit_of_ratio(ratio)
            if unit is None:
                words.doubts.append(f"{found['speed'].name} fits no unit of speed and is not used")
            else:
                words.said.append(f"{found['speed'].name} is read as {unit}, by the distances driven")
        if unit is not None:
            table["speed_mps"] = speed * SPEED_UNITS[unit]
    if "heading" not in found:
        return
    column = found["heading"]
    if column.own:
        table["heading_rad"] = raw[column.name]
        return
    heading = _heading(_numbers(raw, column), unit=column.unit, placed=placed)
    off = _way_off(heading, steps, placed.points)
    if is_fcd(found) and placed.frame is not None and not placed.as_given:
        heading, said = turned_to_north(heading, off)
        words.said += [said] if said else []
    error = float(np.median(np.abs(off))) if off.size else 0.0
    if error > MAX_HEADING_ERROR_RAD:
        words.doubts.append(
            f"{column.name} is off the way that is driven by a median of {np.rad2deg(error):.0f} degrees and is not used"
        )
    else:
        table["heading_rad"] = heading


def _heading(values: FloatArray, *, unit: str | None, placed: Placed) -> FloatArray:
    """Headings [rad, counter-clockwise from +x] of compass directions: degrees clockwise from north, as all of them report."""
    degrees = np.rad2deg(values) if unit == "rad" else values
    turned = 0.0
    if placed.frame is not None:
        turned = placed.frame.north_at(np.nanmedian(placed.points, axis=0)) - np.pi / 2
    return heading_from_sumo_angle(degrees - np.rad2deg(turned))


def _way_off(heading: FloatArray, steps: Steps, points: FloatArray) -> FloatArray:
    """Angles (k,) [rad] from the headings of moving vehicles to the way that they drive, to the left."""
    way = points[steps.last] - points[steps.first]
    moved = np.hypot(*way.T) > 5.0
    off = np.arctan2(way[moved, 1], way[moved, 0]) - heading[steps.first[moved]]
    off = np.arctan2(np.sin(off), np.cos(off))
    return np.asarray(off[np.isfinite(off)])


def _add_sizes(table: pd.DataFrame, raw: pd.DataFrame, found: dict[str, Column], *, words: _Words, source: str) -> None:
    for name in ("length", "width"):
        if name not in found:
            continue
        column, key = found[name], f"{name}_m"
        sizes = _numbers(raw, column)
        if (bad := np.flatnonzero(sizes <= 0)).size:
            raise TraceError(
                f"{source}: {column.name} of row {bad[0]} is {sizes[bad[0]]:g} ({bad.size} of {len(sizes)} rows are "
                f"0 or less); a vehicle's {name} is above 0: correct it, empty the cell or leave the column out"
            )
        metres = sizes * METRES_PER_UNIT.get(column.unit, 1.0)
        low, high = PLAUSIBLE_M[key]
        usual = float(np.nanmedian(metres)) if np.isfinite(metres).any() else low
        if not low <= usual <= high:
            raise TraceError(
                f"{source}: the median of {column.name} is {usual:g} m; a vehicle's {name} is {low:g} to {high:g} m: say the "
                f"unit, as in --columns {name}_cm={column.name} or {name}_ft={column.name}, or leave the column out"
            )
        used = (metres >= low) & (metres <= high)
        if unused := int((raw[column.name].notna() & ~used).sum()):
            words.doubts.append(
                f"{column.name} is no {name} of {low:g} to {high:g} m in {unused} of {len(metres)} rows, and is not used there"
            )
        table[key] = np.where(used, metres, np.nan)


def _add_accuracy(table: pd.DataFrame, raw: pd.DataFrame, found: dict[str, Column], *, words: _Words) -> None:
    """Standard deviation [m] of each coordinate, from a radius of 68 % or from the dilution of precision."""
    if "accuracy" in found:
        column = found["accuracy"]
        metres = _numbers(raw, column) * METRES_PER_UNIT.get(None if column.unit == "sd" else column.unit, 1.0)
        table["position_sd_m"] = metres if column.own else metres / RADIUS_68_PER_SD
        if not column.own:
            words.said.append(f"{column.name} is read as the radius of 68 % [m]")
    elif "hdop" in found:
        table["position_sd_m"] = _numbers(raw, found["hdop"]) * RANGE_ERROR_M / np.sqrt(2)
        words.said.append(f"{found['hdop'].name} is read as the dilution of a range error of {RANGE_ERROR_M:g} m")
