"""Zones at random places of freeways that are drawn, too: lanes end and open from edge to edge, as netconvert joins them.

    python analysis/placement/drawn_networks.py --first 1 --n 100 --out drawn.csv

One freeway a seed: three to six edges of 150 to 1,200 m at small angles, with one to five lanes, as many as on the edge before
or one more or fewer; ten minutes of 800 to 2,600 cars and 150 trucks an hour from end to end. One place is drawn in each, and
judged as `random_placements.py` does.
"""

import argparse
import csv
import random
import subprocess
import tempfile
from pathlib import Path

from random_placements import COLUMNS, can_be_drawn, draw_place, try_place

from wzsumo.placement.configuration import Configuration
from wzsumo.placement.net import Net
from wzsumo.simulation.connection import sumo_binary

DEMANDS_VPH = (800, 1600, 2600)
LENGTHS_M, ASIDE_M = (150.0, 1200.0), 20.0  # of an edge, and by how much its end lies aside of its beginning
WORK_FT = (100.0, 300.0, 1000.0)
SPEEDS_MPH = (45.0, 55.0, 65.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--n", type=int, default=100)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    new = not args.out.exists()
    with args.out.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, restval="")
        if new:
            writer.writeheader()
        for seed in range(args.first, args.first + args.n):
            if row := _place_on_drawn_network(seed):
                writer.writerow(row)
                file.flush()
                print(row, flush=True)


def _place_on_drawn_network(seed: int) -> dict[str, object] | None:
    """The row of a seed; None where its freeway has one lane all along."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path, routes = draw_freeway(folder, rng)
        net = Net.read(path)
        edges = [edge for edge in net.edges.values() if can_be_drawn(edge, 0.0)]
        if not edges:
            return None
        place = draw_place(edges, rng)
        zone = argparse.Namespace(work_ft=rng.choice(WORK_FT), speed_mph=rng.choice(SPEEDS_MPH), begin=0.0, seconds=600.0)
        row = {"network": "drawn", "number": seed, "edge": place[0].id, "position_m": round(place[1], 1), "side": place[2],
               "lanes": place[3]}  # fmt: skip
        return row | try_place(net, Configuration.of_files(path, [routes], []), place, zone, folder / "placed", {})


def draw_freeway(folder: Path, rng: random.Random) -> tuple[Path, Path]:
    """A network and its routes, written into a folder."""
    x, y, n_edges, n_lanes = 0.0, 0.0, rng.randint(3, 6), rng.randint(2, 4)
    nodes, edges = ['<node id="n0" x="0" y="0"/>'], []
    for number in range(n_edges):
        x, y = x + rng.uniform(*LENGTHS_M), y + rng.uniform(-ASIDE_M, ASIDE_M)
        nodes.append(f'<node id="n{number + 1}" x="{x:.1f}" y="{y:.1f}"/>')
        edges.append(f'<edge id="e{number}" from="n{number}" to="n{number + 1}" numLanes="{n_lanes}" speed="29.06"/>')
        n_lanes = min(5, max(1, n_lanes + rng.choice([-1, 0, 0, 1])))
    (folder / "small.nod.xml").write_text(f"<nodes>{''.join(nodes)}</nodes>")
    (folder / "small.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    net, routes = folder / "small.net.xml", folder / "small.rou.xml"
    plain = ["-n", str(folder / "small.nod.xml"), "-e", str(folder / "small.edg.xml"), "-o", str(net)]
    subprocess.run([str(sumo_binary("netconvert")), *plain, "--no-warnings"], check=True, capture_output=True)
    flow = f'begin="0" end="600" from="e0" to="e{n_edges - 1}" departLane="best" departSpeed="max"'
    routes.write_text(
        f'<routes><vType id="car"/><vType id="truck" vClass="truck"/>'
        f'<flow id="cars" type="car" vehsPerHour="{rng.choice(DEMANDS_VPH)}" {flow}/>'
        f'<flow id="trucks" type="truck" vehsPerHour="150" {flow}/></routes>'
    )
    return net, routes


if __name__ == "__main__":
    main()
