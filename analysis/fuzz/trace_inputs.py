"""Bad and odd traces in every format that is read, for `map` and `live`: one function a kind of input."""

import gzip
import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from damage import NUMBERS, VALUES, break_key, damaged
from networks import road_of_network

ORIGIN = 42.28, -83.74  # degrees: a place in Michigan
DEGREES_PER_METRE = 1 / 111_320.0
NAMES = {
    "vehicle_id": ("journeyId", "id", "trip", "vehicle_id", ""),
    "time_s": ("capturedTimestamp", "time_ms", "t", "timestamp", "time_s"),
    "x_m": ("x", "x_ft", "longitude", "easting", "x_m"), "y_m": ("y", "y_ft", "latitude", "northing", "y_m"),
    "heading_rad": ("heading", "course", "Heading(Deg)"), "speed_mps": ("speed", "speed_mph", "Speed(m/s)"),
    "length_m": ("length", "length_ft"), "width_m": ("width", "width_cm"),
}  # fmt: skip
CELLS: tuple[Any, ...] = (
    "", " ", "nan", "NaN", "inf", "-inf", "NULL", "None", "x", "0", "-1", "1e300", "-1e300", "1e-300", "1,5", "9" * 400, "²",
    "2026-06-01T12:00:00Z", "2026-13-45", "12:00", "\x1b[2J", "=1+1", "\u202e", '"', "a" * 5000, "True", "0x10", "1e400",
)  # fmt: skip
COLUMN_VALUES: tuple[Any, ...] = (
    0, -1, 1e9, 1e300, 1e-300, float("nan"), float("inf"), 2**63 - 1, "text", True, 4.5, 450.0, None,
    pd.Timestamp("2026-06-01"),
)  # fmt: skip


def drives(rng: random.Random) -> pd.DataFrame:
    """Good traces of a few vehicles in two lanes of a road of 300 to 1,000 m, of which one may close."""
    chance = np.random.default_rng(rng.randrange(10**6))
    length, step = rng.choice((300, 600, 1000)), rng.choice((5, 12, 25))
    closes, parts = rng.random() < 0.5, []
    for number in range(rng.choice((1, 2, 5, 8))):
        x = np.arange(0, length, step) + chance.normal(0, 0.3)
        lane = number % 2
        merging = lane * 3.66 * np.clip((x - 0.4 * length) / 200, 0, 1) * closes
        y = 1.83 + 3.66 * lane - merging + chance.normal(0, 0.3, len(x))
        parts.append(
            pd.DataFrame(
                {
                    "vehicle_id": f"v{number}", "time_s": 60 * number + np.arange(len(x)) * (step / 25), "x_m": x, "y_m": y,
                    "speed_mps": 25.0, "length_m": 4.5, "width_m": 1.8,
                }
            )
        )  # fmt: skip
    table = pd.concat(parts, ignore_index=True)
    return table.drop(columns=rng.sample(["speed_mps", "length_m", "width_m"], k=rng.choice((0, 0, 1, 3))))


def traces(rng: random.Random, folder: Path) -> list[str]:
    """Traces in one or two files of any format, with odd values, columns, orders, and damage; for `map`."""
    files = [_trace_file(rng, folder / f"day{number}") for number in range(rng.choice((1, 1, 1, 2)))]
    options: list[str] = []
    if rng.random() < 0.12:
        meaning = rng.choice(
            ("time_ms", "x_ft", "lat", "lon_e7", "vehicle_id", "nonsense", "speed_mph", "heading_deg", "width_cm")
        )
        options += ["--columns", f"{meaning}={rng.choice(('x_m', 'y_m', 'time_s', 'vehicle_id', 'none', ''))}"]
    if rng.random() < 0.2:
        options += [
            "--crs",
            rng.choice(("EPSG:32617", "EPSG:4326", "EPSG:3857", "EPSG:2253", "EPSG:0", "x" * 3000, "", "\x1b")),
        ]
    if rng.random() < 0.1:
        options += ["--direction", rng.choice(("E", "W", "NNE", *NUMBERS))]
    if rng.random() < 0.1:
        options += ["--resolution-m", rng.choice(("0.127", "1", "10", *NUMBERS))]
    if rng.random() < 0.3:
        options += ["--method", rng.choice(("swept", "lanes", "mixture", "chen", "x"))]
    if rng.random() < 0.25:
        options += road_of_network(rng, folder)
    return ["map", *map(str, files), "--out", str(folder / "out"), *options]


