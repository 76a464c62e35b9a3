"""The road before a work zone, from a scenario file or from a file that describes the road alone."""

from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import Field

from wzsumo.crowd_mapping.closing.map_before import MapBefore
from wzsumo.errors import InputError, SpecError
from wzsumo.grid import OccupancyGrid, cells_inside
from wzsumo.road import RoadSpec
from wzsumo.scenario.scenario import load_scenario
from wzsumo.spec import Spec, parse_spec, read_toml
from wzsumo.units import METRES_PER_FOOT

MAX_FIX_DISTANCE_M = 5.0  # a fix farther from the pavement than a GNSS error is not on the road; chosen by us


class AnnouncedSection(Spec):
    """The section [announced]: where the work zone is said to be, in feet along the road from its beginning."""

    start_ft: float = Field(ge=0)  # first device
    end_ft: float = Field(gt=0)  # last device


class RoadBefore(Spec):
    """A file that describes the road before the zone, in the frame of the traces, and the announced zone."""

    road: RoadSpec
    announced: AnnouncedSection


def read_map_before(path: Path) -> MapBefore:
    """The road before the zone and the ends of the announced zone, from a scenario or a file with [road] and [announced].

    A scenario's closed lanes are not taken from it: the traces are to show what is closed.
    """
    content = read_toml(path)
    if "work_zone" in content:
        layout = load_scenario(path).layout()
        return MapBefore(road=layout.road, start=layout.start, end=layout.end)
    spec = parse_spec(RoadBefore, content, source=str(path))
    road = spec.road.build()
    start, end = (at * METRES_PER_FOOT for at in (spec.announced.start_ft, spec.announced.end_ft))
    if not start < end <= road.length:
        raise SpecError(
            f"{path}: announced.start_ft={spec.announced.start_ft:g} and announced.end_ft={spec.announced.end_ft:g} must be in "
            f"this order and on the road, which is {road.length / METRES_PER_FOOT:.0f} ft long"
        )
    return MapBefore(road=road, start=start, end=end)


def check_on_road(traces: pd.DataFrame, before: MapBefore, *, source: str, road_source: str) -> None:
    """Raise InputError where most fixes are off the road, as fixes of another frame are, or most vehicles drive against it."""
    road = before.road
    s, d = road.to_sd(traces[["x_m", "y_m"]].to_numpy())
    on_road = (
        (s > 0)
        & (s < road.length)
        & (d > -road.right_shoulder - MAX_FIX_DISTANCE_M)
        & (d < road.left_edge + MAX_FIX_DISTANCE_M)
    )
    if on_road.mean() < 0.5:
        raise InputError(
            f"{source}: {on_road.sum()} of {len(traces)} fixes lie on the road of {road_source}; traces must be in the road's "
            "frame (where it has no reference_points_m its right edge line begins at (0, 0) and runs along x)"
        )
    in_time = pd.DataFrame({"vehicle_id": traces["vehicle_id"], "s": s}).iloc[np.argsort(traces["time_s"], kind="stable")]
    station = in_time.groupby("vehicle_id")["s"]
    if (station.last() < station.first()).mean() > 0.5:
        raise InputError(
            f"{source}: most vehicles drive against the road of {road_source}; its points must run in their direction of travel"
        )


def with_road_outside(grid: OccupancyGrid, before: MapBefore) -> OccupancyGrid:
    """The map with the lanes outside the announced zone free, since the road there is as it was before."""
    road = before.road
    lanes = np.zeros(grid.shape, dtype=bool)
    for start, end in ((0.0, before.start), (before.end, road.length)):
        if start < end:
            lanes |= cells_inside(grid, road.strip(start, end, 0.0, road.own_width))
    return grid.with_p_occupied(np.where(lanes, 0.0, grid.p_occupied))
