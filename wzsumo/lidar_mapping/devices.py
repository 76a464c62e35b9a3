"""Devices found among the cells that scans hit, and joined to the line that they form."""

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
    """Which clusters of hit cells count as a device, and which devices belong to one line."""

    height_m: tuple[float, float] = (0.35, 1.3)  # of the highest point hit; MUTCD 6K: 28 in cones to 42 in tubular markers
    extent_m: float = Field(default=1.2, gt=0)  # largest extent: a lying 36 in cone, widened by the poses' errors
    scans: int = Field(default=3, ge=1)  # that must have hit it; a moving vehicle does not stay in one cell. Chosen by us
    max_gap_m: float = Field(
        default=45.0, gt=0
    )  # between joined devices; MUTCD 6K: at most 2 ft per mph, 150 ft = 45.7 m at 75 mph
    barrier_half_width_m: float = Field(default=0.2, gt=0)  # a cone's radius, rounded up to a cell


def find_devices(votes: Votes, spec: DeviceSpec) -> FloatArray:
    """Centres (n, 2) [m] of the clusters of hit cells that have the size of a device and were hit in enough scans."""
    grid = votes.cells
    count = np.where(votes.p_standing(scans=1) > 0.5, votes.count, 0)  # without the ways of moving vehicles
    # Hit cells with one empty cell between them belong together: the few rays on a far cone may leave a cell empty.
    square = np.ones((3, 3), dtype=bool)
    label, n = ndimage.label(ndimage.binary_dilation(count > 0, square), square)
    label[count == 0] = 0
    if n == 0:
        return np.empty((0, 2))
    hit = count > 0
    top, scans = np.full(n + 1, -np.inf), np.zeros(n + 1)
    np.maximum.at(top, label[hit], votes.height[hit])
    np.maximum.at(scans, label[hit], votes.scans[hit])
    boxes = ndimage.find_objects(label)
    extent = np.array([max(s.stop - s.start for s in box) * grid.resolution if box else np.inf for box in boxes])
    low, high = spec.height_m
    kept = (top >= low) & (top <= high) & (scans >= spec.scans)
    numbers = 1 + np.flatnonzero(kept[1:] & (extent <= spec.extent_m))
    rows, cols = np.array(ndimage.center_of_mass(count, label, numbers)).reshape(-1, 2).T
    return grid.centre_of(rows, cols)


def join_devices(devices: FloatArray, *, max_gap_m: float) -> IntArray:
    """Pairs (m, 2) of indices of neighbouring devices of one line: the minimum spanning tree without its long edges.

    Of points along a line the minimum spanning tree is the line itself, whatever the spacing and the direction of travel.
    """
    if len(devices) < 2:
        return np.empty((0, 2), dtype=np.int64)
    distance = np.maximum(cdist(devices, devices), 1e-9)
    tree = minimum_spanning_tree(np.triu(distance, 1)).tocoo()
    near = tree.data <= max_gap_m
    return np.column_stack([tree.row[near], tree.col[near]]).astype(np.int64)


def with_barrier(grid: OccupancyGrid, devices: FloatArray, links: IntArray, *, half_width_m: float) -> OccupancyGrid:
    """The map with every device, and the straight between each two that are joined, occupied."""
    width = max(half_width_m, grid.resolution * 0.75)  # a thinner band would leave diagonal gaps between its cells
    shapes = [LineString(devices[list(pair)]).buffer(width) for pair in links]
    shapes += [LineString([point, point + 1e-6]).buffer(width) for point in devices]
    if not shapes:
        return grid
    return grid.with_p_occupied(np.where(cells_inside(grid, union_all(shapes)), 1.0, grid.p_occupied))
