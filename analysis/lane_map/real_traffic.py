"""Real vehicles on freeways as kinds: NGSIM I-80 and US-101 (US DOT, public), with lanes that are known.

    python analysis/lane_map/real_traffic.py --ngsim trajectories-0400-0415.csv --out results/real      # -> i80.parquet
    python analysis/lane_map/real_traffic.py --fixes traces.csv [MORE.csv] --out results/real           # -> i80.parquet
    python analysis/lane_map/real_traffic.py --scenarios FOLDER --map NGSIM_US_101.xml --out results/real   # -> us101.parquet

    from real_traffic import real_kinds
    real_kinds(Path("results/real"))["us101"].case(n=30, seed=1, receivers="1")       # as a kind of kinds.py

I-80 is read from the files of the US DOT (Local_X and Local_Y of vehicles that stay in lanes 1 to 3, 12 ft wide), or from trace
tables (x_m along the road, y_m to the left from the left edge of lane 1). US-101 is read from CommonRoad scenarios: cuts of the
recording of 3 to 17 s with the lanelets, of which most share one frame but for a translation. None of it is kept in the
repository. Receivers' errors are added as to the generated kinds; where none of the lanes is closed, a zone is announced.
"""

import argparse
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import shapely
from cases import FOOT_M, Case
from commonroad import joined_scenarios
from receivers import receiver_of
from shapely.geometry.base import BaseGeometry

from wzsumo.frames import FloatArray

I80_LANES, I80_LANE_M = 3, 12 * FOOT_M
ANNOUNCED_SHARE = (0.3, 0.7)  # of the road, where a zone is announced in which nothing is closed


@dataclass(frozen=True, kw_only=True, eq=False)
class RealKind:
    """Trips (trip, t, x, y) of real vehicles, the ground of their lanes, and the road's axis with the mean lane width [m]."""

    name: str
    trips: pd.DataFrame
    drivable: BaseGeometry
    scored: BaseGeometry
    axis: FloatArray
    lanes: int
    width: float
    resolution_m: float = 0.254

    def case(
        self,
        *,
        n: int,
        seed: int,
        receivers: str = "0.5",
        faults: Iterable[str] = (),
        interval_s: float = 1.0,
        states_accuracy: bool = False,
        common_offset_m: float = 0.0,
        announced_shift_m: float = 0.0,
        road_offset_m: float = 0.0,
    ) -> Case:
        """Traces of n trips drawn by the seed, with errors of receivers; arguments as those of `Kind.case`."""
        if tuple(faults):
            raise ValueError(f"{self.name}: faults={tuple(faults)} are not made of real vehicles")
        names = self.trips["trip"].unique()
        if n > len(names):
            raise ValueError(f"{self.name}: n={n} must be at most its {len(names)} trips")
        chosen = np.random.default_rng([seed, 17]).permutation(names)[:n]
        of_trip = dict(iter(self.trips.groupby("trip")))
        tables = [
            _reported(of_trip[trip], number, receivers, interval_s=interval_s, seed=seed) for number, trip in enumerate(chosen)
        ]
        traces = pd.concat(tables, ignore_index=True)
        if not states_accuracy:
            traces = traces.drop(columns="position_sd_m")
        across = _normals(self.axis)
        traces[["x_m", "y_m"]] += common_offset_m * across.mean(axis=0)
        return Case(
            name=self.name,
            traces=traces,
            road_toml=self._road_file(self.axis + road_offset_m * across, announced_shift_m),
            drivable=self.drivable,
            scored=self.scored,
            resolution_m=self.resolution_m,
        )

    def _road_file(self, axis: FloatArray, announced_shift_m: float) -> str:
        length = float(np.hypot(*np.diff(axis, axis=0).T).sum())
        start, end = ((share * length + announced_shift_m) / FOOT_M for share in ANNOUNCED_SHARE)
        points = ", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in axis)
        return (
            f"[road]\nlane_count = {self.lanes}\nlane_width_ft = {self.width / FOOT_M:.3f}\nleft_shoulder_ft = 6.0\n"
            f"right_shoulder_ft = 10.0\nreference_points_m = [{points}]\n"
            f"[announced]\nstart_ft = {start:.1f}\nend_ft = {end:.1f}\n"
        )


def real_kinds(folder: Path) -> dict[str, RealKind]:
    """The kinds whose trips are in a folder that this script wrote, by name."""
    kinds = {}
    if (folder / "i80.parquet").exists():
        kinds["i80"] = _i80(pd.read_parquet(folder / "i80.parquet"))
    if (folder / "us101.parquet").exists():
        kinds["us101"] = _us101(pd.read_parquet(folder / "us101.parquet"), folder / "us101_lanes.json")
    return kinds


def _reported(trip: pd.DataFrame, number: int, receivers: str, *, interval_s: float, seed: int) -> pd.DataFrame:
    """The fixes that a receiver reports of a trip, one every `interval_s` [s]."""
    random = np.random.default_rng([seed, number, 5])
    t = trip["t"].to_numpy()
    at = np.arange(t[0] + random.uniform(0, min(interval_s, 0.3 * np.ptp(t))), t[-1] + 1e-6, interval_s)
    receiver = receiver_of(receivers, seed=seed, number=number)
    error = receiver.errors(at, random)
    x, y = (np.interp(at, t, trip[axis]) for axis in ("x", "y"))
    columns = {"time_s": at - t[0] + 20.0 * number, "x_m": x + error[:, 0], "y_m": y + error[:, 1]}
    return pd.DataFrame({"vehicle_id": f"v{number:05d}", **columns, "position_sd_m": receiver.error})