def stream(rng: random.Random, folder: Path) -> list[str]:
    """A stream or files of traces for `live`, against a good, a broken or another map, into a new or a broken folder."""
    if rng.random() < 0.2:
        _break_folder(folder / "map", rng)
    words = ["--map", str(folder / "map"), "--out", str(folder / rng.choice(("live", "live", "live", "new", "new", "map")))]
    if rng.random() < 0.2:
        _break_folder(folder / "live", rng)
    if rng.random() < 0.4:
        lines = _as_text(_odd_table(drives(rng), rng) if rng.random() < 0.6 else drives(rng), rng)
        (folder / "stdin").write_bytes(damaged(lines, rng) if rng.random() < 0.3 else lines)
        source = ["-"]
    elif rng.random() < 0.3:
        (folder / "incoming").mkdir()
        for number in range(rng.choice((0, 1, 2))):
            _trace_file(rng, folder / "incoming" / f"day{number}")
        source = [str(folder / "incoming"), "--follow", "--idle-s", rng.choice(("0.1", "0", "-1", "nan", "0.2"))]
    else:
        source = [str(_trace_file(rng, folder / "day"))]
    if rng.random() < 0.2:
        words += ["--half-life-h", rng.choice(NUMBERS)]
    return ["live", *source, *words]


def _break_folder(folder: Path, rng: random.Random) -> None:
    """Damage one file of a folder, put a folder in its place or remove it."""
    path = rng.choice([path for path in sorted(folder.rglob("*")) if path.is_file()])
    content, how = path.read_bytes(), rng.choice(("damage", "damage", "damage", "json", "folder", "gone", "link", "empty"))
    path.unlink()
    if how == "folder":
        path.mkdir()
    elif how == "link":
        path.symlink_to(rng.choice(("/nowhere", "/dev/null", "/dev/zero")))
    elif how == "json" and path.suffix in {".json", ".geojson"}:
        value = json.loads(content)
        break_key(value, rng)
        path.write_text(json.dumps(value))
    elif how != "gone":
        path.write_bytes(b"" if how == "empty" else damaged(content, rng))


def _trace_file(rng: random.Random, stem: Path) -> Path:
    """A file of odd traces; its format by chance."""
    table = drives(rng)
    if rng.random() < 0.6:
        table = _odd_table(table, rng)
    kind = rng.choice(("csv", "csv", "csv.gz", "tsv", "parquet", "xml", "gpx", "txt", "geoparquet"))
    path = stem.with_name(f"{stem.name}.{kind}")
    if kind in {"parquet", "geoparquet"}:
        content = _parquet(table, rng, path)
    elif kind == "xml":
        content = _fcd(table, rng)
    elif kind == "gpx":
        content = _gpx(table, rng)
    else:
        content = _as_text(table, rng, separator="\t" if kind == "tsv" else ",")
    if rng.random() < 0.12:
        content = damaged(content, rng)
    if kind == "csv.gz":
        content = gzip.compress(content, mtime=0)
        if rng.random() < 0.15:
            content = damaged(content, rng)
    path.write_bytes(content)
    return path


