"""The stale HD map: the lanes from before the zone was set up, without and with the devices marked on it."""

import numpy as np
import shapely

from wzsumo.grid import BoolArray, OccupancyGrid, cells_inside
from wzsumo.study.site import Site


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
