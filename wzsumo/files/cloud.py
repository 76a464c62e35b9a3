"""Reads point clouds from files. Coordinates are metres in any frame."""

import math
import tokenize
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.errors import CloudError, check_file, reading
from wzsumo.frames import FloatArray
from wzsumo.scan import check_cloud

CLOUD_FORMATS = (".npy", ".csv", ".ply")
MIN_SURFACE_POINTS = 3
_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip


def read_cloud(path: Path, *, at_least: int = 1) -> FloatArray:
    """Points (n, 3) [m] of an .npy array, a .csv table (columns x, y, z, or three unnamed ones) or a .ply file."""
    kind = path.suffix.lower()
    if kind not in CLOUD_FORMATS:
        raise CloudError(f"{path}: unknown cloud format {kind or '(no suffix)'!r}; known: {', '.join(CLOUD_FORMATS)}")
    remedy = f"name an existing cloud ({', '.join(CLOUD_FORMATS)})"
    check_file(path, error=CloudError, remedy=remedy)
    with warnings.catch_warnings(action="ignore"), reading(path, error=CloudError, remedy=remedy, also=(tokenize.TokenError,)):
        points = {".npy": _read_npy, ".csv": _read_csv, ".ply": _read_ply}[kind](path)
    return check_cloud(points, source=str(path), at_least=at_least)


def _read_npy(path: Path) -> npt.ArrayLike:
    with path.open("rb") as file:
        version = np.lib.format.read_magic(file)
        shape, _, kind = (
            np.lib.format.read_array_header_1_0(file) if version == (1, 0) else np.lib.format.read_array_header_2_0(file)
        )
        needed, held = math.prod(shape) * kind.itemsize, path.stat().st_size - file.tell()
    if needed > held:
        raise ValueError(f"its header says shape {shape}, of which {held} of {needed} bytes are there")
    return np.load(path, allow_pickle=False)


def _read_csv(path: Path) -> npt.ArrayLike:
    if path.stat().st_size == 0:
        return np.empty((0, 3))
    table = pd.read_csv(path)
    named = [[name for name in table.columns if str(name).strip().lower() in {axis, f"{axis}_m"}] for axis in "xyz"]
    if all(len(columns) == 1 for columns in named):
        return table[[columns[0] for columns in named]].to_numpy(dtype=float)
    try:
        return pd.read_csv(path, header=None).to_numpy(dtype=float)
    except ValueError:
        given = ", ".join(map(str, table.columns))
        raise ValueError(f"a table has the columns x, y, z, or three unnamed ones of numbers; given: {given}") from None


def _read_ply(path: Path) -> npt.ArrayLike:
    """Vertices of a PLY file, ASCII or binary. Source: Turk, The PLY Polygon File Format, 1994."""
    content = path.read_bytes()
    head, mark, body = content.replace(b"end_header\r\n", b"end_header\n", 1).partition(b"end_header\n")
    if not content.startswith(b"ply") or not mark:
        raise ValueError("no PLY header")
    lines = [line.split() for line in head.decode("ascii", errors="replace").splitlines()]
    form = next((line[1] for line in lines if line[:1] == ["format"]), "")
    elements = [i for i, line in enumerate(lines) if line[:1] == ["element"]]
    if not elements or lines[elements[0]][1] != "vertex":
        raise ValueError("its first element must be vertex")
    count = int(lines[elements[0]][2])
    end = elements[1] if len(elements) > 1 else len(lines)
    properties = [line[1:] for line in lines[elements[0] : end] if line[:1] == ["property"]]
    if any(len(entry) != 2 or entry[0] not in _PLY_TYPES for entry in properties):
        raise ValueError("a vertex property that is not one number")
    names = [name for _, name in properties]
    if not {"x", "y", "z"} <= set(names):
        raise ValueError("vertices need the properties x, y and z")
    if form == "ascii":
        rows = np.array(body.split(None, count * len(names))[: count * len(names)], dtype=float).reshape(count, len(names))
        return rows[:, [names.index(axis) for axis in "xyz"]]
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(form)
    if order is None:
        raise ValueError(f"format {form!r} is not of PLY 1.0")
    layout = np.dtype([(name, order + _PLY_TYPES[number]) for number, name in properties])
    vertices = np.frombuffer(body, dtype=layout, count=count)
    return np.column_stack([vertices[axis].astype(float) for axis in "xyz"])
