"""False alarms of young maps on SUMO's drivers, in docs/results/live_young.csv.

    nice python -m analysis.live.young_maps --traffic 8 --seed 900

An hour of traffic through a zone that does not change, 1,000 vehicles an hour, all of which report: 3.6 s apart in the mean, so
that platoons are seen as a whole. `wzsumo map` makes a map of the first traces, and the live map takes the rest: its first 300
traces, and those behind. An alarm that says of a lane what the zone's layout says, too, mends the map and is none of those that
are counted: `mended` has how many there were.
"""

import argparse
import csv
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd

from wzsumo.case.change.stream import changing_stream, known_before
from wzsumo.case.change.updates import settled_map
from wzsumo.live.alarms import Alarm, Kind
from wzsumo.scenario.scenario import Scenario
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.work_zone import WorkZoneLayout

RESULTS = Path(__file__).parents[2] / "docs" / "results"
COLUMNS = (
    "mapped_traces",
    "error_m",
    "runs",
    "young_traces",
    "young_alarms",
    "later_traces",
    "later_alarms",
    "by_kind",
    "mended",
    "seed",
)
YOUNG = 300  # traces
LANES_OPEN_OR_CLOSE = (Kind.LANE_OPEN, Kind.LANE_CLOSED, Kind.CLOSURE_START_MOVED, Kind.CLOSURE_END_MOVED)
HOUR_S = 3600.0


def scenario(*, traffic: int) -> Scenario:
    """A zone that stands all the time; the change that its section [live] needs comes behind the last trace."""
    return Scenario.model_validate({
        "name": "young_maps", "seed": traffic,
        "road": {"lane_count": 2, "left_shoulder_ft": 10, "right_shoulder_ft": 12, "length_ft": 7000},
        "work_zone": {
            "posted_speed_mph": 55, "start_ft": 3000, "closed_lanes": [1], "closed_shoulder": "left", "work_length_ft": 1200,
            "device": "drum",
        },
        "simulation": {"demand": {"flow_vph": 1000, "duration_s": HOUR_S}}, "crowd": {"penetration": 1.0},
        "route": {"start_lane": 1, "goal_lane": 1},
        "live": {"changed_at_s": HOUR_S - 10, "ego_after_s": 0, "before": {}, "after": {"stands": False}},
    })  # fmt: skip


def fleet_of(one: Scenario) -> pd.DataFrame:
    """True traces of an hour."""
    with tempfile.TemporaryDirectory() as folder:
        return simulate_fleet(one.before_the_change().write_sumo_files(Path(folder)), on_second=lambda _time: None)


def mends(alarm: Alarm, layout: WorkZoneLayout) -> bool:
    """Whether an alarm says that a lane is closed or open where it is so, over most of the stretch."""
    change = alarm.change
    if change.kind not in LANES_OPEN_OR_CLOSE or change.lane is None or change.start_m is None or change.end_m is None:
        return False
    opens = {
        Kind.LANE_OPEN: True, Kind.LANE_CLOSED: False, Kind.CLOSURE_START_MOVED: (change.size_m or 0.0) > 0,
        Kind.CLOSURE_END_MOVED: (change.size_m or 0.0) < 0,
    }[change.kind]  # fmt: skip
    stations, middle = np.linspace(change.start_m, change.end_m, 50), layout.road.lane_centre(change.lane)
    closed = np.zeros(len(stations), dtype=bool)
    for strip in layout.closed_strips:
        beside = (strip.right(stations) < middle) & (middle < strip.left(stations))
        closed |= beside & (stations >= strip.start) & (stations <= strip.end)
    return bool(np.mean(closed != opens) > 0.5)


def main() -> None:
    """Measure, and write a row an age and error as soon as it is measured."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--traffic", type=int, default=8, help="seeds of the traffic, one of receivers each")
    parser.add_argument("--seed", type=int, required=True)
    args = parser.parse_args()
    hours = [(one := scenario(traffic=args.seed + number), fleet_of(one)) for number in range(args.traffic)]
    with (RESULTS / "live_young.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for mapped in (10, 30):
            for error in (0.5, 1.0, 2.0):
                traces, alarms, kinds, mended = Counter[bool](), Counter[bool](), Counter[str](), 0
                for one, fleet in hours:
                    gnss = one.gnss.model_copy(update={"error_m": error, "sampling_interval_s": 1.0})
                    reported = one.model_copy(update={"gnss": gnss})
                    stream = changing_stream(fleet, fleet, reported).before
                    settled = settled_map(stream, known_before(reported), mapped_traces=mapped)
                    traces += Counter({True: YOUNG, False: len(stream) - mapped - YOUNG})
                    layout = one.before_the_change().layout()
                    false = [alarm for alarm in settled.false_alarms if not mends(alarm, layout)]
                    mended += len(settled.false_alarms) - len(false)
                    alarms += Counter(alarm.trace <= YOUNG for alarm in false)
                    kinds += Counter(str(alarm.change.kind) for alarm in false)
                words = " ".join(f"{kind}:{count}" for kind, count in sorted(kinds.items()))
                table.writerow([
                    mapped, error, len(hours), traces[True], alarms[True], traces[False], alarms[False], words, mended,
                    args.seed,
                ])  # fmt: skip
                file.flush()
    sys.stderr.write("done\n")


if __name__ == "__main__":
    main()
