"""Devices found in what scans have hit, and joined into the line that they form: what a work zone's cones mean."""

import numpy as np
from pydantic import Field
from scipy import ndimage
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial.distance import cdist
from shapely import LineString, union_all

from wzsumo.frames import FloatArray, IntArray
from wzsumo.grid import OccupancyGrid, cells_inside
from wzsumo.lidar_mapping.votes import Votes
from wzsumo.spec import Spec


class DeviceSpec(Spec):
    """What counts as a device, and which of them belong to one line."""

    height_m: tuple[float, float] = (0.35, 1.3)  # highest point; MUTCD 6K: 28 in cones to 42 in tubular markers
    extent_m: float = Field(default=1.2, gt=0)  # widest footprint: a lying 36 in cone, smeared by the poses' error
    scans: int = Field(default=3, ge=1)  # in which it must have been seen; what moves is not long in one cell
    max_gap_m: float = Field(default=45.0, gt=0)  # joined at most; MUTCD 6K: spacing up to 2 x 60..75 ft = 36.6..45.7 m
    barrier_half_width_m: float = Field(default=0.2, gt=0)  # a cone's radius, up to the cell


def find_devices(votes: Votes, spec: DeviceSpec) -> FloatArray:
    """Centres (n, 2) [m] of the clusters of hit cells that have a device's size."""
    count, grid = votes.count, votes.cells
    # Cells one apart belong together: a sparse cone may leave a cell between its hits empty.
    square = np.ones((3, 3), dtype=bool)
    label, n = ndimage.label(ndimage.binary_dilation(count > 0, square), square)
    label[count == 0] = 0
    if n == 0:
        return np.empty((0, 2))
    hit = count > 0
    top, often = np.full(n + 1, -np.inf), np.zeros(n + 1)
    np.maximum.at(top, label[hit], votes.height[hit])
    np.maximum.at(often, label[hit], votes.scans[hit])
    boxes = ndimage.find_objects(label)
    extent = np.array([max(s.stop - s.start for s in box) * grid.resolution if box else np.inf for box in boxes])
    low, high = spec.height_m
    kept = (top >= low) & (top <= high) & (often >= spec.scans)
    numbers = 1 + np.flatnonzero(kept[1:] & (extent <= spec.extent_m))
    rows, cols = np.array(ndimage.center_of_mass(count, label, numbers)).reshape(-1, 2).T
    return grid.centre_of(rows, cols)


def join_devices(devices: FloatArray, *, max_gap_m: float) -> IntArray:
    """Pairs (m, 2) of devices that are neighbours of one line: the minimum spanning tree without its long edges.

    On points along a line the tree is the line itself, whatever the spacing; no direction of travel is needed.
    """
    if len(devices) < 2:
        return np.empty((0, 2), dtype=np.int64)
    distance = np.maximum(cdist(devices, devices), 1e-9)
    tree = minimum_spanning_tree(np.triu(distance, 1)).tocoo()
    near = tree.data <= max_gap_m
    return np.column_stack([tree.row[near], tree.col[near]]).astype(np.int64)


def with_barrier(grid: OccupancyGrid, devices: FloatArray, links: IntArray, *, half_width_m: float) -> OccupancyGrid:
    """The map with every device and the straight between joined ones occupied."""
    width = max(half_width_m, grid.resolution * 0.75)  # a thinner band would leave diagonal leaks between cells
    shapes = [LineString(devices[list(pair)]).buffer(width) for pair in links]
    shapes += [LineString([point, point + 1e-6]).buffer(width) for point in devices]
    if not shapes:
        return grid
    return grid.with_p_occupied(np.where(cells_inside(grid, union_all(shapes)), 1.0, grid.p_occupied))
