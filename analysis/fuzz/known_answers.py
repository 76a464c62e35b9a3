"""Inputs whose right answer is known: the command must give it, say what it doubts, or refuse; all else is silently wrong.

One drive on a street of two lanes and one map with or without a wall, written in the many ways in which people write them.
`expected.json` beside each input holds what the command's figures must be; `is_wrong` compares.
"""

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from PIL import Image

SECOND = np.arange(0, 16, 0.5)
Table = pd.DataFrame
Writer = Callable[[Table, Path, random.Random], Path]


def is_wrong(folder: Path, figures: dict[str, Any], told: str) -> bool:
    """Whether figures differ from those of the input's `expected.json` without a word of doubt; `told` is what stderr says."""
    path = folder / "expected.json"
    if not path.exists():
        return False
    expected = json.loads(path.read_text())
    doubts = figures.get("warnings") or figures.get("dropped") or "left out" in told
    return any(figures.get(key) != value for key, value in expected.items()) and not doubts


def table(rng: random.Random, folder: Path) -> list[str]:
    """Traces of six vehicles in two lanes, written in one of many ways; for `map`."""
    chance = np.random.default_rng(rng.randrange(10**6))
    parts = []
    for number in range(6):
        place = {"x_m": 20 * SECOND + chance.normal(0, 0.3, len(SECOND)), "y_m": 3.6 * (number % 2) + chance.normal(0, 0.2)}
        parts.append(pd.DataFrame({"vehicle_id": f"{number}", "time_s": SECOND + 60 * number} | place))
    traces = pd.concat(parts, ignore_index=True).round(4)
    change = rng.choice(CHANGES)
    traces = change(traces, rng)
    path = rng.choice(WRITERS)(traces, folder / "a", rng)
    (folder / "expected.json").write_text(json.dumps({"open_lanes": 2}))
    return ["map", str(path), "--out", str(folder / "out"), "--json", "--quiet"]


def image(rng: random.Random, folder: Path) -> list[str]:
    """A map of a road with or without a wall across it, its image of one of many kinds; for `plan` across it."""
    wall, negate = rng.random() < 0.5, rng.choice((0, 1, 0, False, True, "no", "0", "true", 0.0, 2, None))
    mode = rng.choice(("trinary", "scale"))
    p = np.zeros((40, 160))
    if wall:
        p[:, 80:83] = rng.choice((1.0, 1.0, 0.8, 0.5))
    occupied_is_white = negate in (1, "true") or negate is True
    grey = p if occupied_is_white else 1 - p
    suffix, write = rng.choice(IMAGES)
    write(grey, folder / f"m.{suffix}")
    about = {"image": f"m.{suffix}", "resolution": 0.5, "origin": [0, -10, rng.choice((0, 0, 0, 0.0, 0.1, 3.14))], "mode": mode,
             "negate": negate, "occupied_thresh": rng.choice((0.65, 0.65, 0.9, 0.1)),
             "free_thresh": rng.choice((0.196, 0.196, 0.05, 0.25))}  # fmt: skip
    (folder / "m.yaml").write_text(yaml.safe_dump({key: value for key, value in about.items() if value is not None}))
    (folder / "expected.json").write_text(json.dumps({"is_found": not wall}))
    poses = ["--start", "10", "0", "0", "--goal", "70", "0", "0"]
    return ["plan", str(folder / "m.yaml"), *poses, "--out", str(folder / "p.csv"), "--json"]


def with_found(figures: dict[str, Any]) -> dict[str, Any]:
    """The figures of a command, and whether its plan was found."""
    return figures | {"is_found": figures.get("status") == "FOUND"}


# Changes of a table that leave its meaning as it is, or make it one that can be read in two ways.
def _same(traces: Table, _: random.Random) -> Table:
    return traces


