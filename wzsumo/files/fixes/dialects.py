"""Which column of anybody's table holds what: the names that data providers, receivers and SUMO use, and units in names.

Names are compared in lower case and without anything but letters and digits; a unit may follow, as in
`speed_mph`, `Heading(Deg)` or `time_ms`.

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
        "veh", "coredataid", "payloaddatacoredataid", "bsmid", "tempid", "temporaryid", "deviceid", "devid", "txdevice",
        "device", "hashedid", "userid", "driverid", "vin", "objectid", "id",
    ),
    "time": (
        "time", "timestamp", "capturedtimestamp", "timesteptime", "datetime", "gpsdatetime", "gpstime", "utctime", "utc",
        "recordedat", "capturedat", "metadatarecordgeneratedat", "recordgeneratedat", "metadatagenerateat", "gentime", "epoch",
        "epochtime", "unixtime", "unixtimestamp", "positiontime", "eventtime", "localtime", "ts", "t",
    ),
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
_OF_SPEED = {"ms": "m/s", "fts": "ft/s"}  # "Speed(m/s)" and "speed_ms" are no milliseconds


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a table: its name, the unit that the name says (None: none), whether the name is the toolkit's own."""

    name: str
    unit: str | None
    own: bool = False


def columns_of(names: list[str], *, chosen: Mapping[str, str], source: str) -> dict[str, Column]:
    """What each column of a table means, by its name; `chosen` names the columns of some meanings and wins.

    Raises TraceError where a chosen column is not there or a meaning is unknown.
    """
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
    return columns


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
