"""Figures of a zone's traffic: throughput, queue, delay, speeds, merging, hard braking, conflicts, emissions.

They are computed from the trace table and SUMO's trip records. `VEHICLE_COLUMNS`, `MINUTE_COLUMNS` and `STATION_COLUMNS`
describe the three tables, `TrafficSummary` the figures of the whole run.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.frames import FloatArray
from wzsumo.metrics.discharge import QUEUED_SPEED_SHARE, bottleneck_discharge
from wzsumo.metrics.fleet import merge_positions
from wzsumo.metrics.fleet_conflicts import fleet_conflicts
from wzsumo.metrics.lock import Lock, find_lock
from wzsumo.metrics.space_time import SpaceTime, queue_lengths, space_time_grid
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import WorkZoneLayout

VEHICLE_COLUMNS = {
    "vehicle_id": "-",
    "entered_s": "time of the first fix; NaN: still waiting to enter",
    "departure_delay_s": "wait for a gap to enter the road",
    "travel_time_s": "from one end of the road to the other; NaN: not there yet",
    "delay_s": "time lost against the driver's own free speed, and the departure delay; NaN: not there yet",
    "merge_position_m": "where the vehicle left a closing lane, from the start of its merging taper; NaN: it was not in one",
    "hard_brakes": "number of times that the speed fell by 2.67 m/s or more within a second",
    "overlap": "whether its outline ever overlapped another's",
    "min_ttc_s": "least time to collision with any other, inf above 5 s",
    "max_drac_mps2": "greatest deceleration to avoid a crash, 0 without a time to collision of 5 s or less",
    "pet_s": "least post-encroachment time, inf above 2 s",
    "co2_g": "carbon dioxide on the road so far, SUMO's default emission classes",
    "nox_g": "nitrogen oxides, ibid.",
    "fuel_g": "fuel, ibid.",
}
MINUTE_COLUMNS = {
    "time_s": "start of the minute",
    "count": "vehicles past the middle of the activity area",
    "upstream_speed_mps": "space-mean speed 300 to 400 m ahead of the bottleneck; NaN: no vehicle there",
    "queue_length_m": "how far the queue reached back from the end of the last merging taper, at most in that minute",
}
STATION_COLUMNS = {
    "station_m": "start of a stretch of 20 m",
    "flow_vph": "all lanes, after the warm-up",
    "density_vpkm": "ibid.",
    "speed_mps": "space-mean speed, ibid.",
    "speed_sd_mps": "standard deviation of the speed that vehicles spend their time at, ibid.",
}
CELL_S, CELL_M = 10.0, 20.0  # space-time grid: finer than a stop-and-go wave, coarser than a car and its gap; chosen by us
UPSTREAM_M = (400.0, 300.0)  # stretch upstream of the bottleneck whose speed shows a breakdown; chosen by us
TAPER_APPROACH_M = 200.0  # distance ahead of the zone from which the spread of speeds counts; chosen by us
HARD_BRAKE_MPS2 = 2.67  # 0.272 g over a second: the threshold of connected-vehicle "hard braking" (Hunter et al. 2021)
TTC_CONFLICT_S = 1.5  # default of FHWA's Surrogate Safety Assessment Model (Gettman et al. 2008, FHWA-HRT-08-051)
# Below the net time gap of most drivers, so that car following is no conflict; chosen by us. SSAM takes all up to 5 s (ibid.).
PET_CONFLICT_S = 1.0
DRAC_CONFLICT_MPS2 = 3.35  # Archer 2005: above it a conflict is severe
HOUR_S, MINUTE_S = 3600.0, 60.0


@dataclass(frozen=True, kw_only=True)
class TrafficSummary:
    """Figures of one run. Delays and travel times are those of vehicles that arrived; NaN where none did."""

    n_vehicles: int  # due to enter the road within the run
    n_arrived: int  # at the road's end
    n_waiting: int  # that still wait to enter at the end of the run
    locked_s: float  # time from which a vehicle stood and never drove on; NaN: the traffic did not lock
    locked_station_m: float  # where that vehicle stood
    # Flows are past the middle of the activity area, from the end of the warm-up to a lock or the end of the run.
    throughput_vph: float
    breakdown_s: float  # time at which a queue began to stand; NaN: none did
    peak_flow_vph: float  # highest of 15 minutes, up to the breakdown if there was one; NaN where there are fewer minutes
    queue_discharge_vph: float  # mean while the queue stands
    max_queue_length_m: float  # from the end of the last merging taper back to the queue's tail
    mean_queue_length_m: float  # over time, after the warm-up
    mean_travel_time_s: float
    mean_delay_s: float  # departure delay included
    p95_delay_s: float
    mean_departure_delay_s: float  # of all vehicles, also those that still wait
    speed_sd_taper_mps: float  # greatest standard deviation of any 20 m from 200 m ahead of the zone to its end
    n_merges: int  # vehicles that left a closing lane
    n_hard_braking: int  # vehicles that braked hard at least once
    hard_brakes_per_1000_vkm: float
    n_overlapping: int  # vehicles whose outline overlapped another's
    n_ttc_conflicts: int  # vehicles with a time to collision below 1.5 s
    n_drac_conflicts: int  # vehicles that would have needed more than 3.35 m/s2
    n_pet_conflicts: int  # vehicles with a post-encroachment time below 1 s
    co2_g_per_vkm: float
    nox_g_per_vkm: float
    fuel_g_per_vkm: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TrafficMeasures:
    """All measures of one run."""

    summary: TrafficSummary
    vehicles: pd.DataFrame  # VEHICLE_COLUMNS
    minutes: pd.DataFrame  # MINUTE_COLUMNS
    stations: pd.DataFrame  # STATION_COLUMNS
    grid: SpaceTime


def measure_traffic(
    traces: pd.DataFrame, trips: pd.DataFrame, layout: WorkZoneLayout, *, dt: float, warm_up_s: float
) -> TrafficMeasures:
    """Measures of a fleet's trace table (every vehicle every `dt` [s]) and SUMO's trips; flows count from `warm_up_s` on."""
    station, offset = layout.road.to_sd(traces[["x_m", "y_m"]])
    table = traces.assign(s=station, d=offset)
    posted = mps_from_mph(layout.work_zone.posted_speed_mph)
    grid = space_time_grid(table["time_s"], station, table["speed_mps"], dt=dt, cell_s=CELL_S, cell_m=CELL_M)
    queues = queue_lengths(grid, bottleneck=bottleneck_station(layout), slow=QUEUED_SPEED_SHARE * posted)
    vehicles = _vehicles(table, trips, layout, dt=dt)
    minutes = _minutes(table, grid, queues, layout, n=int((table["time_s"].max() + dt + 1e-6) // MINUTE_S))
    stations = _stations(table[table["time_s"] >= warm_up_s], grid, warm_up_s=warm_up_s)
    lock = find_lock(table, station, layout) or Lock(began_s=float("nan"), station_m=float("nan"))
    is_counted = (minutes["time_s"] >= warm_up_s) & ~(minutes["time_s"] + MINUTE_S > lock.began_s)
    counted = minutes[is_counted]
    flows = bottleneck_discharge(counted["count"], counted["upstream_speed_mps"], free_speed=posted)
    first_counted_s = float(counted["time_s"].min())
    in_zone = stations["station_m"].between(layout.start - TAPER_APPROACH_M, layout.end)
    after_warm_up = grid.time_edges[:-1] >= warm_up_s
    driven_km = trips["distance_m"].sum() / 1000
    waited = trips["departure_delay_s"]
    summary = TrafficSummary(
        n_vehicles=len(trips),
        n_arrived=int(trips["arrived"].sum()),
        n_waiting=int((~trips["entered"]).sum()),
        locked_s=lock.began_s,
        locked_station_m=lock.station_m,
        throughput_vph=float(counted["count"].mean() * HOUR_S / MINUTE_S),
        breakdown_s=first_counted_s + flows.breakdown_min * MINUTE_S,
        peak_flow_vph=flows.peak_flow_per_h,
        queue_discharge_vph=flows.queue_discharge_per_h,
        max_queue_length_m=float(queues.max(initial=0.0)),
        mean_queue_length_m=float(queues[after_warm_up].mean()) if after_warm_up.any() else float("nan"),
        mean_travel_time_s=float(vehicles["travel_time_s"].mean()),
        mean_delay_s=float(vehicles["delay_s"].mean()),
        p95_delay_s=float(vehicles["delay_s"].quantile(0.95)),
        mean_departure_delay_s=float(waited.mean()),
        speed_sd_taper_mps=float(stations.loc[in_zone, "speed_sd_mps"].max()),
        n_merges=int(vehicles["merge_position_m"].notna().sum()),
        n_hard_braking=int((vehicles["hard_brakes"] > 0).sum()),
        hard_brakes_per_1000_vkm=float(1000 * vehicles["hard_brakes"].sum() / driven_km),
        n_overlapping=int(vehicles["overlap"].sum()),
        n_ttc_conflicts=int((vehicles["min_ttc_s"] < TTC_CONFLICT_S).sum()),
        n_drac_conflicts=int((vehicles["max_drac_mps2"] > DRAC_CONFLICT_MPS2).sum()),
        n_pet_conflicts=int((vehicles["pet_s"] < PET_CONFLICT_S).sum()),
        co2_g_per_vkm=float(trips["co2_g"].sum() / driven_km),
        nox_g_per_vkm=float(trips["nox_g"].sum() / driven_km),
        fuel_g_per_vkm=float(trips["fuel_g"].sum() / driven_km),
    )
    return TrafficMeasures(summary=summary, vehicles=vehicles, minutes=minutes, stations=stations, grid=grid)


def bottleneck_station(layout: WorkZoneLayout) -> float:
    """Station [m] upstream of which a queue stands: the end of the last merging taper; without one the zone's start."""
    return max((area.end for area in layout.areas if area.name.startswith("merging taper")), default=layout.start)


