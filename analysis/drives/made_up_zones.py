"""Is the drive safe in zones that nobody chose? One drive on the lane map in each of many zones made up by their seeds.

    python analysis/drives/made_up_zones.py --first 1 --zones 200 --out results/made_up_zones

Each zone is a scenario of its own, zones/SEED.toml in --out, laid out by the manual: 35 to 70 mph, one to four lanes of 11 or
12 ft, straight or in bends of 1.2 to 4 times the least radius, one or two lanes or a shoulder closed on either side or
inside, with or without a shift, or both directions by turns on one lane; a GNSS error of 0 to 1 m, 5 to 30 traces, demand of
half to nine tenths of what the zone lets through, the ego at 10 m/s or the posted speed, in an open lane or in the one that
closes. A row a zone is appended to rows.csv as it comes: a study that was stopped goes on where it was.
"""

import argparse
import random
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import tomli_w
from library_drives import append_rows, at_speed, drives
from scipy.stats import beta

from wzsumo.errors import InputError
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.units import feet_from_metres

# Least radius [ft] of a curve by its speed [mph], at a superelevation of 6 %: AASHTO Green Book 2018, Table 3-7.
LEAST_RADIUS_FT = {35: 340, 40: 485, 45: 643, 50: 833, 55: 1060, 60: 1330, 65: 1660, 70: 2040}
FREEWAY_MPH = 50  # from here on a freeway with the drivers of the HCM
TRANSITION_FT = 300  # from straight to bend
BEND_RAD = 0.8  # by which each bend turns, before one to the other side
LONG_FT = 20000  # a road that holds any of the zones, on which its length is found
BEYOND_ZONE_FT = 900  # of the road, beyond the goal
VPH_A_LANE = 1300  # what a zone surely lets through, in a lane that stays open; HCM 7: 1,400 and more
COUNTED = ("STRUCK_DEVICE", "ENTERED_CLOSED_AREA", "COLLIDED", "LEFT_PAVEMENT", "NO_PATH", "TIMED_OUT", "REFUSED")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=1, help="seed of the first zone")
    parser.add_argument("--zones", type=int, default=200)
    parser.add_argument("--out", type=Path, default=Path("results/made_up_zones"))
    args = parser.parse_args()
    (args.out / "zones").mkdir(parents=True, exist_ok=True)
    rows = args.out / "rows.csv"
    done = set(pd.read_csv(rows)["seed"]) if rows.exists() else set()
    for seed in range(args.first, args.first + args.zones):
        if seed not in done:
            row = driven_row(seed, args.out)
            append_rows(rows, pd.DataFrame([row]))
            print(*(row.get(key) for key in ("seed", "zone", "outcome", "clean", "faults")), file=sys.stderr)
    print_summary(pd.read_csv(rows, dtype={"speed": str}))


def driven_row(seed: int, out: Path) -> dict[str, Any]:
    """What the zone of a seed is, and the figures of the drive in it."""
    content, speed, radius_ft = made_up_zone(seed)
    path = out / "zones" / f"{seed}.toml"
    path.write_text(tomli_w.dumps(content))
    zone, road = content["work_zone"], content["road"]
    row = {
        "seed": seed, "zone": _kind(content), "speed": speed, "posted_speed_mph": zone["posted_speed_mph"],
        "lanes": road["lane_count"], "radius_ft": radius_ft, "traces": content["crowd"]["used"],
        "error_m": content["gnss"]["error_m"], "start_lane": content["route"]["start_lane"],
        "goal_lane": content["route"]["goal_lane"],
    }  # fmt: skip
    try:
        path.write_text(tomli_w.dumps(content | {"road": _as_long_as_needed(road, load_scenario(path), radius_ft)}))
        scenario = at_speed(load_scenario(path), speed, traces=None)
    except InputError as error:
        return row | {"outcome": "REFUSED", "clean": False, "reason": str(error)}
    case = StudyCase(scenario=scenario, method="lanes", drive=True)
    fleet = out / "fleets" / f"{case.simulation}.parquet"
    (found,) = drives([case], fleet.parent)
    fleet.unlink(missing_ok=True)  # no other zone has the same
    return row | found


