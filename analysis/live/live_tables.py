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


def delays(file: str, interval_s: str) -> str:
    """Traces until the first alarm after a change, beside the bound and the naive rule, at a sampling interval [s].

    A row a change and receiver error.
    """
    bounds = {_cell(row): row["bound_traces"] for row in _rows("live_bounds.csv")}
    naive = {_cell(row): f"{row['median_traces']} / {row['p95_traces']}" for row in _rows("live_naive.csv")}
    lines = [
        "| change | error [m] | n | traces | missed | named | bound | naive rule | size [m] | start [m] |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row['kind'].replace('_', ' ')} | {row['error_m']} | {row['n']} | {row['median_traces']} / {row['p95_traces']} | "
        f"{row['missed']} | {row['right_kind']} | {bounds[_cell(row)]} | {naive.get(_cell(row), '')} | {row['size_rms_m']} | "
        f"{row['start_rms_m']} |"
        for row in sorted(_rows(file), key=lambda row: float(row["error_m"]))
        if float(row["interval_s"]) == float(interval_s)
    ]
    return "\n".join(lines)


def naive_rules() -> str:
    """How many traces in a row each naive rule asks for, a row an error and sampling interval."""
    lines = ["| error [m] | interval [s] | traces in a row |", "|---|---|---|"]
    rules = {(row["error_m"], row["interval_s"]): row["in_a_row"].replace(":", ": ") for row in _rows("live_naive.csv")}
    return "\n".join([*lines, *(f"| {error} | {interval} | {words} |" for (error, interval), words in rules.items())])


def young() -> str:
    """Alarms of young maps on SUMO's drivers, a row an age and receiver error."""
    lines = [
        "| map of | error [m] | hours | alarms in the first 300 traces | alarms later | kinds | mended the map |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    lines += [
        f"| {row['mapped_traces']} traces | {row['error_m']} | {row['runs']} | "
        f"{row['young_alarms']} in {row['young_traces']} | {row['later_alarms']} in {row['later_traces']} | {row['by_kind']} | "
        f"{row['mended']} |"
        for row in _rows("live_young.csv")
    ]
    return "\n".join(lines)


def recall(file: str, penetration: str) -> str:
    """Entries between cones, by map; of the live map at a penetration, by traces since the change."""
    rows = [row for row in _rows(file) if not row["drive"].startswith("exit")]
    counts = sorted({int(row["traces"]) for row in rows if row["penetration"] == penetration})
    minutes = {int(row["traces"]): row["minutes"] for row in rows if row["penetration"] == penetration}
    others = ("before", "feed, estimated", "feed, verified")
    head = [*(f"{name}" for name in others), *(f"live, {count} ({minutes[count]} min)" for count in counts)]
    lines = [f"| drive | n | {' | '.join(head)} |", f"|{'---|' * (len(head) + 2)}"]
    for drive in dict.fromkeys(row["drive"] for row in rows):
        of_it = [row for row in rows if row["drive"] == drive]
        found = {(row["map"], row["penetration"], row["traces"]): row["entries"] for row in of_it}
        entries = [found[name, "", ""] for name in others] + [found["live", penetration, str(count)] for count in counts]
        lines.append(f"| {drive} | {of_it[0]['n']} | {' | '.join(entries)} |")
    return "\n".join(lines)


def recall_exits() -> str:
    """Entries into closed exits, by map; the live map by the vehicles since the change that would have taken the exit."""
    rows = [row for row in _rows("live_recall.csv") if row["drive"].startswith("exit")]
    lines = ["| drive | n | before | feed | live: traces since the change, entries |", "|---|---|---|---|---|"]
    for drive in dict.fromkeys(row["drive"] for row in rows):
        of_it = [row for row in rows if row["drive"] == drive]
        live = "; ".join(f"{row['traces']}: {row['entries']}" for row in of_it if row["map"] == "live")
        first = {row["map"]: row["entries"] for row in of_it}
        lines.append(f"| {drive} | {of_it[0]['n']} | {first['before']} | {first['feed, estimated']} | {live} |")
    return "\n".join(lines)


def throughput() -> str:
    """CPU time and memory of a replay."""
    rows = {row["what"]: (row["fewer"], row["more"]) for row in _rows("live_throughput.csv")}
    few, many = rows["traces"]
    return "\n".join([
        "| | |", "|---|---|",
        f"| replay of {int(few):,} and {int(many):,} traces | {rows['cpu_s'][0]} and {rows['cpu_s'][1]} s of CPU, "
        f"{rows['peak_mb'][0]} and {rows['peak_mb'][1]} MB at most |",
        f"| a trace more | {rows['ms_per_trace'][0]} ms |",
        f"| a million, scaled | {rows['minutes_per_million'][0]} min |",
        f"| decoding; the rest of a step | {rows['decoding_ms'][0]} ms; {rows['rest_of_step_ms'][0]} ms |",
    ])  # fmt: skip


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
        "| change | error [m] | n | traces | missed | named | bound | false alarms before | alarms after, all |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row['change']} | {row['error_m']} | {row['n']} | {row['median_traces']} / {row['p95_traces']} | {row['missed']} | "
        f"{row['right_kind']} | {row['bound_traces']} | {row['false_before']} in {row['traces_before']} | "
        f"{row['alarms_after']} in {row['traces_after']} |"
        for row in _rows("live_sumo.csv")
    ]
    return "\n".join(lines)


def _cell(row: dict[str, str]) -> tuple[str, float, float]:
    return row["kind"], float(row["error_m"]), float(row["interval_s"])


def _rows(name: str) -> list[dict[str, str]]:
    with (RESULTS / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))
