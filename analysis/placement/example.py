"""The worked example of docs/guide/place.md: a freeway with two ramps, its left lane closed; figures and drawing.

    python analysis/placement/example.py --out docs/guide/place_example

netconvert makes the network, `wzsumo place` sets the zone up, SUMO runs the three configurations with five seeds.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
from closed_ground import entered
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wzsumo.placement.net import DEFAULT_LANE_WIDTH_M, parse_shape
from wzsumo.simulation.connection import sumo_binary

HERE = Path(__file__).parents[2] / "docs" / "guide" / "place_example"
CONFIGURATIONS = ("original", "open", "closed")
TRUCK = (7.1, 2.4)  # SUMO's, length and width [m]
BIN_M = 100.0
COLOURS = {"original": "#777777", "open": "#0072B2", "closed": "#D55E00"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        placed = place_example(Path(folder), routes=HERE / "freeway.rou.xml")
        rows, speeds = [], []
        for seed in args.seeds:
            for name in CONFIGURATIONS:
                row, speed = _run(placed, name, seed)
                rows.append({"configuration": name, "seed": seed} | row)
                speeds.append(speed.assign(configuration=name, seed=seed))
        table = pd.DataFrame(rows)
        table.to_csv(args.out / "runs.csv", index=False)
        print(table.groupby("configuration", sort=False).mean(numeric_only=True).round(2).to_string())
        _draw(placed, pd.concat(speeds)).savefig(args.out / "placed.png")


def place_example(folder: Path, *, routes: Path, position: float = 300.0) -> Path:
    """The folder that `wzsumo place` writes for the freeway of the example with this demand, at a position [m] of its edge."""
    net = folder / "freeway.net.xml"
    plain = ["-n", str(HERE / "freeway.nod.xml"), "-e", str(HERE / "freeway.edg.xml")]
    options = ["--ramps.guess", "--no-turnarounds", "-o", str(net), "--no-warnings", "--xml-validation", "never"]
    subprocess.run([str(sumo_binary("netconvert")), *plain, *options], check=True, capture_output=True)
    command = [
        "place",
        str(net),
        "--zone",
        str(HERE / "zone.toml"),
        "--at",
        "m3",
        f"{position:g}",
        "--out",
        str(folder / "placed"),
    ]
    files = ["--routes", str(routes), "--additionals", str(HERE / "freeway.add.xml")]
    subprocess.run([sys.executable, "-m", "wzsumo", *command, *files], check=True, capture_output=True)
    return folder / "placed"


def _run(placed: Path, name: str, seed: int) -> tuple[dict[str, float], pd.DataFrame]:
    """(figures of the run, mean speed by distance along the freeway)."""
    folder = placed / name
    statistics, fcd = folder / "statistics.xml", folder / "fcd.xml"
    command = [
        str(sumo_binary("sumo")), "-c", str(folder / "run.sumocfg"), "--seed", str(seed), "--statistic-output", str(statistics),
        "--fcd-output", str(fcd), "--fcd-output.attributes", "x,y,angle,speed,type", "--no-step-log", "--no-warnings",
        "--duration-log.statistics",
    ]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    found = {element.tag: element.attrib for element in ET.parse(statistics).getroot()}
    mean = found["vehicleTripStatistics"]
    over = len(entered(fcd, placed, sizes={"truck": TRUCK}))
    figures = {
        "vehicles": float(mean["count"]), "route_length_m": float(mean["routeLength"]), "duration_s": float(mean["duration"]),
        "time_loss_s": float(mean["timeLoss"]), "depart_delay_s": float(mean["departDelay"]),
        "over_closed_ground": float(over), "teleports": float(found["teleports"]["total"]),
    }  # fmt: skip
    places = [
        (float(vehicle.get("x", 0)), float(vehicle.get("speed", 0)))
        for _, step in ET.iterparse(fcd)
        if step.tag == "timestep"
        for vehicle in step
    ]
    table = pd.DataFrame(places, columns=["x_m", "speed_mps"])
    table["x_m"] = (table["x_m"] // BIN_M + 0.5) * BIN_M
    return figures, table.groupby("x_m")[["speed_mps"]].mean().reset_index()


def _draw(placed: Path, speeds: pd.DataFrame) -> Figure:
    figure = Figure(figsize=(10, 5.4), layout="constrained", dpi=120)
    lanes, along = figure.subplots(2, 1, height_ratios=[1.2, 1])
    _draw_lanes(lanes, placed)
    for name in CONFIGURATIONS:
        by_place = speeds[speeds["configuration"] == name].groupby("x_m")["speed_mps"].mean()
        along.plot(by_place.index, by_place, color=COLOURS[name], label=name, linestyle="--" if name == "original" else "-")
    along.set(xlabel="x [m]", ylabel="mean speed [m/s]", xlim=(0, 6000), ylim=(0, None))
    along.legend(frameon=False, ncols=3, loc="lower left")
    return figure


def _draw_lanes(axes: Axes, placed: Path) -> None:
    """SUMO's lanes of the closed network around the zone, and the devices, stretched sideways."""
    devices = pd.read_csv(placed / "devices.csv")
    start = devices[["x_m", "y_m"]].iloc[0].to_numpy()
    heading = float(devices["heading_rad"].median())
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    for lane in ET.parse(placed / "closed" / "freeway.net.xml").getroot().iter("lane"):
        points = (parse_shape(lane.get("shape", "")) - start) @ turn
        if points[:, 0].max() < -200 or points[:, 0].min() > 800 or lane.get("id", "").startswith(":"):
            continue
        half = float(lane.get("width") or DEFAULT_LANE_WIDTH_M) / 2
        colour = "#E69F00" if lane.get("allow") == "custom1" else "#56B4E9"
        axes.fill_between(points[:, 0], points[:, 1] - half, points[:, 1] + half, color=colour, alpha=0.45, linewidth=0)
        axes.plot(points[[0, 0], 0], points[0, 1] + np.array([-half, half]), color="#333333", linewidth=0.8)
    at = (devices[["x_m", "y_m"]].to_numpy() - start) @ turn
    axes.scatter(at[:, 0], at[:, 1], s=8, color="#D55E00", zorder=3, label="device")
    axes.fill_between([], [], [], color="#56B4E9", alpha=0.45, label="open lane in SUMO")
    axes.fill_between([], [], [], color="#E69F00", alpha=0.45, label="closed lane; bars where edges are cut")
    axes.set(xlabel="along the freeway from the first device [m]", ylabel="across [m]", xlim=(-150, 750), ylim=(-12.5, 1))
    axes.legend(frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8)


if __name__ == "__main__":
    main()
