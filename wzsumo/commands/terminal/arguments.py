"""Types of command-line arguments. argparse prints the reason for which they refuse a value."""

import argparse
import math
from pathlib import Path

from wzsumo.errors import SpecError, shown
from wzsumo.spec import MAX_SEED

MAX_COUNT = 1000  # of processes on one machine
MAX_DIGITS = 18


def add_scenario(parser: argparse.ArgumentParser) -> None:
    """Add the argument SCENARIO."""
    parser.add_argument(
        "scenario",
        type=Path,
        metavar="SCENARIO",
        help="a scenario file, or the name of one of the library (`wzsumo init` lists it)",
    )


def add_out_folder(parser: argparse.ArgumentParser) -> None:
    """Add the argument --out DIR."""
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="the folder to write, which may be new")


def add_reading(parser: argparse.ArgumentParser) -> None:
    """--columns and --crs: how a file of traces is to be read."""
    parser.add_argument(
        "--columns", nargs="+", metavar="MEANING=NAME", default=[],
        help="columns of the traces by what they hold, as in --columns vehicle_id=trip time_ms=stamp x_ft=east y_ft=north",
    )  # fmt: skip
    parser.add_argument(
        "--crs", help='what plane coordinates are in, such as "EPSG:32617"; without it they have no place on earth'
    )


def add_origin(parser: argparse.ArgumentParser) -> None:
    """--origin LAT LON: a place for metres that have none."""
    parser.add_argument(
        "--origin", type=number, nargs=2, metavar=("LAT", "LON"), help="where (0, 0) of lanes without a place on earth lies"
    )


def column_names(words: list[str]) -> dict[str, str]:
    """The names of columns by their meanings. Raises SpecError where a word is no MEANING=NAME."""
    for word in words:
        if not all(word.partition("=")):
            raise SpecError(f"--columns {word}: must be MEANING=NAME, as in --columns vehicle_id=trip")
    return dict(word.split("=", 1) for word in words)


def compass_bearing(text: str) -> float:
    """Degrees clockwise from north of a text: a compass point, or a number."""
    points = ("N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW")
    if text.upper() in points:
        return 22.5 * points.index(text.upper())
    bearing = number(text)
    if not 0 <= bearing < 360:
        raise argparse.ArgumentTypeError(f"{shown(text)} must be a compass point (N, NE, ...) or degrees from 0 to below 360")
    return bearing


def seed(text: str) -> int:
    """The seed of a text: a whole number that SUMO takes as one."""
    value = _whole_number(text)
    if value is None or value > MAX_SEED:
        raise argparse.ArgumentTypeError(f"{shown(text)} must be a whole number from 0 to {MAX_SEED}")
    return value


def count(text: str) -> int:
    """The number of things of a text: a whole number of 1 or more."""
    value = _whole_number(text)
    if value is None or not 1 <= value <= MAX_COUNT:
        raise argparse.ArgumentTypeError(f"{shown(text)} must be a whole number from 1 to {MAX_COUNT}")
    return value


def cell_edge_m(text: str) -> float:
    """The cell edge [m] of a text: above 0 and at most 10 m."""
    value = number(text)
    if not 0 < value <= 10:
        raise argparse.ArgumentTypeError(f"{shown(text)} must be above 0 and at most 10")
    return value


def speed_mps(text: str) -> float:
    """The speed [m/s] of a text: 0 to 60 m/s."""
    value = number(text)
    if not 0 <= value <= 60:
        raise argparse.ArgumentTypeError(f"{shown(text)} must be 0 to 60 m/s")
    return value


def number(text: str) -> float:
    """The number of a text; infinite ones and nan are none."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{shown(text)} is not a number")
    return value


def _whole_number(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) <= MAX_DIGITS else None