def _ids(traces: Table, rng: random.Random) -> Table:
    """Ids that are different texts, and as numbers or without spaces the same."""
    some = rng.choice(
        (
            ("7", "07", "007", "7.0", "7e0", "+7"), ("a", "A", "b", "B", "c", "C"), ("1", "2", "3", "NA", "5", "6"),
            tuple(str(2**53 + n) for n in range(6)), (" 1", "1 ", "2", "3", "4", "5"), tuple("éßøñ中z"),
        )
    )  # fmt: skip
    return traces.assign(vehicle_id=traces["vehicle_id"].map(dict(zip("012345", some, strict=True))))


def _times(traces: Table, rng: random.Random) -> Table:
    stamp = pd.to_datetime(traces["time_s"] + 1.78e9, unit="s", utc=True)
    how = rng.choice(("iso", "zone", "naive", "ms", "ns", "mixed", "us", "clock", "days", "minutes", "some"))
    if how in {"days", "minutes"}:
        return traces.assign(time_s=traces["time_s"] / {"days": 86400, "minutes": 60}[how])
    if how in {"ms", "us", "ns"}:
        return traces.assign(time_s=((traces["time_s"] + 1.78e9) * {"ms": 1e3, "us": 1e6, "ns": 1e9}[how]).astype("int64"))
    local = stamp.dt.tz_convert(rng.choice(("Europe/Berlin", "Asia/Kathmandu", "America/St_Johns")))
    text = {
        "iso": stamp.map(lambda t: t.isoformat()), "zone": local.map(lambda t: t.isoformat()),
        "naive": stamp.dt.strftime("%Y-%m-%d %H:%M:%S.%f"), "clock": stamp.dt.strftime("%H:%M:%S.%f"),
    }  # fmt: skip
    if how == "mixed":
        return traces.assign(time_s=text["iso"].where(traces.index % 2 == 0, text["zone"]))
    if how == "some":
        return traces.assign(time_s=text["iso"].where(traces.index % 3 == 0, stamp.map(lambda t: t.timestamp()).astype(str)))
    return traces.rename(columns={"time_s": "time"}).assign(time=text[how])


def _names(traces: Table, rng: random.Random) -> Table:
    how = rng.choice(
        (str.upper, str.title, lambda name: f" {name} ", lambda name: f'"{name}"', lambda name: name.split("_")[0])
    )
    return traces.rename(columns=how)


def _twice(traces: Table, rng: random.Random) -> Table:
    name = rng.choice(("x_m", "y_m", "time_s", "vehicle_id"))
    second = traces[[name]] if rng.random() < 0.5 else traces[[name]].sample(frac=1, random_state=1).reset_index(drop=True)
    return pd.concat([traces, second.rename(columns={name: rng.choice((name, name.upper()))})], axis=1)


def _holes(traces: Table, rng: random.Random) -> Table:
    rows = [rng.randrange(len(traces)) for _ in range(rng.choice((1, 20, 100)))]
    traces = traces.astype(object)
    traces.loc[rows, rng.choice(list(traces))] = rng.choice((None, "nan", "inf", "", " ", "-9999", "x", "1e999"))
    return traces


def _degrees(traces: Table, rng: random.Random) -> Table:
    lat, lon = 42.28 + traces["y_m"] / 111_320, -83.74 + traces["x_m"] / (111_320 * np.cos(np.deg2rad(42.28)))
    names = rng.choice((("lat", "lon"), ("Latitude", "Longitude"), ("y", "x"), ("lon", "lat")))
    factor = rng.choice((1.0, 1.0, 1e7, 1e6))
    place = {names[0]: (factor * lat).round(8), names[1]: (factor * lon).round(8)}
    return traces.drop(columns=["x_m", "y_m"]).assign(**place)


CHANGES = (_same, _ids, _times, _names, _twice, _holes, _degrees)


