"""Do automated vehicles become moving bottlenecks? Throughput and delay with 0, 5, 20 and 50 % of them, at two speeds.

    python analysis/traffic/moving_bottleneck.py --first 91 --seeds 3 [--scenario scenarios/paper.toml] [--out FOLDER]

An automated vehicle drives like all others up to the announced zone. Between the zone's first and last device it goes no faster
than the speed that is studied (Chen, Luo & Feng 2022 drive 10 m/s). SUMO counts no delay against a limit that a vehicle has of
its own, so the other drivers' delay is compared. A nested hash of their ids decides which vehicles are automated. Arrivals are
Poisson: a quarter of an hour of 1,500 veh/h brings 375 vehicles give or take 19, so the figure shows how many arrived.
Writes into --out: rows.csv, one row a run, as they come (a study that was stopped goes on where it was), and
moving_bottleneck.png; prints means and standard deviations over the seeds.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.sensing.equipped import choose_equipped
from wzsumo.simulation.files import write_sumo_files
from wzsumo.simulation.session import running
from wzsumo.simulation.trips import TRIP_OPTIONS, read_trips
from wzsumo.units import mps_from_mph

SHARES = (0.0, 0.05, 0.2, 0.5)
PAPER_SPEED_MPS = 10.0
WARM_UP_S = 180.0
COLOURS = ("#0072B2", "#D55E00")  # Okabe & Ito 2008


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", type=Path, default=Path(__file__).parents[2] / "scenarios" / "paper.toml")
    parser.add_argument("--first", type=int, default=91, help="first seed")
    parser.add_argument("--seeds", type=int, default=3, help="number of seeds")
    parser.add_argument("--out", type=Path, default=Path("results/moving_bottleneck"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    rows_file = args.out / "rows.csv"
    done = pd.read_csv(rows_file) if rows_file.exists() else pd.DataFrame(columns=["seed", "share", "speed_mps"])
    for seed in range(args.first, args.first + args.seeds):
        scenario = load_scenario(args.scenario, seed=seed)
        zone_speed = round(mps_from_mph(scenario.work_zone.posted_speed_mph), 3)
        cases = [(0.0, zone_speed)] + [(share, speed) for share in SHARES[1:] for speed in (PAPER_SPEED_MPS, zone_speed)]
        for share, speed in cases:
            known = (done["seed"] == seed) & (done["share"] == share) & (done["speed_mps"] == speed)
            if not known.any():
                row = {"seed": seed, "share": share, "speed_mps": speed} | run(scenario, share=share, speed=speed)
                pd.DataFrame([row]).to_csv(rows_file, mode="a", header=not rows_file.exists(), index=False)
                print(row, file=sys.stderr)
    table = pd.read_csv(rows_file)
    summary = table.groupby(["speed_mps", "share"])[["throughput_vph", "mean_delay_s", "mean_delay_human_s"]].agg(
        ["mean", "std"]
    )
    print(summary.round(1).to_string())
    draw(table).savefig(args.out / "moving_bottleneck.png", dpi=150)


def run(scenario: Scenario, *, share: float, speed: float) -> dict[str, float]:
    """Throughput behind the activity area and mean delays of one simulation, the wait to enter the road included."""
    layout = scenario.layout()
    end = layout.area("activity area").end
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(layout, Path(folder), spec=scenario.zone_simulation(), seed=scenario.seed)
        trips = Path(folder) / "trips.xml"
        n_passed = 0
        behind: set[str] = set()
        automated: set[str] = set()
        limited: set[str] = set()
        with running(files.config, options=("--tripinfo-output", str(trips), *TRIP_OPTIONS)) as session:
            while session.time < files.duration:
                session.step()
                if session.time % 1.0 > files.step_length / 2:
                    continue
                session.resolve_gridlock()
                traffic = session.traffic()
                station = layout.road.to_sd(traffic.poses[:, :2])[0] if traffic.ids else np.empty(0)
                automated |= set(choose_equipped(pd.Index(traffic.ids), penetration=share, seed=scenario.seed))
                for name, place in zip(traffic.ids, station, strict=True):
                    if name in automated and (name in limited) != (layout.start <= place <= layout.end):
                        inside = name not in limited
                        session.limit_speed(name, speed if inside else None)
                        (limited.add if inside else limited.discard)(name)
                    if place > end and name not in behind:
                        behind.add(name)
                        n_passed += session.time > WARM_UP_S
        table = read_trips(trips)
    delay = table["time_loss_s"] + table["departure_delay_s"]
    human = ~table["vehicle_id"].isin(automated)
    return {
        "arrivals_vph": 3600 * len(table) / files.duration,
        "throughput_vph": 3600 * n_passed / (files.duration - WARM_UP_S),
        "mean_delay_s": float(delay.mean()),
        "mean_delay_human_s": float(delay[human].mean()),
        "n_arrived": int(table["arrived"].sum()),
    }


def draw(table: pd.DataFrame) -> Figure:
    """Throughput and the other drivers' delay over the share of automated vehicles: mean and range over the seeds."""
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    for axes, column, label in zip(
        figure.subplots(1, 2),
        ("throughput_vph", "mean_delay_human_s"),
        ("throughput [veh/h]", "mean delay of the other drivers [s]"),
        strict=True,
    ):
        base = table[table["share"] == 0]
        for colour, (key, part) in zip(COLOURS, table[table["share"] > 0].groupby("speed_mps"), strict=False):
            speed = float(str(key))
            means = pd.concat([base, part]).groupby("share")[column].agg(["mean", "min", "max"])
            axes.plot(
                100 * means.index,
                means["mean"],
                "o-",
                color=colour,
                label=f"{speed:.1f} m/s ({speed / mps_from_mph(1):.0f} mph) in the zone",
            )
            axes.fill_between(100 * means.index, means["min"], means["max"], color=colour, alpha=0.2, linewidth=0)
        axes.set(xlabel="automated vehicles [%]", ylabel=label, ylim=(0, None))
        axes.grid(color="#E5E5E5")
    arrivals = table.drop_duplicates("seed")["arrivals_vph"].mean()
    figure.axes[0].axhline(arrivals, color="#555555", linestyle="--", linewidth=1, label="arrivals of these seeds")
    figure.axes[0].set_ylim(0, 1.1 * arrivals)
    figure.axes[0].legend(title=f"line: mean, band: range of {table['seed'].nunique()} seeds", fontsize=8, title_fontsize=8)
    return figure


if __name__ == "__main__":
    main()
