"""Thirteen drives like those of the recall of 2026: does an ego enter closed ground? A table in docs/results/live_recall.csv.

    nice python -m analysis.live.recall_drives --seeds 10 --traffic 4 --receivers 3 --seed 300

Seven drives lead between cones (traffic of SUMO), six past an exit that has closed (`streams`; roads of our own have no exits).
An ego keeps the middle of its lane as its map has it, and leaves the lane where the map shows it closed. It enters closed
ground where its outline, within 0.1 m, leaves the drivable ground of the layout before that; it takes an exit that its map
shows open. It sees nothing itself. The maps: of before the change; of a feed alone, which tells closed lanes (not lanes that
moved, nor exits) from a start that is off by a normal error of 15 m (verified) or 150 m (estimated); a live map after a number
of traces.

Half of SUMO's vehicles report. For smaller penetrations their traces stand for vehicles farther apart: times between them are
stretched, in the same ratio.
"""

import argparse
import csv
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.live.measure import settled_map as settled_stream
from analysis.live.measure import steps
from analysis.live.streams import World, stream
from wzsumo.announced_zone import ESTIMATED_SD_M, VERIFIED_SD_M
from wzsumo.case.change.stream import changing_stream, known_before
from wzsumo.case.change.updates import settled_map, updates_of
from wzsumo.lane_map import LaneMap
from wzsumo.live.stream.arrivals import Arrival
from wzsumo.scenario.scenario import Scenario
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.work_zone import WorkZoneLayout

RESULTS = Path(__file__).parents[2] / "docs" / "results"
COLUMNS = ("drive", "map", "penetration", "traces", "minutes", "entries", "n", "seed")
TRACES = (0, 5, 10, 15, 20, 25, 30, 40)  # since the change, at which an ego comes
MISSED = (3.0, 6.0, 12.0, 18.0)  # vehicles that would have taken the exit, since it closed
REPORTING, PENETRATIONS = 0.5, (0.5, 0.04)
FLOW_VPH, CHANGED_S = 1300.0, 420.0
APPROACH_M, STEP_M, TOUCH_M = 600.0, 5.0, 0.1
EXIT_SHARES = (0.2, 0.15, 0.1, 0.08, 0.05, 0.03)
NONE: dict[str, Any] = {"stands": False}


@dataclass(frozen=True, kw_only=True)
class ConeDrive:
    """A drive between cones: lanes of the road, the zone, how it was before and is after, the ego's lane."""

    lanes: int
    zone: dict[str, Any]
    before: dict[str, Any]
    after: dict[str, Any]
    lane: int
    announced: bool = True  # whether a feed tells what changed


LEFT = {"closed_lanes": [1], "closed_shoulder": "left"}
CONES = {
    "left lane of 2 closed": ConeDrive(lanes=2, zone=LEFT, before=NONE, after={}, lane=1),
    "right lane of 2 closed": ConeDrive(
        lanes=2, zone={"closed_lanes": [0], "closed_shoulder": "right"}, before=NONE, after={}, lane=0
    ),
    "left lane of 3 closed": ConeDrive(
        lanes=3, zone={"closed_lanes": [2], "closed_shoulder": "left"}, before=NONE, after={}, lane=2
    ),
    "right lanes of 3 closed": ConeDrive(
        lanes=3, zone={"closed_lanes": [0, 1], "closed_shoulder": "right"}, before=NONE, after={}, lane=0
    ),
    "zone starts 300 m earlier": ConeDrive(
        lanes=2, zone=LEFT, before={}, after={"start_ft": 2016.0, "work_length_ft": 2184.0}, lane=1
    ),
    "lanes moved 1.2 m": ConeDrive(lanes=2, zone=LEFT, before={}, after={"shift_ft": 4.0}, lane=0, announced=False),
    "cones pushed 1.2 m into the lane": ConeDrive(
        lanes=2, zone=LEFT, before={}, lane=0, announced=False,
        after={"pushed_from_ft": 4300.0, "pushed_to_ft": 4800.0, "pushed_by_ft": 4.0},
    ),
}  # fmt: skip


def scenario(drive: ConeDrive, *, seed: int) -> Scenario:
    """The scenario of a drive."""
    return Scenario.model_validate({
        "name": "recall_drives", "seed": seed,
        "road": {"lane_count": drive.lanes, "left_shoulder_ft": 10, "right_shoulder_ft": 12, "length_ft": 8500},
        "work_zone": {"posted_speed_mph": 55, "start_ft": 3000, "work_length_ft": 1200, "device": "cone_36in", **drive.zone},
        "simulation": {"demand": {"flow_vph": FLOW_VPH, "duration_s": 900}},
        "crowd": {"penetration": REPORTING}, "gnss": {"error_m": 1.0, "sampling_interval_s": 1.0},
        "route": {"start_lane": drive.lane, "goal_lane": drive.lane},
        "live": {"changed_at_s": CHANGED_S, "ego_after_s": 0, "before": drive.before, "after": drive.after},
    })  # fmt: skip


def enters(layout: WorkZoneLayout, middle: Any, is_open: Any, *, width: float) -> bool:
    """Whether an ego that keeps to `middle` [m] while `is_open`, both of stations (n,), enters closed ground."""
    at = np.arange(max(layout.start - APPROACH_M, 0.0), layout.end, STEP_M)
    closed = np.flatnonzero(~is_open(at))
    at = at[: closed[0]] if closed.size else at
    off = middle(at)
    over = np.maximum(layout.drivable_right(at) - (off - width / 2), off + width / 2 - layout.drivable_left(at))
    return bool((over > TOUCH_M).any())