def count_hard_brakes(vehicle: npt.ArrayLike, speed: npt.ArrayLike, *, dt: float) -> pd.Series:
    """Number of hard-braking events by vehicle: runs of fixes that are 2.67 m/s or more slower than a second before.

    Rows are sorted by vehicle and time, one every `dt` [s].
    """
    ids, v = np.asarray(vehicle), np.asarray(speed, dtype=float)
    lag = max(1, round(1 / dt))
    hard = np.zeros(len(v), dtype=bool)
    hard[lag:] = (ids[lag:] == ids[:-lag]) & (v[lag:] - v[:-lag] <= -HARD_BRAKE_MPS2 * lag * dt)
    begins = hard & np.concatenate([[True], ~hard[:-1] | (ids[1:] != ids[:-1])])
    return pd.Series(begins).groupby(ids).sum()


def _vehicles(table: pd.DataFrame, trips: pd.DataFrame, layout: WorkZoneLayout, *, dt: float) -> pd.DataFrame:
    """VEHICLE_COLUMNS of all vehicles of `trips`."""
    known = trips.set_index("vehicle_id")
    conflicts = fleet_conflicts(table, dt=dt, road=layout.road).set_index("vehicle_id")
    found = known.assign(
        entered_s=table.groupby("vehicle_id")["time_s"].min(),
        delay_s=known["time_loss_s"] + known["departure_delay_s"],
        merge_position_m=merge_positions(table, layout),
        hard_brakes=count_hard_brakes(table["vehicle_id"], table["speed_mps"], dt=dt),
    ).join(conflicts)
    found = found.fillna({"hard_brakes": 0, "min_ttc_s": np.inf, "max_drac_mps2": 0.0, "pet_s": np.inf})
    found["overlap"] = found["overlap"].eq(True)
    return found.reset_index()[list(VEHICLE_COLUMNS)].astype({"hard_brakes": int})


