"""What the ego costs those behind it: their time beyond what the same road took without it."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.frames import FloatArray, advance
from wzsumo.road import Road
from wzsumo.vehicle import VehicleGeometry

BIN_M = 25.0  # of the road, in which the pace without the ego is a mean


@dataclass(frozen=True, kw_only=True)
class DelayBehind:
    """Delay of the vehicles behind the ego while it drove; below 0 where they were faster than without it."""

    n_behind: int  # vehicles that were behind it at any time
    delay_behind_s: float  # of all of them together
    delay_behind_per_vehicle_s: float  # 0 where there was none


def delay_behind(
    ego: pd.DataFrame, followers: pd.DataFrame, undisturbed: pd.DataFrame, *, road: Road, vehicle: VehicleGeometry
) -> DelayBehind:
    """The delay that the ego of a log causes, of `followers`, a trace table of all on the road at equal intervals.

    Each is counted from interval to interval while its centre is behind the ego's on the road: the interval's length less the
    time that the vehicles of `undisturbed`, traces of the same road and drivers without the ego, took for the way it went.
    Their pace is Edie's, all time spent in a bin of the road over all way made there (Edie, Discussion of traffic stream
    measurements and definitions, 1963). Whoever comes the other way is not counted.
    """
    centres = advance(ego[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float), vehicle.axle_to_centre_m)
    ego_station, _ = road.to_sd(centres[:, :2])
    station, _ = road.to_sd(followers[["x_m", "y_m"]])
    table = pd.DataFrame({
        "vehicle_id": followers["vehicle_id"].to_numpy(), "time": followers["time_s"].to_numpy(dtype=float), "station": station,
        "behind": station < np.interp(followers["time_s"], ego["time_s"], ego_station, left=-np.inf, right=-np.inf),
    }).sort_values(["vehicle_id", "time"])  # fmt: skip
    by_vehicle = table.groupby("vehicle_id")
    later = by_vehicle[["time", "station"]].shift(-1)
    spent = later["time"] - table["time"]
    same_way = by_vehicle["station"].transform("last") >= by_vehicle["station"].transform("first")
    counted = (table["behind"] & same_way & (spent < 1.5 * _interval(table["time"]))).to_numpy()
    needed = _time_needed(table["station"][counted], later["station"][counted], undisturbed, road=road)
    n_behind = int(table["vehicle_id"][counted].nunique())
    total = float((spent[counted] - needed).sum())
    return DelayBehind(n_behind=n_behind, delay_behind_s=total, delay_behind_per_vehicle_s=total / max(n_behind, 1))


def _interval(times: pd.Series) -> float:
    return float(np.diff(np.unique(times.round(3))).min(initial=np.inf))


def _time_needed(start: pd.Series, end: pd.Series, undisturbed: pd.DataFrame, *, road: Road) -> FloatArray:
    """Time [s] from stations to stations (n,) [m] at the pace of `undisturbed`; beyond its ends at that of its fastest bin."""
    stations, _ = road.to_sd(undisturbed[["x_m", "y_m"]])
    table = pd.DataFrame({"id": undisturbed["vehicle_id"].to_numpy(), "t": undisturbed["time_s"].to_numpy(), "s": stations})
    later = table.groupby("id")[["t", "s"]].shift(-1)
    spent, way = later["t"] - table["t"], later["s"] - table["s"]
    made = ((spent > 0) & (way >= 0)).to_numpy()
    edges = np.arange(stations.min(), stations.max() + BIN_M, BIN_M)
    time_in, _ = np.histogram(table["s"][made], bins=edges, weights=spent[made])
    way_in, _ = np.histogram(table["s"][made], bins=edges, weights=way[made])
    known = way_in > 0
    pace = np.interp(np.arange(len(way_in)), np.flatnonzero(known), time_in[known] / way_in[known])
    passed = np.concatenate([[0.0], np.cumsum(pace * BIN_M)])

    def time_at(station: pd.Series) -> FloatArray:
        values = station.to_numpy(dtype=float)
        inside = np.interp(values, edges, passed)
        beyond = np.minimum(values - edges[0], 0) + np.maximum(values - edges[-1], 0)
        return np.asarray(inside + beyond * pace.min())

    return np.asarray(time_at(end) - time_at(start))
