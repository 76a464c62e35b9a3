"""Which column of anybody's table holds what: the names that data providers, receivers and SUMO use, and units in names.

Names are compared in lower case and without anything but letters and digits; a unit may follow, as in
`speed_mph`, `Heading(Deg)` or `time_ms`. Where none has the name of something that is needed, the one
column counts whose last words are such a name, as in `start_lat` or `event_timestamp`.

Sources of the names: probe-data tables of vehicle makers (journeyId, capturedTimestamp), the Connected Vehicle Pilots' BSM
tables on data.transportation.gov (coreData_*), the Safety Pilot Model Deployment (DevID, Gentime), the US DOT work zone data
collection tool (GPS Date & Time), SUMO's FCD output (vehicle_x, timestep_time), GPX 1.1 (ele, hdop).
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from wzsumo.errors import TraceError

# Names by what they mean, the finest and most usual first.
NAMES = {
    "vehicle_id": (
        "vehicleid", "journeyid", "tripid", "traceid", "trackid", "driveid", "vehicle", "trip", "journey", "trace", "vehid",
        "veh", "trajectoryid", "uuid", "coredataid", "payloaddatacoredataid", "bsmid", "tempid", "temporaryid", "deviceid",
        "devid", "txdevice",
        "device", "hashedid", "userid", "driverid", "vin", "objectid", "id",
    ),
    "time": (
        "time", "timestamp", "capturedtimestamp", "timesteptime", "datetime", "gpsdatetime", "gpstime", "utctime", "utc",
        "recordedat", "capturedat", "metadatarecordgeneratedat", "recordgeneratedat", "metadatagenerateat", "gentime", "epoch",
        "epochtime", "unixtime", "unixtimestamp", "positiontime", "eventtime", "localtime", "ts", "t", "date",
    ),
    "date": ("date", "localdate", "utcdate", "gpsdate", "day"),
    "x": ("x", "vehiclex", "easting", "utmx", "xcoordinate", "posx", "positionx"),
    "y": ("y", "vehicley", "northing", "utmy", "ycoordinate", "posy", "positiony"),
    "lat": (
        "latitude", "lat", "gpslat", "gpslatitude", "coredatapositionlat", "coredatapositionlatitude", "coredatalat",
        "payloaddatacoredatapositionlatitude", "positionlat", "locationlatitude", "locationlat", "rxlat",
    ),
    "lon": (
        "longitude", "lon", "lng", "long", "gpslon", "gpslong", "gpslongitude", "coredatapositionlong",
        "coredatapositionlongitude", "coredatalong", "payloaddatacoredatapositionlongitude", "positionlong",
        "locationlongitude", "locationlng", "rxlon",
    ),
    "heading": (
        "heading", "vehicleangle", "angle", "course", "bearing", "yaw", "gpsheading", "track", "coredataheading",
        "payloaddatacoredataheading",
    ),
    "speed": ("speed", "vehiclespeed", "velocity", "gpsspeed", "coredataspeed", "payloaddatacoredataspeed"),
    "length": ("length", "vehiclelength", "coredatasizelength", "payloaddatacoredatasizelength"),
    "width": ("width", "vehiclewidth", "coredatasizewidth", "payloaddatacoredatasizewidth"),
    "accuracy": ("accuracy", "horizontalaccuracy", "gpsaccuracy", "haccuracy", "hacc", "positionaccuracy", "positionsd"),
    "hdop": ("hdop", "gpshdop"),
    "elevation": ("elevation", "altitude", "ele", "alt", "z", "coredataelevation", "coredatapositionelevation", "vehiclez"),
}  # fmt: skip
UNITS = {
    "s": "s", "sec": "s", "seconds": "s", "ms": "ms", "msec": "ms", "millis": "ms", "milliseconds": "ms",
    "us": "us", "microseconds": "us", "ns": "ns", "utc": "utc", "m": "m", "meters": "m", "metres": "m", "ft": "ft",
    "feet": "ft",
    "deg": "deg", "degrees": "deg", "degree": "deg", "rad": "rad", "radians": "rad", "mps": "m/s", "kmh": "km/h", "kph": "km/h",
    "kmph": "km/h", "mph": "mph", "kn": "kn", "knots": "kn", "cm": "cm", "fps": "ft/s",
    "e6": "e6", "e7": "e7", "semicircles": "semicircles", "microdegrees": "e6",
}  # fmt: skip
NEEDED = ("vehicle_id", "time", "lat", "lon")  # what a column is looked for by the last words of its name
MAX_COLUMNS = 2000
LEAST_NAME = 3  # letters: shorter ones, as "id" and "x", end many names that mean something else
_OF_SPEED = {"ms": "m/s", "fts": "ft/s"}  # "Speed(m/s)" and "speed_ms" are no milliseconds


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a table: its name, the unit that the name says (None: none), whether the name is the toolkit's own.

    `by_end` says that it was found by the last words of its name.
    """

    name: str
    unit: str | None
    own: bool = False
    by_end: bool = False