def enters_by(lanes: LaneMap, layout: WorkZoneLayout, lane: int, *, width: float) -> bool:
    """Whether an ego with this map enters closed ground."""
    mapped = lanes.lanes[lane]
    return enters(
        layout, lambda s: np.interp(s, lanes.stations, mapped.middle),
        lambda s: np.interp(s, lanes.stations, mapped.p_open_middle) >= 0.5, width=width,
    )  # fmt: skip


def enters_by_feed(layout: WorkZoneLayout, drive: ConeDrive, *, sd: float, seed: int, width: float) -> bool:
    """Whether an ego enters that knows the road before and the announced start of the closure."""
    start = layout.start + sd * np.random.default_rng(seed).standard_normal()
    edges = np.cumsum((0.0, *layout.road.lane_widths))
    middle = (edges[drive.lane] + edges[drive.lane + 1]) / 2
    return enters(
        layout, lambda s: np.full(len(s), middle), lambda s: (s < start) | (not drive.announced), width=width
    )  # fmt: skip


def cone_rows(name: str, *, traffic: Iterable[int], receivers: int) -> Iterator[tuple[Any, ...]]:
    """The rows of a drive between cones, for seeds of the traffic with some of receivers and equipment each."""
    drive, traffic, entered = CONES[name], list(traffic), Counter[tuple[str, float, int]]()
    n = len(traffic) * receivers
    for seed in traffic:
        standing = scenario(drive, seed=seed)
        layout, width = standing.layout(), standing.vehicle.width_m
        zone = json.dumps(drive.zone)
        both = [_fleet(drive.lanes, zone, json.dumps(state), seed) for state in (drive.before, drive.after)]
        for number in range(receivers):
            one = standing.model_copy(update={"seed": 1000 * seed + number})
            traces = changing_stream(both[0], both[1], one)
            for kind, sd in (("feed, verified", VERIFIED_SD_M), ("feed, estimated", ESTIMATED_SD_M)):
                entered[kind, 0.0, 0] += enters_by_feed(layout, drive, sd=sd, seed=one.seed, width=width)
            for penetration in PENETRATIONS:
                before, after = (_farther_apart(part, penetration) for part in (traces.before, traces.after))
                live = settled_map(before, known_before(one), mapped_traces=40).live
                updates = updates_of(live, after, doubtful_share=1.0)
                for count in TRACES:
                    known = [update for update in updates if update.n_traces <= count][-1]
                    entered["live", penetration, count] += enters_by(known.lanes, layout, drive.lane, width=width)
    entered["before", 0.0, 0] = entered["live", PENETRATIONS[0], 0]
    for (kind, penetration, count), entries in sorted(entered.items()):
        minutes = f"{60 * count / (penetration * FLOW_VPH):.0f}" if penetration else ""
        yield name, kind, penetration or "", count if penetration else "", minutes, entries, n, min(traffic)


def exit_rows(share: float, *, seeds: Iterable[int]) -> Iterator[tuple[Any, ...]]:
    """The rows of a drive past a closed exit that a share of the vehicles took."""
    before, seeds = World(exit_share=share), list(seeds)
    noticed = []
    for seed in seeds:
        settled = next(live for k in range(9) if (live := settled_stream(before, 1000 * seed + k)) is not None)
        n = round(max(MISSED) / share)
        drives = stream(before, replace(before, exit_share=0.0), change_at=0, seed=seed, start_s=settled.now_s)
        closed = (number for number, step in enumerate(steps(settled, drives, n), start=1)
                  if step.live.ground.lanes.branches[0].p_open < 0.5)  # fmt: skip
        noticed.append(next(closed, np.inf))
    name = f"exit closed, {100 * share:.0f} % took it"
    for kind in ("before", "feed, verified", "feed, estimated"):
        yield name, kind, "", "", "", len(seeds), len(seeds), min(seeds)
    for missed in MISSED:
        number = round(missed / share)
        entries = int((np.array(noticed) > number).sum())
        yield name, "live", "", number, "", entries, len(seeds), min(seeds)


def _farther_apart(arrivals: list[Arrival], penetration: float) -> list[Arrival]:
    factor = REPORTING / penetration - 1
    return [replace(one, times=one.times + (one.times[0] - CHANGED_S) * factor) for one in arrivals]


@lru_cache(maxsize=100)
def _fleet(lanes: int, zone: str, state: str, traffic: int) -> pd.DataFrame:
    """True traces in a state, which may be that before one change and that after another; without a zone all are alike."""
    drive = ConeDrive(
        lanes=lanes, zone=json.loads(zone), before={"work_length_ft": 900.0}, after=json.loads(state), lane=0
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        files = scenario(drive, seed=traffic).write_sumo_files(Path(folder))
        return simulate_fleet(files, on_second=lambda _time: None)


def main() -> None:
    """Drive, and write the table, the rows of a drive as soon as they are known."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=10, help="of the generator")
    parser.add_argument("--traffic", type=int, default=4, help="seeds of SUMO's traffic")
    parser.add_argument("--receivers", type=int, default=3, help="seeds of receivers and equipment for each of the traffic")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--drives", nargs="+", default=[*CONES, "exits"], choices=[*CONES, "exits"])
    args = parser.parse_args()
    seeds = range(args.seed, args.seed + args.seeds)
    with (RESULTS / "live_recall.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for name in args.drives:
            shares = EXIT_SHARES if name == "exits" else ()
            table.writerows(row for share in shares for row in exit_rows(share, seeds=seeds))
            table.writerows(cone_rows(name, traffic=seeds[: args.traffic], receivers=args.receivers) if name in CONES else ())
            file.flush()
    sys.stderr.write("done\n")


if __name__ == "__main__":
    main()