def _minutes(table: pd.DataFrame, grid: SpaceTime, queues: FloatArray, layout: WorkZoneLayout, *, n: int) -> pd.DataFrame:
    """MINUTE_COLUMNS of the first n whole minutes."""
    work = layout.area("activity area")
    passed = _crossing_times(table, (work.start + work.end) / 2)
    per_minute = round(MINUTE_S / CELL_S)
    far, near = (bottleneck_station(layout) - m for m in UPSTREAM_M)
    there = (grid.station_edges[:-1] >= far - 1e-6) & (grid.station_edges[1:] <= near + 1e-6)
    spent, distance = (
        a[: n * per_minute, there].sum(axis=1).reshape(n, per_minute).sum(axis=1) for a in (grid.time_spent, grid.distance)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        speed = np.where(spent > 0, distance / spent, np.nan)
    return pd.DataFrame(
        {
            "time_s": np.arange(n) * MINUTE_S,
            "count": np.histogram(passed, bins=np.arange(n + 1) * MINUTE_S)[0],
            "upstream_speed_mps": speed,
            "queue_length_m": queues[: n * per_minute].reshape(n, per_minute).max(axis=1, initial=0.0),
        }
    )


def _stations(table: pd.DataFrame, grid: SpaceTime, *, warm_up_s: float) -> pd.DataFrame:
    """STATION_COLUMNS after the warm-up; `table` holds no fixes from before it."""
    warm = grid.time_edges[:-1] >= warm_up_s
    spent, distance = (a[warm].sum(axis=0) for a in (grid.time_spent, grid.distance))
    area = warm.sum() * CELL_S * np.diff(grid.station_edges)
    bins, v = np.floor(table["s"].to_numpy() / CELL_M), table["speed_mps"]
    deviation = v.groupby(bins).std(ddof=0).reindex(np.arange(len(spent)))
    with np.errstate(invalid="ignore", divide="ignore"):
        return pd.DataFrame(
            {
                "station_m": grid.station_edges[:-1],
                "flow_vph": HOUR_S * distance / area,
                "density_vpkm": 1000 * spent / area,
                "speed_mps": np.where(spent > 0, distance / spent, np.nan),
                "speed_sd_mps": deviation.to_numpy(),
            }
        )


def _crossing_times(table: pd.DataFrame, station: float) -> FloatArray:
    """Time [s] of each vehicle's first fix beyond a station [m], of the vehicles that were seen before it."""
    beyond = table["s"].to_numpy() >= station
    ids = table["vehicle_id"].to_numpy()
    crossed = beyond[1:] & ~beyond[:-1] & (ids[1:] == ids[:-1])
    first = pd.Series(table["time_s"].to_numpy()[1:][crossed]).groupby(ids[1:][crossed]).min()
    return first.to_numpy()