def columns_of(names: list[str], *, chosen: Mapping[str, str], source: str) -> dict[str, Column]:
    """What each column of a table means, by its name; `chosen` names the columns of some meanings and wins.

    Raises TraceError where a chosen column is not there or a meaning is unknown.
    """
    if len(names) > MAX_COLUMNS:
        raise TraceError(f"{source}: has {len(names)} columns; a table of traces has at most {MAX_COLUMNS}")
    found: dict[str, tuple[int, Column]] = {}
    for name in names:
        for meaning, rank, unit in _meanings(name):
            if meaning not in found or rank < found[meaning][0]:
                found[meaning] = (rank, Column(name=name, unit=unit, own=rank < 0))
    columns = {meaning: column for meaning, (_, column) in found.items()}
    for key, name in chosen.items():
        meaning, unit = _chosen_meaning(key, source=source)
        if name not in names:
            raise TraceError(f"{source}: --columns {key}={name}: no such column; the file has {', '.join(names)}")
        own_unit = next((u for m, _, u in _meanings(name) if m == meaning), None) or _trailing_unit(name)
        columns = {other: column for other, column in columns.items() if column.name != name}
        columns[meaning] = Column(name=name, unit=unit or own_unit)
    return columns | _by_last_words(names, columns, source=source)


def may_hold_ids(name: str) -> bool:
    """Whether a column of that name may be the one of vehicle ids."""
    return any(meaning == "vehicle_id" for meaning, _, _ in _meanings(name)) or bool(_ends_with(name, "vehicle_id"))


def of_the_same_name(name: str, names: list[str]) -> list[str]:
    """The other columns that are called so, but for capitals, spaces or the number that readers add to a repeated name."""
    bare = name.strip().lower()
    numbered = re.compile(re.escape(bare) + r"(\.\d+)?")
    return [other for other in names if other != name and numbered.fullmatch(other.strip().lower())]


OWN = {
    "vehicle_id": ("vehicle_id", None), "time_s": ("time", "s"), "x_m": ("x", "m"), "y_m": ("y", "m"),
    "heading_rad": ("heading", "rad"), "speed_mps": ("speed", "m/s"), "length_m": ("length", "m"), "width_m": ("width", "m"),
    "position_sd_m": ("accuracy", "sd"),
}  # fmt: skip


def _meanings(name: str) -> list[tuple[str, int, str | None]]:
    """(meaning, rank, unit) of a column's name; the toolkit's own names rank -1."""
    if name in OWN:
        meaning, unit = OWN[name]
        return [(meaning, -1, unit)]
    bare = re.sub(r"[^a-z0-9]", "", name.lower())
    found: list[tuple[str, int, str | None]] = []
    for meaning, names in NAMES.items():
        for rank, known in enumerate(names):
            if bare == known:
                found.append((meaning, rank, None))
            elif bare.startswith(known) and (unit := _unit(bare.removeprefix(known), meaning)):
                found.append((meaning, rank, unit))
    return found


def _by_last_words(names: list[str], columns: dict[str, Column], *, source: str) -> dict[str, Column]:
    """Columns for what is needed and was not found. Raises TraceError where two end alike: which is meant, their user knows."""
    plane = {"x", "y"} <= set(columns)
    taken = {column.name for column in columns.values()}
    found = {}
    for meaning in NEEDED:
        if meaning in columns or (plane and meaning in {"lat", "lon"}):
            continue
        ending = [(name, unit) for name in names if name not in taken for unit in _ends_with(name, meaning)]
        if len(ending) > 1:
            choices = " or ".join(f"--columns {meaning}={name}" for name, _ in ending[:4])
            raise TraceError(f"{source}: {len(ending)} columns may hold {meaning}; say which: {choices}")
        if ending:
            found[meaning] = Column(name=ending[0][0], unit=ending[0][1], by_end=True)
    return found


def _ends_with(name: str, meaning: str) -> list[str | None]:
    """The unit behind a column's name, in a list, where its last words are a name of that meaning; else nothing."""
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]
    for unit, rest in ((None, words), (_unit(words[-1], meaning) if words else None, words[:-1])):
        for first in range(1, len(rest)) if rest is words or unit else ():
            end = "".join(rest[first:])
            if end in NAMES[meaning] and len(end) >= LEAST_NAME and (meaning != "vehicle_id" or end.endswith("id")):
                return [unit]
    return []


def _unit(word: str, meaning: str) -> str | None:
    return _OF_SPEED.get(word, UNITS.get(word)) if meaning == "speed" else UNITS.get(word)


def _trailing_unit(name: str) -> str | None:
    word = re.split(r"[^A-Za-z]+", name.rstrip(")]"))[-1].lower()
    return UNITS.get(word)


def _chosen_meaning(key: str, *, source: str) -> tuple[str, str | None]:
    if key in OWN:
        return OWN[key]
    meaning, _, unit = key.rpartition("_")
    if meaning in NAMES and unit in UNITS:
        return meaning, _unit(unit, meaning)
    if key in NAMES:
        return key, None
    known = ", ".join([*OWN, "time", "lat", "lon", "heading", "speed"]) + ", and these with a unit, as x_ft or time_ms"
    raise TraceError(f"{source}: --columns {key}=...: {key} is no column of a trace table; known: {known}")
