"""The page docs/results/live.md from its two tables.

python analysis/live/tables.py
"""

import csv
import json
from pathlib import Path

RESULTS = Path(__file__).parents[2] / "docs" / "results"
THRESHOLDS = Path(__file__).parents[2] / "wzsumo" / "live" / "charts" / "thresholds.json"
INTRODUCTION = """\
# How fast does a live map notice a change?

Simulated streams in closed form (`analysis/live/streams.py`): 2.7 km, two lanes, the left one closed over 945 m, receivers
whose error is 80 % bias, 15 % correlated over 60 s and 5 % white, one fix a second, and dirt as
[the method's page](../method/live.md) lists it. Thresholds are those of the package, for one false alarm in 20,000 traces, all
charts together. Seeds are fresh.
"""
DELAYS = """\
## Delays

Traces until the first alarm after a change, median / 95 %, of maps that 600 traces went through before. **Named** is the share
of runs whose first alarm is of the right kind. Of lanes that moved, the first alarm is off by **size** and **start** (root mean
square); further traces better both. `python analysis/live/measure.py delays`

"""
HABITS = """\
## False alarms

Alarms in streams without a change, whose drivers or receivers change their habit after 600 usual traces.
`python analysis/live/measure.py habits`

"""
END = """
## What this does not show

- n is small: a 95 % quantile of few runs is the second or third largest delay, and 2,000 traces without an alarm only say that
  false alarms are rarer than 1 in 670 at 95 %. The budget of 1 in 20,000 rests on the extrapolated tails of the calibration.
- Streams come from the generator on which the charts were developed, at other seeds; not from SUMO, not from a road.
- The rate falls tenfold at once in the habit `night`: the gap after that is told as silence.
"""


def page() -> str:
    """The page's text."""
    thresholds = json.loads(THRESHOLDS.read_text(encoding="utf-8"))
    calibrated = f"They were calibrated by `{thresholds['command']}` on {thresholds['traces_per_cell']:,} traces a cell.\n\n"
    return INTRODUCTION + calibrated + DELAYS + _delays() + "\n" + HABITS + _habits() + END


def _delays() -> str:
    rows = _rows("live_delays.csv")
    lines = ["| change | error [m] | n | traces | missed | named | size [m] | start [m] |", "|---|---|---|---|---|---|---|---|"]
    lines += [
        f"| {row['kind'].replace('_', ' ')} | {row['error_m']} | {row['n']} | {row['median_traces']} / {row['p95_traces']} | "
        f"{row['missed']} | {row['right_kind']} | {row['size_rms_m']} | {row['start_rms_m']} |"
        for row in rows
    ]
    return "\n".join(lines) + f"\n\nSeed {rows[0]['seed']}.\n"


def _habits() -> str:
    rows = _rows("live_false_alarms.csv")
    lines = ["| habit | error [m] | traces | alarms | kinds |", "|---|---|---|---|---|"]
    lines += [
        f"| {row['habit'].replace('_', ' ')} | {row['error_m']} | {row['traces']} | {row['alarms']} | {row['by_kind']} |"
        for row in rows
    ]
    return "\n".join(lines) + f"\n\nSeed {rows[0]['seed']}.\n"


def _rows(name: str) -> list[dict[str, str]]:
    with (RESULTS / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


if __name__ == "__main__":
    (RESULTS / "live.md").write_text(page(), encoding="utf-8")
