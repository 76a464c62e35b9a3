"""How many traces of SUMO's drivers a live map needs to notice a change, and what it says where nothing changed.

    nice python -m analysis.live.sumo_streams --traffic 4 --receivers 5 --seed 700

A road of 2.1 km with two lanes. For each seed of the traffic SUMO drives the same vehicles through the zone before and after
the change (`case.change.stream`). Half of the vehicles are equipped, other ones for each seed of the receivers; so n is the
product of both, clustered by traffic.
"""

import argparse
import csv
import json
import sys
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from analysis.live.bounds import fewest_traces
from wzsumo.case.change.stream import ENTRY_M, changing_stream, known_before
from wzsumo.case.change.updates import settled_map, updates_of
from wzsumo.live.alarms import Alarm
from wzsumo.scenario.scenario import Scenario
from wzsumo.simulation.fleet import simulate_fleet

RESULTS = Path(__file__).parents[2] / "docs" / "results"
COLUMNS = (
    "change", "error_m", "n", "median_traces", "p95_traces", "missed", "right_kind", "traces_before", "false_before",
    "traces_after", "alarms_after", "bound_traces",
)  # fmt: skip
NONE: dict[str, Any] = {"stands": False}
# (state before, state after, kinds of alarm that name it)
KINDS: dict[str, tuple[dict[str, Any], dict[str, Any], tuple[str, ...]]] = {
    "lane closed": (NONE, {}, ("lane_closed",)),
    "zone removed": ({}, NONE, ("lane_open",)),
    "lanes moved 1 m": ({}, {"shift_ft": 3.3}, ("shifted",)),
    "lanes moved 2 m": ({}, {"shift_ft": 6.6}, ("shifted",)),
    "devices pushed 1 m into the lane": (
        {}, {"pushed_from_ft": 4300.0, "pushed_to_ft": 4800.0, "pushed_by_ft": 3.3}, ("shifted",),
    ),
    "start 300 m earlier": ({"start_ft": 3000.0}, {"start_ft": 2016.0, "work_length_ft": 2184.0},
                            ("closure_start_moved", "lane_closed")),
    "road closed": (NONE, {"stands": False, "road_closed_ft": 5000.0}, ("road_closed",)),
    "nothing": ({}, {"work_length_ft": 1200.5}, ()),  # 15 cm: a state of its own, so that the section takes it
}  # fmt: skip
DURATION_S, LONGER_S = 800, {"start 300 m earlier": 1500, "nothing": 1000}  # of the demand; some 46 traces follow the change
LEAVING = ("lane closed", "start 300 m earlier")  # changes that show in where drivers leave their lane
BIN_M, LAST_M = 100, 1700  # LAST_M: the end of the work


def scenario(kind: str, *, traffic: int) -> Scenario:
    """The scenario of a kind of change."""
    before, after, _ = KINDS[kind]
    return Scenario.model_validate({
        "name": "sumo_streams", "seed": traffic,
        "road": {"lane_count": 2, "left_shoulder_ft": 10, "right_shoulder_ft": 12, "length_ft": 7000},
        "work_zone": {
            "posted_speed_mph": 55, "start_ft": 3000, "closed_lanes": [1], "closed_shoulder": "left", "work_length_ft": 1200,
            "device": "drum",
        },
        "simulation": {"demand": {"flow_vph": 1300, "duration_s": LONGER_S.get(kind, DURATION_S)}},
        "route": {"start_lane": 1, "goal_lane": 1},
        "live": {"changed_at_s": 420, "ego_after_s": 0, "before": before, "after": after},
    })  # fmt: skip