def _i80(trips: pd.DataFrame) -> RealKind:
    """Lanes 1 to 3, counted from the left, on a straight; trips of the file's own frame."""
    low, high = trips["x"].quantile([0.02, 0.98])
    axis = np.array([[low - 150.0, -I80_LANES * I80_LANE_M / 2], [high + 150.0, -I80_LANES * I80_LANE_M / 2]])
    drivable = shapely.box(low, -I80_LANES * I80_LANE_M, high, 0.0)
    scored = shapely.box(low, -I80_LANES * I80_LANE_M - 15.0, high, 15.0)
    return RealKind(
        name="i80", trips=trips, drivable=drivable, scored=scored, axis=axis, lanes=I80_LANES, width=I80_LANE_M
    )  # fmt: skip


def _us101(trips: pd.DataFrame, lanes_file: Path) -> RealKind:
    """Five lanes with an on-ramp and an off-ramp that an auxiliary lane joins; scored where most trips are."""
    content = json.loads(lanes_file.read_text())
    grounds = [shapely.Polygon(ring) for ring in content["lanelets"]]
    left, right = np.array(content["left"]), np.array(content["right"])
    axis = (left + right) / 2
    width = float(np.median(np.hypot(*(left - right).T))) / content["lanes"]
    at = np.r_[0.0, np.cumsum(np.hypot(*np.diff(axis, axis=0).T))]
    kept = (at >= content["scored"][0]) & (at <= content["scored"][1])
    scored = shapely.LineString(axis[kept]).buffer(content["lanes"] * width / 2 + 15.0, cap_style="flat")
    drivable = shapely.union_all(shapely.buffer(grounds, 0.05)).buffer(-0.05).intersection(scored)  # 0.05 m closes the seams
    return RealKind(
        name="us101", trips=trips, drivable=drivable, scored=scored, axis=axis, lanes=content["lanes"], width=width
    )  # fmt: skip


def _normals(axis: FloatArray) -> FloatArray:
    """Unit vectors (n, 2) to the left of an axis (n, 2)."""
    along = np.gradient(axis, axis=0)
    along /= np.hypot(*along.T)[:, None]
    return np.column_stack([-along[:, 1], along[:, 0]])


def trips_of_ngsim(path: Path) -> pd.DataFrame:
    """Trips of the vehicles of an NGSIM file that stay in lanes 1 to 3 for 300 m: x along the road, y from the left edge [m].

    Columns by name where the file has a header, else in the order of the NGSIM data dictionary; positions are of front centres.
    """
    names = ["vehicle_id", "frame_id", "total_frames", "global_time", "local_x", "local_y", "global_x", "global_y", "v_length"]
    names += ["v_width", "v_class", "v_vel", "v_acc", "lane_id", "preceding", "following", "space_headway", "time_headway"]
    with path.open() as file:
        has_header = file.readline().lstrip()[:1].isalpha()
    table = (
        pd.read_csv(path) if has_header else pd.read_csv(path, sep=r"\s+|,", engine="python", header=None, names=names)
    )  # fmt: skip
    table.columns = table.columns.str.lower()
    if "location" in table:
        table = table[table["location"] == "i-80"]
    epoch = table["global_time"] // 3_600_000  # vehicle numbers begin anew with each recording
    trips = pd.DataFrame(
        {
            "trip": epoch.astype(str) + "_" + table["vehicle_id"].astype(str),
            "t": table["global_time"] / 1000.0,
            "x": (table["local_y"] - table["v_length"] / 2) * FOOT_M,
            "y": -table["local_x"] * FOOT_M,
        }
    )
    stays = table["lane_id"].le(I80_LANES).groupby(trips["trip"]).transform("all")
    far = trips.groupby("trip")["x"].transform(np.ptp) >= 300.0
    return trips[stays & far].sort_values(["trip", "t"], ignore_index=True)


def trips_of_fixes(paths: Iterable[Path]) -> pd.DataFrame:
    """Trips of trace tables whose frame is that of I-80's lanes; a vehicle that is in several files counts once."""
    tables = {name: part for path in paths for name, part in pd.read_csv(path).groupby("vehicle_id")}
    table = pd.concat(tables.values(), ignore_index=True)
    columns = {"vehicle_id": "trip", "time_s": "t", "x_m": "x", "y_m": "y"}
    return table.rename(columns=columns)[list(columns.values())]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/real"))
    parser.add_argument("--ngsim", type=Path, help="I-80 file of the US DOT")
    parser.add_argument("--fixes", type=Path, nargs="+", help="trace tables of I-80 vehicles")
    parser.add_argument("--scenarios", type=Path, help="folder of CommonRoad's USA_US101 scenarios")
    parser.add_argument("--map", type=Path, help="CommonRoad map of US-101")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    if args.ngsim or args.fixes:
        trips = trips_of_ngsim(args.ngsim) if args.ngsim else trips_of_fixes(args.fixes)
        trips.to_parquet(args.out / "i80.parquet", index=False)
        print(f"i80: {trips['trip'].nunique()} trips")
    if args.scenarios and args.map:
        joined, lanes = joined_scenarios(sorted(args.scenarios.glob("USA_US101*.xml")), args.map)
        joined.to_parquet(args.out / "us101.parquet", index=False)
        (args.out / "us101_lanes.json").write_text(json.dumps(lanes))
        print(f"us101: {joined['trip'].nunique()} trips")


if __name__ == "__main__":
    main()
