"""What the traces of the whole fleet look like to a traffic engineer."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import shapely

from wzsumo.frames import FloatArray
from wzsumo.work_zone import WorkZoneLayout


@dataclass(frozen=True, kw_only=True)
class FleetSummary:
    """Figures of the fleet's traces."""

    n_vehicles: int
    n_passed: int  # from before the zone to beyond it
    n_in_closed_area: int  # vehicles whose outline was in the closed area at any time
    lateral_sd_m: float  # between vehicles of one lane in the activity area, median absolute deviation x 1.4826
    mean_speed_activity_mps: float
    merge_position_m: dict[str, float]  # where closing-lane vehicles leave it, from the merging taper's start; quantiles


def passages(traces: pd.DataFrame, layout: WorkZoneLayout) -> pd.Index:
    """Ids of the vehicles that were seen from before the zone to beyond it; not of those that came the other way."""
    station, _ = layout.road.to_sd(traces[["x_m", "y_m"]])
    way = pd.Series(station).groupby(traces["vehicle_id"].to_numpy()).agg(["first", "last"])
    return way.index[(way["first"] < layout.start) & (way["last"] > layout.end)]


def summarise_fleet(traces: pd.DataFrame, layout: WorkZoneLayout) -> FleetSummary:
    """Summary of a trace table with headings, lengths and widths."""
    station, offset = layout.road.to_sd(traces[["x_m", "y_m"]])
    table = traces.assign(s=station, d=offset)
    activity = layout.area("activity area")
    there = table[(table["s"] >= activity.start) & (table["s"] <= activity.end)]
    passed = passages(traces, layout)
    merges = merge_positions(table[table["vehicle_id"].isin(passed)], layout)
    return FleetSummary(
        n_vehicles=int(traces["vehicle_id"].nunique()),
        n_passed=len(passed),
        n_in_closed_area=_n_in_closed_area(table[(table["s"] > layout.start - 20) & (table["s"] < layout.end + 20)], layout),
        lateral_sd_m=_lateral_sd(there, layout, station=(activity.start + activity.end) / 2),
        mean_speed_activity_mps=float(there["speed_mps"].mean()),
        merge_position_m={f"q{q}": float(merges.quantile(q / 100)) for q in (10, 50, 90)} if len(merges) else {},
    )


def merge_positions(table: pd.DataFrame, layout: WorkZoneLayout) -> pd.Series:
    """Where each vehicle was last in a closing lane [m from the start of the first merging taper], by its id.

    `table` has the traces with stations `s` and lateral offsets `d`; vehicles that never were in such a lane are left out.
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
    outlines = shapely.polygons(_outlines(near))
    closed = layout.closed_area.buffer(-1e-3)  # SUMO's coordinates are good to a millimetre
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


def _lateral_sd(there: pd.DataFrame, layout: WorkZoneLayout, *, station: float) -> float:
    mean = there.groupby("vehicle_id")["d"].mean().to_numpy()
    lanes = [lane for lane in layout.lanes if lane.start <= station <= lane.end]
    centres = np.array([float(lane.right(station) + lane.left(station)) / 2 for lane in lanes])
    if mean.size == 0:
        return float("nan")
    nearest = np.argmin(np.abs(mean[:, None] - centres), axis=1)
    medians = np.array([np.median(mean[nearest == k]) if (nearest == k).any() else 0.0 for k in range(len(centres))])
    return float(1.4826 * np.median(np.abs(mean - medians[nearest])))
