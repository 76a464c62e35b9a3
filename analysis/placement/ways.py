"""Today's ways of closing a lane in SUMO beside a placed zone, on the freeway of the worked example.

    python analysis/placement/ways.py --out docs/results/placement_ways.csv

The left lane of three closed on 555 m of edge m3. One row a way and seed: vehicles an hour behind the zone from minute 5 to 20,
vehicles whose outline reached into the closed ground, and how many vehicles entered the road.
"""

import argparse
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import pandas as pd
from closed_ground import entered
from example import TRUCK, place_example

from wzsumo.simulation.connection import sumo_binary

EXITING = 0.1  # of the vehicles
FLOWS_VPH = (3000, 5400)  # less than two lanes carry, and more
LOOPS = "".join(
    f'<inductionLoop id="behind_{lane}" lane="m3-AddedOffRampEdge_{lane}" pos="50" period="300" file="behind.xml"/>'
    for lane in range(4)
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for flow in FLOWS_VPH:
            demand = Path(folder) / f"flow_{flow}.rou.xml"
            demand.write_text(_demand(flow))
            placed = place_example(Path(folder), routes=demand)
            rows += [{"flow_vph": flow} | _run(placed, *way, seed) for way in WAYS.items() for seed in args.seeds]
    table = pd.DataFrame(rows)
    table.to_csv(args.out, index=False)
    print(table.groupby(["flow_vph", "way"], sort=False).mean(numeric_only=True).round(1).to_string())


def _demand(flow_vph: float) -> str:
    row = '<flow id="{0}" from="m1" to="{0}" begin="0" end="1200" period="exp({1:.4f})" departLane="best" departSpeed="max"/>'
    rows = [row.format(to, share * flow_vph / 3600) for to, share in (("m4", 1 - EXITING), ("off", EXITING))]
    return f"<routes>{''.join(rows)}</routes>"


def _taper(placed: Path, folder: Path) -> None:
    shutil.copytree(placed / "closed", folder)


def _square_end(placed: Path, folder: Path) -> None:
    """The placed zone without its taper: the closing lane keeps its place and its width up to where it ends."""
    _taper(placed, folder)
    line = re.compile(r'<lane id="m3\.wz1_2"[^>]*>')
    whole = line.search((placed / "open" / "freeway.net.xml").read_text())
    assert whole is not None
    net = folder / "freeway.net.xml"
    net.write_text(line.sub(whole[0], net.read_text()))


def _rerouter(configuration: str, lane: str) -> Callable[[Path, Path], None]:
    def make(placed: Path, folder: Path) -> None:
        shutil.copytree(placed / configuration, folder)
        interval = f'<interval begin="0" end="9999"><closingLaneReroute id="{lane}"/></interval>'
        _add(folder, f'<rerouter id="r" edges="m1">{interval}</rerouter>')

    return make


def _stopped_vehicles(placed: Path, folder: Path) -> None:
    """Cones as vehicles of 1 m that stand in the lane, as far from each other as the devices."""
    shutil.copytree(placed / "original", folder)
    rows = ['<vType id="cone" length="1" width="0.5" minGap="0"/>', '<route id="there" edges="m3"/>']
    rows += [
        f'<vehicle id="cone{at}" type="cone" route="there" depart="0" departLane="2" departPos="{at}" departSpeed="0">'
        f'<stop lane="m3_2" endPos="{at}" duration="9999"/></vehicle>'
        for at in range(390, 944, 40)
    ]
    _add(folder, "".join(rows))


WAYS: dict[str, Callable[[Path, Path], None]] = {
    "wzsumo place": _taper,
    "square end on a cut edge": _square_end,
    "closingLaneReroute on a cut edge": _rerouter("open", "m3.wz2_2"),
    "closingLaneReroute on the whole edge": _rerouter("original", "m3_2"),
    "cones as stopped vehicles": _stopped_vehicles,
}


def _add(folder: Path, content: str) -> None:
    """Put elements into an additional file of their own."""
    config = folder / "run.sumocfg"
    name = f"more_{len(list(folder.glob('more_*')))}.add.xml"
    (folder / name).write_text(f"<additional>{content}</additional>")
    config.write_text(config.read_text().replace("freeway.add.xml", f"freeway.add.xml,{name}"))


def _run(placed: Path, name: str, make: Callable[[Path, Path], None], seed: int) -> dict[str, object]:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "way"
        make(placed, folder)
        _add(folder, LOOPS)
        fcd, statistics = folder / "fcd.xml", folder / "statistics.xml"
        command = [
            str(sumo_binary("sumo")), "-c", str(folder / "run.sumocfg"), "--seed", str(seed), "--end", "1200",
            "--fcd-output", str(fcd), "--fcd-output.attributes", "x,y,angle,type", "--statistic-output", str(statistics),
            "--no-step-log", "--no-warnings", "--duration-log.statistics",
        ]  # fmt: skip
        subprocess.run(command, check=True, capture_output=True)
        over = {id_ for id_ in entered(fcd, placed, sizes={"truck": TRUCK}) if not id_.startswith("cone")}
        rows = ET.parse(folder / "behind.xml").iter("interval")  # noqa: S314 a file that SUMO has just written
        behind = sum(int(row.get("nVehContrib", 0)) for row in rows if float(row.get("begin", 0)) >= 300)
        found = {element.tag: element.attrib for element in ET.parse(statistics).getroot()}  # noqa: S314
        return {
            "way": name, "seed": seed, "discharge_vph": behind * 4, "over_closed_ground": len(over),
            "vehicles": int(found["vehicles"]["inserted"]), "teleports": int(found["teleports"]["total"]),
        }  # fmt: skip


if __name__ == "__main__":
    main()