def _odd_table(table: pd.DataFrame, rng: random.Random) -> pd.DataFrame:
    """The table with one to three oddities: values, types, names, orders, repeated or missing rows and columns."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        change = rng.choice((_with_odd_cells, _with_odd_column, _with_odd_rows, _with_odd_place))
        table = change(table, rng.choice(list(table.columns)), rng)
    return table


def _with_odd_cells(table: pd.DataFrame, name: str, rng: random.Random) -> pd.DataFrame:
    if not len(table):
        return table
    table = table.astype({name: object})
    table.loc[[rng.randrange(len(table)) for _ in range(rng.choice((1, 30)))], name] = rng.choice(CELLS)
    return table


def _with_odd_column(table: pd.DataFrame, name: str, rng: random.Random) -> pd.DataFrame:
    how = rng.choice(("value", "drop", "rename", "rename", "scale", "ids"))
    if how == "value":
        return table.assign(**{name: rng.choice(COLUMN_VALUES)})
    if how == "drop" and len(table.columns) > 1:
        return table.drop(columns=name)
    if how == "scale" and pd.api.types.is_numeric_dtype(table[name]):
        return table.assign(**{name: table[name] * rng.choice((1000, 1e-3, 3.28084, 1e7, -1, 0, 1e150, 1e300))})
    if how == "ids":
        return table.assign(vehicle_id=rng.choice((0, "", None, 1.5, "x" * 3000, range(len(table)))))
    return table.rename(columns={name: rng.choice(NAMES.get(name, ("x",)))})


def _with_odd_rows(table: pd.DataFrame, _: str, rng: random.Random) -> pd.DataFrame:
    how = rng.choice(("shuffle", "shuffle", "repeat", "few", "none"))
    if how == "shuffle":
        return table.sample(frac=1, random_state=rng.randrange(1000)).reset_index(drop=True)
    if how == "repeat":
        return pd.concat([table] * rng.choice((2, 30)), ignore_index=True)
    return table.head({"few": rng.choice((1, 2, 5))}.get(how, 0))


def _with_odd_place(table: pd.DataFrame, _: str, rng: random.Random) -> pd.DataFrame:
    if not {"x_m", "y_m"} <= set(table) or not len(table) or not pd.api.types.is_numeric_dtype(table["x_m"]):
        return table
    if rng.random() < 0.5:
        return _in_degrees(table)
    jump = (np.arange(len(table)) == len(table) // 2) * rng.choice((1e3, 1e5, 1e7, 1e12, 1e18))
    return table.assign(x_m=table["x_m"] + jump)


def _in_degrees(table: pd.DataFrame) -> pd.DataFrame:
    lat, lon = ORIGIN
    metres = table[["x_m", "y_m"]].apply(pd.to_numeric, errors="coerce")
    placed = table.drop(columns=["x_m", "y_m"])
    east = DEGREES_PER_METRE / np.cos(np.deg2rad(lat))
    return placed.assign(latitude=lat + metres["y_m"] * DEGREES_PER_METRE, longitude=lon + metres["x_m"] * east)


def _as_text(table: pd.DataFrame, rng: random.Random, separator: str = ",") -> bytes:
    separator = rng.choice((separator, separator, separator, ";", "|"))
    text = table.to_csv(index=False, sep=separator, header=rng.random() < 0.93)
    return text.encode(rng.choice(("utf-8", "utf-8", "utf-8", "utf-16", "utf-8-sig")), "surrogatepass")


def _parquet(table: pd.DataFrame, rng: random.Random, path: Path) -> bytes:
    if rng.random() < 0.3:
        cells: tuple[Any, ...] = (b"\x01\x01\0\0\0" + b"\0" * 16, b"", "POINT (1 2)", None)
        table = table.assign(point=pd.Series([rng.choice(cells)] * len(table), dtype=object))
    try:
        table.to_parquet(path)
    except Exception:  # noqa: BLE001 - a column of mixed types, which pyarrow does not write
        table.astype(str).to_parquet(path)
    return path.read_bytes()


def _fcd(table: pd.DataFrame, rng: random.Random) -> bytes:
    names = {"x_m": "x", "y_m": "y", "speed_mps": "speed", "vehicle_id": "id", "latitude": "y", "longitude": "x"}
    columns = [name for name in table if name in names]
    steps = []
    for row in _text_rows(table):
        angle = rng.choice(("", ' angle="90"', ' angle="x"'))
        values = " ".join(f'{names[name]}="{_xml(row[name])}"' for name in columns) + angle
        steps.append(f'<timestep time="{_xml(row.get("time_s", "0"))}"><vehicle {values}/></timestep>')
    outside = '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    head = rng.choice(("", "", "", '<?xml version="1.0" encoding="UTF-16"?>', BOMB, outside))
    inner = rng.choice(("", "", "&z;", "&x;"))
    return f"{head}<fcd-export>{inner}{''.join(steps)}</fcd-export>".encode("utf-8", "surrogatepass")


def _gpx(table: pd.DataFrame, rng: random.Random) -> bytes:
    if {"x_m", "y_m"} <= set(table):
        table = _in_degrees(table)
    points = []
    for row in _text_rows(table):
        place = f'lat="{_xml(row.get("latitude", ""))}" lon="{_xml(row.get("longitude", ""))}"'
        points.append(f"<trkpt {place}><time>{_gpx_time(row, rng)}</time></trkpt>")
    inner = f"<trk><trkseg>{''.join(points)}</trkseg></trk>"
    return f'<gpx xmlns="http://www.topografix.com/GPX/1/1">{inner}</gpx>'.encode("utf-8", "surrogatepass")


def _text_rows(table: pd.DataFrame) -> list[dict[str, str]]:
    return [{str(key): str(value) for key, value in row.items()} for row in table.to_dict("records")]


def _gpx_time(row: dict[str, str], rng: random.Random) -> str:
    try:
        return str((pd.Timestamp("2026-06-01", tz="UTC") + pd.Timedelta(float(row["time_s"]), "s")).isoformat())
    except (KeyError, ValueError, OverflowError):
        return _xml(str(rng.choice(VALUES))[:300])


def _xml(text: object) -> str:
    return str(text).replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")


BOMB = '<!DOCTYPE z [<!ENTITY a "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaa">' + "".join(
    f'<!ENTITY {chr(98 + n)} "{f"&{chr(97 + n)};" * 30}">' for n in range(25)
) + "]>"  # fmt: skip
