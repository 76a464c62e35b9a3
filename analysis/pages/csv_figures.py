"""One figure of a CSV file, asked for in a line.

min driven_min_clearance_devices_m .2f method=lanes seed=121..125      the least of these rows
n - d outcome=REACHED_GOAL                                            how many rows
share clean .0% method=lanes                                          of true values
value iou .2f n_traces=5 error_m=0 map=joined                         of the only row
table                                                                 all rows as they are
"""

import csv
from pathlib import Path

import pandas as pd

KINDS = ("n", "value", "min", "max", "mean", "median", "sum", "share")


def csv_figure(path: Path, asked: str) -> str:
    """The figure as text. Raises ValueError where no row, or more than the one that `value` asks for, is left."""
    if asked == "table":
        return _table(path)
    kind, column, form, *conditions = asked.split()
    rows = pd.read_csv(path)
    for condition in conditions:
        name, _, wanted = condition.partition("=")
        rows = rows[_matches(rows[name], wanted)]
    if kind == "n":
        return spaced(format(len(rows), form))
    if rows.empty or (kind == "value" and len(rows) != 1):
        raise ValueError(f"{path.name}: {asked}: {len(rows)} rows")
    values = rows[column].dropna()
    if kind == "value":
        value = values.iloc[0]
        return spaced(format(value if isinstance(value, str) else float(value), form))
    if kind not in KINDS:
        raise ValueError(f"{path.name}: {asked}: {kind!r} is none of {', '.join(KINDS)}")
    return spaced(format(float(values.astype(float).agg("mean" if kind == "share" else kind)), form))


def _table(path: Path) -> str:
    with path.open(encoding="utf-8", newline="") as file:
        header, *lines = csv.reader(file)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (header, ["---"] * len(header), *lines))


def _matches(column: "pd.Series[str]", wanted: str) -> "pd.Series[bool]":
    """Rows that are `wanted`, one of `a|b`, or within `low..high`."""
    low, dots, high = wanted.partition("..")
    if dots:
        return column.between(float(low), float(high))
    if pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column):
        return column.isin([float(one) for one in wanted.split("|")])
    return column.astype(str).isin(wanted.split("|"))


def spaced(text: str) -> str:
    """The text with a space before a sign of per cent, as the pages write it.

    >>> spaced("54%")
    '54 %'
    """
    return text.replace("%", " %") if text.endswith("%") else text
