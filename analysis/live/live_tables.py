"""The tables of docs/results/live.md from their CSV files."""

import csv
import json
from pathlib import Path

RESULTS = Path(__file__).parents[2] / "docs" / "results"
THRESHOLDS = Path(__file__).parents[2] / "wzsumo" / "live" / "charts" / "thresholds.json"


def calibration() -> str:
    """The command of the thresholds, and how many traces they rest on."""
    thresholds = json.loads(THRESHOLDS.read_text(encoding="utf-8"))
    return f"`{thresholds['command']}` on {thresholds['traces_per_cell']:,} traces a cell"


def delays() -> str:
    """Traces until the first alarm after a change, a row a change and receiver error."""
    lines = ["| change | error [m] | n | traces | missed | named | size [m] | start [m] |", "|---|---|---|---|---|---|---|---|"]
    lines += [
        f"| {row['kind'].replace('_', ' ')} | {row['error_m']} | {row['n']} | {row['median_traces']} / {row['p95_traces']} | "
        f"{row['missed']} | {row['right_kind']} | {row['size_rms_m']} | {row['start_rms_m']} |"
        for row in _rows("live_delays.csv")
    ]
    return "\n".join(lines)


def false_alarms() -> str:
    """Alarms in streams without a change, a row a habit."""
    lines = ["| habit | error [m] | traces | alarms | kinds |", "|---|---|---|---|---|"]
    lines += [
        f"| {row['habit'].replace('_', ' ')} | {row['error_m']} | {row['traces']} | {row['alarms']} | {row['by_kind']} |"
        for row in _rows("live_false_alarms.csv")
    ]
    return "\n".join(lines)


def sumo() -> str:
    """Traces of SUMO's drivers until the first alarm after a change, and alarms before it, a row a change."""
    lines = [
        "| change | error [m] | n | traces | missed | named | false alarms before | alarms after, all |",
        "|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row['change']} | {row['error_m']} | {row['n']} | {row['median_traces']} / {row['p95_traces']} | {row['missed']} | "
        f"{row['right_kind']} | {row['false_before']} in {row['traces_before']} | "
        f"{row['alarms_after']} in {row['traces_after']} |"
        for row in _rows("live_sumo.csv")
    ]
    return "\n".join(lines)


def _rows(name: str) -> list[dict[str, str]]:
    with (RESULTS / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))
