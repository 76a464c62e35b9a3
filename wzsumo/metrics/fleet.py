"""Figures of a fleet's drive through a zone: vehicles that passed, their speed, lateral spread and merge positions."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import shapely

from wzsumo.frames import FloatArray
from wzsumo.work_zone import WorkZoneLayout

BEYOND_ZONE_M = 20.0  # the outline of a vehicle whose centre is farther away does not reach into the zone
SD_OF_MAD = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
SUMO_ROUNDING_M = 1e-3  # SUMO's coordinates are exact to a millimetre


@dataclass(frozen=True, kw_only=True)
class FleetSummary:
    """Figures of the fleet's traces."""

    n_vehicles: int
    n_passed: int  # first seen before the zone and last seen beyond it
    n_in_closed_area: int  # vehicles whose outline was in the closed area at any time
    lateral_sd_m: float  # between the vehicles of one lane in the activity area, robust; NaN where no vehicle was there
    mean_speed_activity_mps: float  # over all fixes in the activity area
    merge_position_m: dict[str, float]  # quantiles q10, q50, q90 of `merge_positions`; empty where no vehicle merged


def passages(traces: pd.DataFrame, layout: WorkZoneLayout) -> pd.Index:
    """Ids of the vehicles that were first seen before the zone and last seen beyond it, along the stations."""
    station, _ = layout.road.to_sd(traces[["x_m", "y_m"]])
    seen = pd.Series(station).groupby(traces["vehicle_id"].to_numpy()).agg(["first", "last"])
    return seen.index[(seen["first"] < layout.start) & (seen["last"] > layout.end)]


def summarise_fleet(traces: pd.DataFrame, layout: WorkZoneLayout) -> FleetSummary:
    """Summary of a trace table with headings, lengths and widths."""
    station, offset = layout.road.to_sd(traces[["x_m", "y_m"]])
    table = traces.assign(s=station, d=offset)
    activity = layout.area("activity area")
    in_activity = table[(table["s"] >= activity.start) & (table["s"] <= activity.end)]
    near = table[(table["s"] > layout.start - BEYOND_ZONE_M) & (table["s"] < layout.end + BEYOND_ZONE_M)]
    passed = passages(traces, layout)
    merges = merge_positions(table[table["vehicle_id"].isin(passed)], layout)
    return FleetSummary(
        n_vehicles=int(traces["vehicle_id"].nunique()),
        n_passed=len(passed),
        n_in_closed_area=_n_in_closed_area(near, layout),
        lateral_sd_m=_lateral_sd(in_activity, layout, station=(activity.start + activity.end) / 2),
        mean_speed_activity_mps=float(in_activity["speed_mps"].mean()),
        merge_position_m={f"q{q}": float(merges.quantile(q / 100)) for q in (10, 50, 90)} if len(merges) else {},
    )


def merge_positions(table: pd.DataFrame, layout: WorkZoneLayout) -> pd.Series:
    """The last station of each vehicle in a closing lane [m from the start of the first merging taper], by its id.

    `table` has the traces with stations `s` and lateral offsets `d`. A vehicle that never was in a closing lane has no entry.
    """
    starts = [area.start for area in layout.areas if area.name.startswith("merging taper")]
    inside = np.zeros(len(table), dtype=bool)
    d, s = table["d"].to_numpy(), table["s"].to_numpy()
    for lane in layout.lanes:
        if lane.start == 0 and lane.end < layout.end:
            inside |= (d > lane.right(s)) & (d < lane.left(0.0)) & (s < lane.end)
    last = table.loc[inside].groupby("vehicle_id")["s"].max()
    return last - min(starts) if starts else last


def _n_in_closed_area(near: pd.DataFrame, layout: WorkZoneLayout) -> int:
    """Number of vehicles with an outline in the closed area."""
    outlines = shapely.polygons(_outlines(near))
    closed = layout.closed_area.buffer(-SUMO_ROUNDING_M)
    shapely.prepare(closed)
    hit = np.asarray(shapely.intersects(closed, outlines))
    return int(near[hit]["vehicle_id"].nunique())


def _outlines(table: pd.DataFrame) -> FloatArray:
    """Corners (n, 4, 2) of vehicles given by their centres."""
    along = np.column_stack([np.cos(table["heading_rad"]), np.sin(table["heading_rad"])]) * table[["length_m"]].to_numpy() / 2
    across = np.column_stack([-np.sin(table["heading_rad"]), np.cos(table["heading_rad"])]) * table[["width_m"]].to_numpy() / 2
    centre = table[["x_m", "y_m"]].to_numpy()
    return np.stack(
        [centre - along - across, centre + along - across, centre + along + across, centre - along + across], axis=1
    )


def _lateral_sd(in_activity: pd.DataFrame, layout: WorkZoneLayout, *, station: float) -> float:
    """Standard deviation [m] of the vehicles' mean offsets about the median of their lane, from the median deviation."""
    mean = in_activity.groupby("vehicle_id")["d"].mean().to_numpy()
    lanes = [lane for lane in layout.lanes if lane.start <= station <= lane.end]
    centres = np.array([float(lane.right(station) + lane.left(station)) / 2 for lane in lanes])
    if mean.size == 0:
        return float("nan")
    nearest = np.argmin(np.abs(mean[:, None] - centres), axis=1)
    medians = np.array([np.median(mean[nearest == k]) if (nearest == k).any() else 0.0 for k in range(len(centres))])
    return float(SD_OF_MAD * np.median(np.abs(mean - medians[nearest])))
