"""A placed zone beside today's ways of closing a lane in SUMO, on the freeway of docs/guide/place.md.

    python analysis/placement/todays_ways.py --out docs/results/todays_ways.csv

The ways: the zone as `wzsumo place` sets it up; the lane barred over its whole edge (a rerouter's closingLaneReroute does the
same as the lane's permissions); a rerouter that bars the lane from where its taper ends, with the edge cut there; and cones as
stopped vehicles, one in the closed lane every 20 m of the zone. One row a way, demand and seed: vehicles past the middle of the
activity area from minute 5 to minute 20, and vehicles whose outline reached 0.1 m or more into the closed ground.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import shapely
from closed_ground import CAR, TOUCH_M, closed_ground, outline
from example import HERE, TRUCK, place_example

from wzsumo.simulation.connection import sumo_binary

DEMANDS_VPH = (3000, 5400)
COUNTED_S = (300.0, 1200.0)
STEP_S = 0.5
CONE_EVERY_M = 20.0
# Of the example's zone, from its first device: where its taper ends, and where the edge is cut within the taper.
TAPER_END_M, CUT_M = 247.6, 89.1
ZONE_EDGE = "m3"
OPTIONS = ("--step-length", f"{STEP_S:g}", "--end", "1200", "--no-step-log", "--no-warnings", "--xml-validation", "never")
CONES = (
    '<vType id="cone" length="0.5" width="0.5" minGap="0" color="orange" guiShape="pedestrian"/>\n'
    '<route id="of_cones" edges="m3"/>\n'
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--demands", type=int, nargs="+", default=list(DEMANDS_VPH))
    parser.add_argument("--ways", nargs="+", default=[], help="of the table's first column; all where none are named")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    rows = []
    for flow in args.demands:
        with tempfile.TemporaryDirectory() as folder:
            placed = place_example(Path(folder), routes=_routes(flow, Path(folder)))
            cut_later = Path(folder) / "cut_later"
            cut_later.mkdir()
            place_example(cut_later, routes=_routes(flow, cut_later), position=300.0 + TAPER_END_M - CUT_M)
            ways = _ways(placed, cut_later / "placed", Path(folder))
            for way, words in ((way, words) for way, words in ways.items() if way in args.ways or not args.ways):
                for seed in args.seeds:
                    row = {"way": way, "demand_vph": flow, "seed": seed} | _run(placed, words, seed)
                    rows.append(row)
                    print(row, flush=True)
    pd.DataFrame(rows).to_csv(args.out, index=False)


def _routes(flow: int, folder: Path) -> Path:
    """The heavy demand of the example, thinned to a flow [veh/h]."""
    text = (HERE / "heavy.rou.xml").read_text(encoding="utf-8")
    tree = ET.fromstring(text)
    for item in tree.iter("flow"):
        item.set("probability", f"{float(item.get('probability', 0)) * flow / 5400:.4f}")
    path = folder / f"demand_{flow}.rou.xml"
    ET.ElementTree(tree).write(path)
    return path


def _ways(placed: Path, cut_later: Path, folder: Path) -> dict[str, list[str]]:
    """SUMO's words by the name of each way."""
    devices = pd.read_csv(placed / "devices.csv")
    span = float(devices["s_m"].max() - devices["s_m"].min())
    bars = {}
    for name, lanes in (("edge", ["m3_2"]), ("piece", ["m3.wz2_2"])):
        rows = "".join(f'<closingLaneReroute id="{lane}" disallow="all"/>' for lane in lanes)
        interval = f'<interval begin="0" end="100000">{rows}</interval>'
        bars[name] = folder / f"bar_{name}.add.xml"
        bars[name].write_text(f'<additional><rerouter id="bar" edges="m2" probability="0">{interval}</rerouter></additional>')
    cones = folder / "cones.add.xml"
    stopped = "".join(
        f'<vehicle id="cone.{n}" type="cone" route="of_cones" depart="0" departLane="2" departPos="{at:.1f}" departSpeed="0">'
        f'<stop lane="m3_2" startPos="{at - 0.5:.1f}" endPos="{at:.1f}" duration="100000"/></vehicle>\n'
        for n, at in enumerate(np.arange(300.0, 300.0 + span, CONE_EVERY_M)[::-1])
    )
    cones.write_text(f"<additional>{CONES}{stopped}</additional>")
    original, closed = (str(placed / name / "run.sumocfg") for name in ("original", "closed"))
    opened = str(cut_later / "open" / "run.sumocfg")
    return {
        "placed zone": ["-c", closed],
        "lane barred on the whole edge": ["-c", original, "-a", str(bars["edge"])],
        "lane barred from the taper's end, edge cut": ["-c", opened, "-a", str(bars["piece"])],
        "cones as stopped vehicles": ["-c", original, "-a", str(cones), "--time-to-teleport", "-1"],
    }


def _run(placed: Path, words: list[str], seed: int) -> dict[str, float]:
    fcd = placed / "fcd.xml"
    edges = placed / "edges.txt"
    edges.write_text("".join(f"edge:{id_}\n" for id_ in (ZONE_EDGE, *(f"{ZONE_EDGE}.wz{n}" for n in range(4)))))
    attributes = ("--fcd-output", str(fcd), "--fcd-output.attributes", "x,y,angle,type", "--precision", "2")
    where = ("--fcd-output.filter-edges.input-file", str(edges))
    subprocess.run(
        [str(sumo_binary("sumo")), *words, "--seed", str(seed), *OPTIONS, *attributes, *where], check=True, capture_output=True
    )
    ground = closed_ground(placed)
    core = ground.buffer(-TOUCH_M)
    shapely.prepare(core)
    left, low, right, high = ground.bounds
    middle = _middle_of_work(placed)
    over: set[str] = set()
    seen: dict[str, float] = {}
    past: list[float] = []
    everyone: set[str] = set()
    for _, step in ET.iterparse(fcd):
        if step.tag != "timestep":
            continue
        time = float(step.get("time", 0))
        for vehicle in step:
            id_ = vehicle.get("id", "")
            if id_.startswith("cone"):
                continue
            x, y = float(vehicle.get("x", 0)), float(vehicle.get("y", 0))
            everyone.add(id_)
            if seen.get(id_, 1e9) < middle <= x:
                past.append(time)
            seen[id_] = x
            if left - 20 <= x <= right + 20 and low - 20 <= y <= high + 20 and id_ not in over:
                size = TRUCK if vehicle.get("type") == "tr" else CAR
                if core.intersects(outline(x, y, float(vehicle.get("angle", 0)), *size)):
                    over.add(id_)
        step.clear()
    begin, end = COUNTED_S
    counted = sum(begin <= time < end for time in past)
    return {
        "vehicles_on_edge": len(everyone), "past_work_vph": 3600 * counted / (end - begin), "over_closed_ground": len(over),
        "past_work": len(past),
    }  # fmt: skip


def _middle_of_work(placed: Path) -> float:
    """x [m] of the middle of the devices; the freeway runs along x."""
    devices = pd.read_csv(placed / "devices.csv")
    return float(devices["x_m"].median())


if __name__ == "__main__":
    main()
