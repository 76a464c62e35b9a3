"""Figures of the traffic of a whole network, with and without a zone: delay, departure delay, emissions; and edge by edge.

They are sums and means of SUMO's own records of trips and edges. Vehicles that have not arrived, or not departed, count with
what they have lost so far: a zone that holds vehicles back would otherwise look better the more it holds back.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import pandas as pd

HOUR_S = 3600.0


@dataclass(frozen=True, kw_only=True)
class NetworkSummary:
    """Figures of one simulation. Delays are against the drivers' own free speeds."""

    n_vehicles: int  # due to depart
    n_arrived: int
    n_waiting: int  # that still wait to depart at the end
    delay_h: float  # veh h, all vehicles together, departure delay included
    mean_delay_s: float  # the same by vehicle
    mean_departure_delay_s: float  # of all vehicles, also those that still wait
    mean_travel_time_s: float  # of those that arrived; NaN: none did
    driven_vkm: float
    co2_kg: float
    nox_kg: float
    fuel_kg: float
    corridor_delay_h: float  # veh h lost on the road of the zone
    corridor_vkm: float
    corridor_co2_kg: float
    corridor_nox_kg: float
    corridor_fuel_kg: float


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkMeasures:
    """A network with and without the zone, in simulations that differ by the zone alone."""

    with_zone: NetworkSummary
    without_zone: NetworkSummary
    edges: pd.DataFrame  # `compare_edges`


def summarise_network(trips: pd.DataFrame, edges: pd.DataFrame, *, road: set[str]) -> NetworkSummary:
    """Summary of SUMO's trips and edge records; `road` are the edges along the road of the zone."""
    lost_s = trips["lost_so_far_s"] + trips["departure_delay_s"]
    on_road = edges[edges["edge_id"].isin(road)]
    return NetworkSummary(
        n_vehicles=len(trips),
        n_arrived=int(trips["arrived"].sum()),
        n_waiting=int((~trips["entered"]).sum()),
        delay_h=float(lost_s.sum() / HOUR_S),
        mean_delay_s=float(lost_s.mean()),
        mean_departure_delay_s=float(trips["departure_delay_s"].mean()),
        mean_travel_time_s=float(trips["travel_time_s"].mean()),
        driven_vkm=float(trips["distance_m"].sum() / 1000),
        co2_kg=float(trips["co2_g"].sum() / 1000),
        nox_kg=float(trips["nox_g"].sum() / 1000),
        fuel_kg=float(trips["fuel_g"].sum() / 1000),
        corridor_delay_h=float(on_road["time_loss_s"].sum() / HOUR_S),
        corridor_vkm=float(on_road["driven_m"].sum() / 1000),
        corridor_co2_kg=float(on_road["co2_g"].sum() / 1000),
        corridor_nox_kg=float(on_road["nox_g"].sum() / 1000),
        corridor_fuel_kg=float(on_road["fuel_g"].sum() / 1000),
    )


def compare_edges(with_zone: pd.DataFrame, without_zone: pd.DataFrame, *, shapes: Mapping[str, str]) -> pd.DataFrame:
    """edge_id, delay_with_zone_s, delay_without_zone_s, delay_change_s and shape of every edge.

    `shapes` are those of the edges between junctions. Edges within junctions have none, and a row where vehicles were on them.
    """
    both = [
        table.set_index("edge_id")["time_loss_s"].rename(f"delay_{name}_s")
        for table, name in ((with_zone, "with_zone"), (without_zone, "without_zone"))
    ]
    edges = pd.concat([*both, pd.Series(dict(shapes), name="shape", dtype=object)], axis=1)
    edges = edges.fillna(dict.fromkeys(edges.columns[:2], 0.0)).sort_index().rename_axis("edge_id").reset_index()
    change = edges["delay_with_zone_s"] - edges["delay_without_zone_s"]
    return edges.assign(delay_change_s=change)


def network_figures(measures: NetworkMeasures) -> dict[str, dict[str, float]]:
    """with_zone, without_zone and their difference, `change`, by the names of NetworkSummary."""
    both = asdict(measures.with_zone), asdict(measures.without_zone)
    return {"with_zone": both[0], "without_zone": both[1], "change": {key: both[0][key] - both[1][key] for key in both[0]}}


def trips_on_road(traces: pd.DataFrame, trips: pd.DataFrame, *, free_speed: float, dt: float) -> pd.DataFrame:
    """The trips of the vehicles that were seen on the road, over the road alone; emissions are not known by vehicle (NaN).

    `traces` are those of the road, every vehicle every `dt` [s]; time lost is against `free_speed` [m/s], the posted one. A
    vehicle has arrived that left the road before the simulation's end.
    """
    slower = (1 - traces["speed_mps"] / free_speed).clip(lower=0) * dt
    by_vehicle = traces.assign(lost=slower, driven=traces["speed_mps"] * dt).groupby("vehicle_id")
    first, last = by_vehicle["time_s"].min(), by_vehicle["time_s"].max()
    lost, arrived = by_vehicle["lost"].sum(), last < traces["time_s"].max() - 1.5 * dt
    known = trips.set_index("vehicle_id").loc[lost.index]
    nothing = float("nan")
    return known.assign(
        arrived=arrived, travel_time_s=(last - first).where(arrived), time_loss_s=lost.where(arrived), lost_so_far_s=lost,
        distance_m=by_vehicle["driven"].sum(), co2_g=nothing, nox_g=nothing, fuel_g=nothing,
    ).reset_index()  # fmt: skip
