"""The prevalent practice that the crowd's maps are held against: LiDAR SLAM in three forms, and the map of before in two."""

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import shapely

from wzsumo.case.lidar_baseline import LidarBaseline, map_by_lidar
from wzsumo.frames import BoolArray
from wzsumo.grid import OccupancyGrid, cells_inside
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.sections import SlamSpec
from wzsumo.scenario.site import Site


def stale_map(site: Site) -> OccupancyGrid:
    """The map of before: all lanes of the road free, whatever is closed now; shoulders are not for driving."""
    road = site.layout.road
    lanes = cells_inside(site.cells, road.strip(0.0, road.length, 0.0, road.travelled_width))
    return site.cells.with_p_occupied(np.where(lanes, 0.0, 1.0))


def stale_map_with_devices(site: Site) -> OccupancyGrid:
    """The map of before with every device of the zone occupied, as somebody who reports cones would mark them."""
    devices = site.layout.devices
    radius = devices["radius_m"].to_numpy(dtype=float) + site.cells.resolution / 2  # so that each fills the cell it stands in
    discs = shapely.buffer(shapely.points(devices[["x_m", "y_m"]].to_numpy(dtype=float)), radius)
    marked = cells_inside(site.cells, shapely.union_all(discs))
    return site.cells.with_p_occupied(np.where(marked, 1.0, stale_map(site).p_occupied))


def pavement_before(site: Site) -> BoolArray:
    """Cells (rows, cols) of the pavement from before the zone, shoulders and what is closed now included."""
    road = site.layout.road
    return cells_inside(site.cells, road.strip(0.0, road.length, -road.right_shoulder, road.left_edge))


SLAM_METHODS = {"slam_raw": "birds_eye", "slam_log_odds": "log_odds", "slam_barrier": "barrier"}
HD_MAP_METHODS = {"hd_map": stale_map, "hd_map_devices": stale_map_with_devices}
BASELINE_METHODS = (*SLAM_METHODS, *HD_MAP_METHODS)


@dataclass(frozen=True, kw_only=True, eq=False)
class Baselines:
    """Maps by method, and what is told of the mapping drive; empty where no such method was asked for."""

    maps: dict[str, OccupancyGrid]
    slam: dict[str, Any]


def map_baselines(
    methods: Iterable[str],
    fleet: pd.DataFrame,
    *,
    scenario: Scenario,
    site: Site,
    progress: Callable[[str, float], AbstractContextManager[Any]],
) -> Baselines:
    """The maps of those baseline methods that are among `methods`, all from one mapping drive.

    A SLAM map does not know where the pavement ends: beyond the edges that the map of before gives it is occupied, and
    outside the announced zone that map holds, as it does for the crowd's maps.
    """
    chosen = list(methods)
    maps = {name: make(site) for name, make in HD_MAP_METHODS.items() if name in chosen}
    if not set(SLAM_METHODS) & set(chosen):
        return Baselines(maps=maps, slam={})
    spec = scenario.slam or SlamSpec()
    with progress("LiDAR mapping drive", 1.0) as tell:
        lidar = map_by_lidar(fleet, spec, scenario=scenario, site=site, on_share=tell)
    pavement = pavement_before(site)
    for name, form in SLAM_METHODS.items():
        seen = getattr(lidar.maps, form)
        known = np.where(site.nominal, 0.0, np.where(pavement, seen.p_occupied, 1.0))
        maps[name] = seen.with_p_occupied(known)
    return Baselines(maps={name: maps[name] for name in BASELINE_METHODS if name in chosen}, slam=_drive_figures(lidar))


def _drive_figures(lidar: LidarBaseline) -> dict[str, Any]:
    return {
        "vehicle_id": lidar.vehicle_id,
        "n_scans": len(lidar.poses),
        "scan_states": lidar.states,
        "ate_m": lidar.ate_m,
        "dead_reckoning_ate_m": lidar.dead_reckoning_ate_m,
        "n_devices_mapped": len(lidar.maps.devices),
        "n_links": len(lidar.maps.links),
    }
