"""Raw tables of fixes from files and folders: separated text, Parquet, GeoParquet, SUMO's FCD in XML, GPX; compressed too."""

import csv
import io
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import pandas as pd
from pyarrow import ArrowException

from wzsumo.errors import DAMAGED, TraceError
from wzsumo.files.fixes.dialects import may_hold_ids
from wzsumo.files.fixes.point_columns import table_of_arrow, with_points_of_text
from wzsumo.input_files import read_bytes

SUFFIXES = (".csv", ".tsv", ".txt", ".parquet", ".geoparquet", ".xml", ".gpx")  # each but Parquet may be followed by .gz
TEXT_SUFFIXES = SUFFIXES[:3]
UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_DECIMAL_COMMA = re.compile(r"^\s*-?\d+,\d+\s*$")


def table_files(path: Path) -> list[Path]:
    """The files of fixes that a path names: itself, or all of a folder and the folders in it, by name.

    Raises TraceError where there is none.
    """
    if path.is_dir():
        found = sorted(
            file for file in path.rglob("*") if file.is_file() and _kind(file) and not file.name.startswith((".", "_"))
        )
        if not found:
            raise TraceError(f"{path}: no file of traces in this folder; they end in {', '.join(SUFFIXES)} or .gz")
        return found
    if not path.is_file():
        raise TraceError(f"{path}: no such file; name a file or folder of traces")
    if not _kind(path):
        raise TraceError(f"{path}: a trace file ends in {', '.join(SUFFIXES)}, or is one of these compressed (.gz)")
    return [path]


def read_table(path: Path, *, id_column: str | None = None) -> tuple[pd.DataFrame, str | None]:
    """(the table of one file as it stands, its CRS where the file itself says one). Raises TraceError where it is none.

    `id_column` is one of text that holds ids, beside those whose names say so: ids are read as they stand, since 7, 07 and
    7.0 are three vehicles.
    """
    try:
        kind = _kind(path)
        return _read_text(path, id_column=id_column) if kind in TEXT_SUFFIXES else _READERS[kind](path)
    except (*DAMAGED, ArrowException) as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise TraceError(f"{path}: cannot be read as a trace table ({why})") from None


def _kind(path: Path) -> str:
    """The suffix that says what a file is, lower case; empty where it is no trace file."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    suffix = suffixes[-2] if suffixes[-1:] == [".gz"] and len(suffixes) > 1 else (suffixes or [""])[-1]
    compressed_parquet = suffixes[-1:] == [".gz"] and "parquet" in suffix
    return suffix if suffix in SUFFIXES and not compressed_parquet else ""


def _read_text(path: Path, *, id_column: str | None) -> tuple[pd.DataFrame, str | None]:
    content, encoding = read_bytes(path), "utf-8-sig"
    if content.startswith(UTF_16_MARKS):
        encoding = "utf-16"  # "Unicode text" of spreadsheets
    elif b"\0" in content:
        raise ValueError("it holds NUL bytes, as no text in UTF-8 does; save it as UTF-8")
    first = [line for line in content[:65536].decode(encoding, errors="replace").splitlines() if line.strip()]
    separator = _separator(first[0] if first else "")
    comma = separator != "," and len(first) > 1 and any(_DECIMAL_COMMA.match(word) for word in first[1].split(separator))
    decimal = "," if comma else "."  # as in exports of many countries
    ids = {name: "str" for name in _names(first[0] if first else "", separator) if name == id_column or may_hold_ids(name)}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            table = pd.read_csv(  # index_col: else the first columns of rows that are longer than the header are no columns
                io.BytesIO(content), sep=separator, decimal=decimal, encoding=encoding, low_memory=False, dtype=ids,
                index_col=False,
            )  # fmt: skip
    except pd.errors.ParserWarning:
        raise ValueError(
            "its rows hold more values than the header has names; see that no number has a decimal comma"
        ) from None
    except UnicodeDecodeError:
        raise ValueError("its text is neither UTF-8 nor UTF-16; save it as UTF-8") from None
    return with_points_of_text(table), None


def _separator(header: str) -> str:
    """The one of comma, semicolon and tab that the header line holds most of."""
    return max(",;\t|", key=header.count)


def _names(header: str, separator: str) -> list[str]:
    """The names of columns in a header line, as pandas calls them."""
    return next(csv.reader([header], delimiter=separator), []) if header else []


def _read_parquet(path: Path) -> tuple[pd.DataFrame, str | None]:
    import pyarrow.parquet as pq

    return table_of_arrow(pq.read_table(path))


def _read_xml(path: Path) -> tuple[pd.DataFrame, str | None]:
    """The table of an XML file: SUMO's FCD output, or GPX under another name."""
    content = read_bytes(path)
    if b"<gpx" in content[:4096]:
        return _gpx_table(content, source=path), None
    rows = [
        {"timestep_time": step.get("time")} | {f"vehicle_{key}": value for key, value in vehicle.attrib.items()}
        for step in _elements(content, "timestep")
        for vehicle in step.iter("vehicle")
    ]
    if not rows:
        raise TraceError(f"{path}: no <timestep> with a <vehicle> in it; an .xml file of traces is SUMO's FCD output")
    table = pd.DataFrame(rows)
    for name in table.columns.difference(["vehicle_id", "vehicle_type", "vehicle_lane"]):
        table[name] = pd.to_numeric(table[name], errors="coerce").astype(float)
    return table, None


def _read_gpx(path: Path) -> tuple[pd.DataFrame, str | None]:
    return _gpx_table(read_bytes(path), source=path), None


def _gpx_table(content: bytes, *, source: Path) -> pd.DataFrame:
    """One row a track point; each track segment is a trace of its own."""
    rows = []
    for number, segment in enumerate(_elements(content, "trkseg")):
        for point in segment:
            values = {_local_name(child): (child.text or "").strip() for child in point.iter()}
            place = {"lat": point.get("lat", ""), "lon": point.get("lon", "")}
            rows.append({"vehicle_id": f"{source.name.split('.')[0]}#{number + 1}"} | place | _known(values))
    if not rows:
        raise TraceError(f"{source}: no <trkseg> with points in it; a GPX file of traces holds tracks")
    table = pd.DataFrame(rows)
    for name in table.columns.difference(["vehicle_id", "time"]):
        table[name] = pd.to_numeric(table[name], errors="coerce").astype(float)
    return table


def _known(values: dict[str, str]) -> dict[str, str]:
    names = {"time": "time", "speed": "speed", "course": "course", "hdop": "hdop", "ele": "elevation"}
    return {column: values[name] for name, column in names.items() if name in values}


def _elements(content: bytes, name: str) -> Iterator[ET.Element]:
    """Each element of that name, freed when the next one is asked for: FCD files are long."""
    for _, element in ET.iterparse(io.BytesIO(content)):  # noqa: S314 - expat expands no external entities
        if _local_name(element) == name:
            yield element
            element.clear()


def _local_name(element: ET.Element) -> str:
    return element.tag.rsplit("}", 1)[-1]


_READERS = {
    ".parquet": _read_parquet,
    ".geoparquet": _read_parquet,
    ".xml": _read_xml,
    ".gpx": _read_gpx,
}