def fleets(kind: str, *, traffic: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """True traces of the fleet before and after a kind of change."""
    before, after, _ = KINDS[kind]
    duration_s = LONGER_S.get(kind, DURATION_S)
    return _fleet(json.dumps(before), traffic, duration_s), _fleet(json.dumps(after), traffic, duration_s)


@lru_cache(maxsize=64)
def _fleet(state: str, traffic: int, duration_s: int) -> pd.DataFrame:
    """True traces in a state, which may be that before one change and that after another."""
    one = scenario("lane closed", traffic=traffic).model_dump(exclude_unset=True)
    one["live"] |= {"after": json.loads(state), "before": {"work_length_ft": 900.0}}
    one["simulation"]["demand"]["duration_s"] = duration_s
    standing = Scenario.model_validate(one)
    with tempfile.TemporaryDirectory() as folder:
        return simulate_fleet(standing.write_sumo_files(Path(folder)), on_second=lambda _time: None)


def alarms_of(one: Scenario, both: tuple[pd.DataFrame, pd.DataFrame], *, error_m: float, receivers: int) -> dict[str, Any]:
    """The first alarm after the change and after how many traces it came; how many came before it, of how many traces."""
    crowd = one.crowd.model_copy(update={"penetration": 0.5})
    gnss = one.gnss.model_copy(update={"error_m": error_m, "sampling_interval_s": 1.0})
    reported = one.model_copy(update={"crowd": crowd, "gnss": gnss, "seed": receivers})
    stream = changing_stream(*both, reported)
    settled = settled_map(stream.before, known_before(reported), mapped_traces=40)
    found: list[tuple[int, Alarm]] = [
        (update.n_traces, update.alarm) for update in updates_of(settled.live, stream.after, doubtful_share=1.0) if update.alarm
    ]
    return {
        "after": found, "traces_before": len(stream.before) - 40, "false_before": len(settled.false_alarms),
        "traces_after": len(stream.after),
    }  # fmt: skip


def bound_of(worlds: list[tuple[Scenario, tuple[pd.DataFrame, pd.DataFrame]]]) -> int:
    """The fewest traces that any test needs that knows in which lane each vehicle is, by where vehicles leave the left lane.

    Lorden's bound, of the divergence between two histograms of places BIN_M long, with those beside that never were in the
    lane, and that stayed.
    """
    counts = []
    for state in range(2):
        found = [_left_at(one, both[state]) for one, both in worlds]
        counts.append(np.bincount(np.concatenate(found), minlength=LAST_M // BIN_M + 2) + 0.5)
    was, now = (count / count.sum() for count in counts)
    return fewest_traces(float(now @ np.log(now / was)))


def _left_at(one: Scenario, fleet: pd.DataFrame) -> npt.NDArray[np.int64]:
    """The number of the bin in which each vehicle was last in the left lane; one more: it stayed; 0: it never was there."""
    road = one.layout().road
    s, d = road.to_sd(fleet[["x_m", "y_m"]].to_numpy())
    vehicles = fleet["vehicle_id"].to_numpy()
    in_left = (d > road.lane_widths[0]) & (s > ENTRY_M) & (s < LAST_M)
    last = pd.Series(s[in_left]).groupby(vehicles[in_left]).max()
    return np.asarray(1 + last.reindex(np.unique(vehicles), fill_value=-BIN_M).to_numpy() // BIN_M, dtype=np.int64)


def row_of(kind: str, error_m: float, runs: list[dict[str, Any]], bound: int | str) -> list[object]:
    """One row of the table."""
    delays = np.array([run["after"][0][0] if run["after"] else np.inf for run in runs])
    named = [run["after"][0][1].change.kind in KINDS[kind][2] for run in runs if run["after"]]
    median, late = np.quantile(delays, [0.5, 0.95], method="higher")
    return [
        kind, error_m, len(runs), f"{median:.0f}", f"{late:.0f}", int(np.isinf(delays).sum()),
        f"{sum(named) / len(runs):.2f}", sum(run["traces_before"] for run in runs), sum(run["false_before"] for run in runs),
        sum(run["traces_after"] for run in runs), sum(len(run["after"]) for run in runs), bound,
    ]  # fmt: skip


def main() -> None:
    """Measure, and add to live_sumo.csv a row a kind and error as soon as it is measured."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--traffic", type=int, default=4, help="seeds of the traffic")
    parser.add_argument("--receivers", type=int, default=5, help="seeds of receivers and equipment")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--errors", type=float, nargs="+", default=[0.5, 1.0])
    parser.add_argument("--kinds", nargs="+", default=list(KINDS))
    args = parser.parse_args()
    path = RESULTS / "live_sumo.csv"
    fresh = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        if fresh:
            table.writerow(COLUMNS)
        for kind in args.kinds:
            worlds = [scenario(kind, traffic=args.seed + number) for number in range(args.traffic)]
            driven = [(world, fleets(kind, traffic=world.seed)) for world in worlds]
            bound = bound_of(driven) if kind in LEAVING else ""
            for error in args.errors:
                runs = [
                    alarms_of(world, both, error_m=error, receivers=1000 * args.seed + number)
                    for world, both in driven
                    for number in range(args.receivers)
                ]
                table.writerow(row_of(kind, error, runs, bound))
                file.flush()
    sys.stderr.write("done\n")


if __name__ == "__main__":
    main()