def made_up_zone(seed: int) -> tuple[dict[str, Any], str, int | None]:
    """The scenario of a seed, as its file has it, on a long straight road; the ego's speed, "10" or "zone"; a radius [ft]."""
    rng = random.Random(seed)
    mph = rng.choice(tuple(LEAST_RADIUS_FT))
    freeway = mph >= FREEWAY_MPH
    by_turns = mph <= 50 and rng.random() < 0.15
    lanes = 1 if by_turns else rng.randint(2, 4 if freeway else 3)
    closed, zone = ([0], {}) if by_turns else _closure(lanes, rng)
    n_open = 1 if by_turns else lanes - len(closed)
    demand: dict[str, Any] = {
        "flow_vph": rng.randint(150, 250) if by_turns else round(rng.uniform(0.5, 0.9) * VPH_A_LANE * n_open, -1),
        "truck_share": round(rng.uniform(0.0, 0.15), 2), "duration_s": 1200 if by_turns else 600,
    }  # fmt: skip
    if by_turns:
        demand["opposing_flow_vph"] = rng.randint(100, 200)
        zone = {"one_lane_two_way": rng.choice(("signal", "flaggers"))}
    elif freeway and closed:
        demand["drivers"] = "hcm"
    opened = [0] if by_turns else [lane for lane in range(lanes) if lane not in closed]
    goal = rng.choice(opened)
    beside = [lane for lane in closed if abs(lane - goal) == 1] if not by_turns else []
    start = rng.choice(beside) if beside and rng.random() < 0.25 else goal
    road: dict[str, Any] = {
        "lane_count": lanes, "lane_width_ft": rng.choice((11, 12)), "left_shoulder_ft": rng.randint(8, 12),
        "right_shoulder_ft": rng.randint(8, 12),
        "length_ft": LONG_FT,
    } | ({"opposing_lane_count": 1} if by_turns else {})  # fmt: skip
    bend = round(rng.choice((-1, 1)) * rng.uniform(1.2, 4.0) * LEAST_RADIUS_FT[mph])
    content = {
        "name": f"made_up_{seed}", "seed": seed, "road": road,
        "work_zone": {
            "posted_speed_mph": mph, "road_type": "freeway" if freeway and not by_turns else "rural",
            "start_ft": rng.randint(1500, 2200), "closed_lanes": closed, "work_length_ft": rng.randint(300, 1500),
            "device": rng.choice(("cone_36in", "drum")),
        } | zone,
        "simulation": {"demand": demand},
        "crowd": {"penetration": 0.8 if by_turns else 0.4, "collected": 30, "used": rng.randint(5, 30)},
        "gnss": {"error_m": round(rng.uniform(0.0, 1.0), 2), "sampling_interval_s": rng.choice((0.1, 1.0))},
        "route": {"start_lane": start, "goal_lane": goal},
        "map": {"resolution_m": 0.2},
    }  # fmt: skip
    return content, rng.choice(("10", "zone")), rng.choice((bend, None))


def _closure(lanes: int, rng: random.Random) -> tuple[list[int], dict[str, Any]]:
    """The closed lanes of a one-way carriageway, and what else a work zone needs to be said about them."""
    side = rng.choice(("left", "right"))
    kinds = ["outer", "outer", "outer and shift", "shift", "shoulder"] + ["two", "interior"] * (lanes >= 3)
    kind = rng.choice(kinds)
    if kind in {"shift", "shoulder"}:
        return [], {"closed_shoulder": side} | ({"shift_ft": rng.randint(4, 8)} if kind == "shift" else {})
    if kind == "interior":
        return [rng.randint(1, lanes - 2)], {"closed_shoulder": side}
    n = 2 if kind == "two" else 1
    closed = list(range(n)) if side == "right" else list(range(lanes - n, lanes))
    return closed, {"closed_shoulder": side} | ({"shift_ft": rng.randint(4, 8)} if "shift" in kind else {})


def _as_long_as_needed(road: dict[str, Any], scenario: Scenario, radius_ft: int | None) -> dict[str, Any]:
    """The road as long as zone and route need, or a little longer: straight, or in bends of a radius to both sides."""
    needed = round(feet_from_metres(scenario.layout().end + scenario.route.goal_after_zone_m)) + BEYOND_ZONE_FT
    if radius_ft is None:
        return road | {"length_ft": needed}
    arc, radius = round(BEND_RAD * abs(radius_ft)), radius_ft
    pieces: list[dict[str, Any]] = [{"length_ft": 1000}, {"length_ft": TRANSITION_FT, "end_radius_ft": radius}]
    while sum(piece["length_ft"] for piece in pieces) < needed:
        pieces += [
            {"length_ft": arc, "radius_ft": radius},
            {"length_ft": 2 * TRANSITION_FT, "radius_ft": radius, "end_radius_ft": -radius},
        ]
        radius = -radius
    return {key: value for key, value in road.items() if key != "length_ft"} | {"alignment": pieces}


def _kind(content: dict[str, Any]) -> str:
    """The zone in a few words."""
    zone, road = content["work_zone"], content["road"]
    if "one_lane_two_way" in zone:
        return f"by turns, {zone['one_lane_two_way']}"
    closed = zone["closed_lanes"]
    shift = f", shift {zone['shift_ft']} ft" if "shift_ft" in zone else ""
    what = f"lanes {closed} of {road['lane_count']}" if closed else f"shoulder of {road['lane_count']}"
    return f"{what} closed on the {zone['closed_shoulder']}{shift}"


def print_summary(table: pd.DataFrame) -> None:
    """Print how many drives were clean, with a one-sided 95 % bound, how the others ended, and what was amiss."""
    driven = table[table["outcome"] != "REFUSED"]
    clean, n = int(driven["clean"].astype(bool).sum()), len(driven)
    bound = beta.ppf(0.05, clean, n - clean + 1) if clean else 0.0
    print(f"\n{n} zones driven: {clean} clean, above {bound:.1%} with 95 %")
    print(", ".join(f"{outcome} {(table['outcome'] == outcome).sum()}" for outcome in COUNTED))
    for row in driven[~driven["clean"].astype(bool)].itertuples():
        print(f"- {row.seed}, {row.zone}, {row.speed}, n = {row.traces}, {row.error_m} m: {row.faults}")


if __name__ == "__main__":
    main()
