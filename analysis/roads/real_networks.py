"""Stretches of public SUMO networks, found from made-up traces along them: which edges, how far the reference line is off.

    python analysis/roads/real_networks.py NET.net.xml ... --stretches 20 --seed 1 --out FILE.csv

A stretch is a walk over edges for cars, straight on at every junction, of at least 600 m. Six vehicles drive its lanes with a
constant error and white noise; the stretch is then found from them alone. Right is known from the network: the edges of the
walk, the number of their lanes, and the middle between the centre lines of the outer lanes that go through.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
import shapely

from wzsumo.errors import InputError
from wzsumo.frames import wrap_angle
from wzsumo.roads.matching import edges_of_traces
from wzsumo.roads.stretch import road_of_edges
from wzsumo.roads.sumo_net import SumoNet, read_net

LENGTH_M, N_VEHICLES, BIAS_SD_M, NOISE_SD_M, STEP_M = 600.0, 6, 1.5, 0.5, 25.0
MAX_TURN_RAD = np.pi / 6  # of a walk at a junction


def walk(net: SumoNet, rng: np.random.Generator) -> list[str] | None:
    """Edges along which a lane goes through, straight on, from a random lane; None where it ends before LENGTH_M."""
    edge = str(rng.choice(sorted(net.edges)))
    lane = int(rng.choice([lane.index for lane in net.edges[edge].car_lanes]))
    way, length = [edge], net.edges[edge].length
    while length < LENGTH_M:
        ahead = [
            (turn(net, way[-1], other), other, found.end_lane)
            for other in net.followers(way[-1])
            for found in net.connections[way[-1], other]
            if found.start_lane == lane and other not in way
        ]
        if not ahead or min(ahead)[0] > MAX_TURN_RAD:
            return None
        _, other, lane = min(ahead)
        way.append(other)
        length += net.edges[other].length
    return way


def turn(net: SumoNet, before: str, after: str) -> float:
    ends = [net.edges[before].car_lanes[-1].shape[-2:], net.edges[after].car_lanes[-1].shape[:2]]
    headings = [np.arctan2(*np.diff(end, axis=0)[0][::-1]) for end in ends]
    return abs(float(wrap_angle(headings[1] - headings[0])))


def drive(net: SumoNet, way: list[str], rng: np.random.Generator) -> pd.DataFrame:
    """Fixes of vehicles that keep to one lane, counted from the left, with GNSS errors."""
    tables = []
    for number in range(N_VEHICLES):
        from_left = number % min(len(net.edges[edge].car_lanes) for edge in way)
        line = shapely.LineString(np.concatenate([net.edges[edge].car_lanes[-1 - from_left].shape for edge in way]))
        at = np.arange(0.0, line.length, STEP_M)
        points = shapely.get_coordinates(shapely.line_interpolate_point(line, at))
        points = points + rng.normal(0, BIAS_SD_M, 2) + rng.normal(0, NOISE_SD_M, points.shape)
        tables.append(pd.DataFrame({"vehicle_id": f"v{number}", "time_s": at / 20, "x_m": points[:, 0], "y_m": points[:, 1]}))
    return pd.concat(tables, ignore_index=True)


def line_errors(net: SumoNet, way: list[str], reference: shapely.LineString, n_lanes: int) -> np.ndarray:
    """Distances [m] of the reference line from the middle of the lanes that go through, away from the ends of edges."""
    errors = []
    for edge in way:
        lanes = net.edges[edge].car_lanes
        # The lane followed is the one whose middle line the reference line lies beside at half their width: try all.
        best = np.inf * np.ones(1)
        for left in range(n_lanes - 1, len(lanes)):
            pair = [shapely.LineString(lanes[k].shape) for k in (left, left - n_lanes + 1)]
            share = np.linspace(0.05, 0.95, 10)
            ends = [shapely.get_coordinates(shapely.line_interpolate_point(line, share, normalized=True)) for line in pair]
            off = np.asarray(shapely.distance(shapely.points((ends[0] + ends[1]) / 2), reference))
            best = off if off.max() < best.max() else best
        errors.append(best)
    return np.concatenate(errors)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("nets", type=Path, nargs="+")
    parser.add_argument("--stretches", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    rows = []
    for path in args.nets:
        net, rng, found = read_net(path), np.random.default_rng(args.seed), 0
        for _ in range(100_000):
            if found == args.stretches:
                break
            way = walk(net, rng)
            if way is None:
                continue
            found += 1
            row: dict[str, object] = {"net": path.name, "stretch": found, "n_edges": len(way), "first": way[0]}
            try:
                edges = edges_of_traces(net, drive(net, way, rng), source="traces")
                row |= {"same_edges": edges == way, "jaccard": len(set(edges) & set(way)) / len(set(edges) | set(way))}
                made = road_of_edges(net, way, shoulders=None, source=path.name)
                errors = line_errors(net, way, shapely.LineString(made.road.reference_line), made.road.own_lanes)
                counts = [count.lanes for count in made.counts] == [len(net.edges[edge].car_lanes) for edge in way]
                row |= {
                    "line_p95_m": float(np.quantile(errors, 0.95)), "line_max_m": float(errors.max()), "counts_right": counts,
                    "lanes": made.road.own_lanes, "length_m": made.road.length, "refused": "",
                }  # fmt: skip
            except InputError as error:
                row["refused"] = str(error)
            rows.append(row)
    table = pd.DataFrame(rows)
    table.to_csv(args.out, index=False, float_format="%.3f")
    for name, part in table.groupby("net", sort=False):
        roads = part[part["refused"] == ""]
        print(
            f"{name}: {len(part)} stretches, edges as driven {int(part['same_edges'].fillna(False).sum())}, Jaccard "
            f"{part['jaccard'].mean():.3f}; roads {len(roads)}, line within 0.15 m {int((roads['line_max_m'] < 0.15).sum())}, "
            f"counts right {int(roads['counts_right'].sum())}"
        )


if __name__ == "__main__":
    main()
