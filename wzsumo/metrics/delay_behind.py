"""The delay that the ego causes to the vehicles behind it."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.frames import FloatArray, advance
from wzsumo.road import Road
from wzsumo.vehicle import VehicleGeometry

PACE_BIN_M = 25.0  # length of the bins of the road over which the pace without the ego is averaged; chosen by us


@dataclass(frozen=True, kw_only=True)
class DelayBehind:
    """Delay of the vehicles behind the ego while it drove; negative where they were faster than without the ego."""

    n_behind: int  # vehicles that were behind it at any time
    delay_behind_s: float  # sum over these vehicles
    delay_behind_per_vehicle_s: float  # 0 without such vehicles


def delay_behind(
    ego: pd.DataFrame, followers: pd.DataFrame, undisturbed: pd.DataFrame, *, road: Road, vehicle: VehicleGeometry
) -> DelayBehind:
    """The delay that the ego causes, from its log and from `followers`, a trace table of all vehicles at equal intervals.

    A vehicle counts in the intervals at whose start its centre is behind the ego's centre. Its delay in an interval is the
    length of the interval minus the time that the same distance took without the ego. That time follows from the pace of
    `undisturbed`, traces of the same drivers on the same road without the ego. The pace of a bin of the road is the time that
    all vehicles spent there over the distance that they drove there (Edie, Discussion of traffic stream measurements and
    definitions, 1963). Vehicles of the opposing direction do not count.
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
    same_direction = by_vehicle["station"].transform("last") >= by_vehicle["station"].transform("first")
    has_no_gap = spent < 1.5 * _interval(table["time"])
    counted = (table["behind"] & same_direction & has_no_gap).to_numpy()
    undisturbed_s = _undisturbed_time(table["station"][counted], later["station"][counted], undisturbed, road=road)
    n_behind = int(table["vehicle_id"][counted].nunique())
    total = float((spent[counted] - undisturbed_s).sum())
    return DelayBehind(n_behind=n_behind, delay_behind_s=total, delay_behind_per_vehicle_s=total / max(n_behind, 1))


def _interval(times: pd.Series) -> float:
    """Smallest difference [s] between two different times of a table."""
    return float(np.diff(np.unique(times.round(3))).min(initial=np.inf))


def _undisturbed_time(start: pd.Series, end: pd.Series, undisturbed: pd.DataFrame, *, road: Road) -> FloatArray:
    """Times [s] from stations to stations (n,) [m] at the pace of `undisturbed`; outside its stations at its fastest pace."""
    stations, _ = road.to_sd(undisturbed[["x_m", "y_m"]])
    table = pd.DataFrame({"id": undisturbed["vehicle_id"].to_numpy(), "t": undisturbed["time_s"].to_numpy(), "s": stations})
    later = table.groupby("id")[["t", "s"]].shift(-1)
    spent, driven = later["t"] - table["t"], later["s"] - table["s"]
    forward = ((spent > 0) & (driven >= 0)).to_numpy()
    edges = np.arange(stations.min(), stations.max() + PACE_BIN_M, PACE_BIN_M)
    time_in, _ = np.histogram(table["s"][forward], bins=edges, weights=spent[forward])
    distance_in, _ = np.histogram(table["s"][forward], bins=edges, weights=driven[forward])
    known = distance_in > 0
    pace = np.interp(np.arange(len(distance_in)), np.flatnonzero(known), time_in[known] / distance_in[known])
    passed = np.concatenate([[0.0], np.cumsum(pace * PACE_BIN_M)])

    def time_at(station: pd.Series) -> FloatArray:
        values = station.to_numpy(dtype=float)
        inside = np.interp(values, edges, passed)
        beyond = np.minimum(values - edges[0], 0) + np.maximum(values - edges[-1], 0)
        return np.asarray(inside + beyond * pace.min())

    return np.asarray(time_at(end) - time_at(start))