def _text(traces: Table, path: Path, rng: random.Random) -> Path:
    separator, decimal = rng.choice(((",", "."), (";", "."), (";", ","), ("\t", ","), ("|", "."), (" ", "."), (",", ",")))
    path = path.with_suffix(rng.choice((".csv", ".tsv", ".txt")))
    quoted: Any = rng.choice((0, 1)) if decimal != separator else 1
    text = traces.to_csv(index=rng.random() < 0.1, sep=separator, decimal=decimal, quoting=quoted)
    text = rng.choice(("", "", "", "# made by a tool\n", "sep=;\n", "\n\n")) + text
    ends = rng.choice(("\n", "\n", "\r\n", "\r"))
    encoding = rng.choice(("utf-8", "utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1", "utf-8"))
    path.write_bytes(text.replace("\n", ends).encode(encoding, "replace"))
    return path


def _parquet(traces: Table, path: Path, rng: random.Random) -> Path:
    path = path.with_suffix(".parquet")
    traces = traces.loc[:, ~traces.columns.duplicated()]
    name = str(next(iter(traces)))
    how = rng.choice(("plain", "category", "text", "index", "bytes", "nested"))
    if how == "category":
        traces = traces.astype({name: "category"})
    elif how == "text":
        traces = traces.astype(str)
    elif how == "index":
        traces = traces.set_index(name)
    elif how in {"bytes", "nested"}:
        kind = (lambda v: str(v).encode() + b"\xff") if how == "bytes" else (lambda v: {"id": str(v)})
        traces = traces.assign(**{name: traces[name].map(kind)})
    try:
        traces.to_parquet(path)
    except (ValueError, TypeError):  # Arrow has no kind for a column of mixed values
        traces.map(str).to_parquet(path)
    return path


WRITERS: tuple[Writer, ...] = (_text, _text, _parquet)


def _binary(full: int, kind: str, channels: int = 1) -> Callable[[Any, Path], None]:
    def write(grey: Any, path: Path) -> None:
        levels = np.repeat(np.round(grey * full)[..., None], channels, axis=2).astype(kind)
        head = f"P{5 if channels == 1 else 6}\n{grey.shape[1]} {grey.shape[0]}\n{full}\n"
        path.write_bytes(head.encode() + levels.tobytes())

    return write


def _saved(mode: str, scale: float = 255, kind: str = "u1", **options: Any) -> Callable[[Any, Path], None]:
    def write(grey: Any, path: Path) -> None:
        picture = Image.fromarray(np.round(grey * scale).astype(kind) if kind[0] != "f" else (grey * scale).astype(kind))
        picture = picture if picture.mode == mode or kind != "u1" else picture.convert(mode)
        extra: dict[str, Any] = {"exif": _turned()} if options.get("turned") else {}
        if options.get("pages"):
            extra = {"save_all": True, "append_images": [Image.fromarray(255 - np.asarray(picture))]}
        picture.save(path, **extra)

    return write


def _turned() -> Image.Exif:
    tags = Image.Exif()
    tags[274] = 2
    return tags


def _wrong_full(grey: Any, path: Path) -> None:
    path.write_bytes(b"P5\n%d %d\n99\n" % grey.shape[::-1] + np.round(grey * 255).astype("u1").tobytes())


IMAGES: tuple[tuple[str, Callable[[Any, Path], None]], ...] = (
    ("pgm", _binary(255, "u1")), ("pgm", _binary(100, "u1")), ("pgm", _binary(65535, ">u2")), ("pgm", _binary(4095, ">u2")),
    ("ppm", _binary(255, "u1", 3)), ("ppm", _binary(65535, ">u2", 3)), ("pgm", _wrong_full),
    *(("png", _saved(mode)) for mode in ("1", "L", "LA", "P", "RGB", "RGBA")),
    *(("tif", _saved(mode)) for mode in ("L", "LA", "P", "RGB", "RGBA")),
    ("png", _saved("I;16", 65535, "u2")), ("tif", _saved("I;16", 65535, "u2")), ("tif", _saved("F", 1, "f4")),
    ("tif", _saved("F", 255, "f4")), ("tif", _saved("I", 2**31 - 1, "i4")), ("jpg", _saved("L")), ("bmp", _saved("L")),
    ("bmp", _saved("P")), ("tif", _saved("CMYK")), ("png", _saved("L", turned=True)), ("tif", _saved("L", pages=True)),
)  # fmt: skip
