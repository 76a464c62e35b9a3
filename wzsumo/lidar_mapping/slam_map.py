"""Maps from posed scans, from weak to strong: raw bird's-eye view, log-odds with carved free space, joined barrier.

The raw view is the practice of Chen et al. 2022: what is not hit is free. The log-odds map knows free from unknown
(Hornung et al. 2013, OctoMap: updates, clamping, and the hit that wins over the passing ray). The barrier takes the
log-odds map, finds the devices in it and closes the gaps between neighbours of one line: what a work zone's cones mean.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit
from pydantic import Field
from scipy import ndimage
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial.distance import cdist
from shapely import LineString, union_all

from wzsumo.errors import InputError
from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid, blank_grid, cells_inside
from wzsumo.lidar_mapping import features, registration, smrf
from wzsumo.lidar_mapping.loam import PosedScan, ScanState
from wzsumo.spec import Spec

CountArray = npt.NDArray[np.int32]
SEEN_FREE, SEEN_HIT = 1, 2


class SlamMapSpec(Spec):
    """Cells, updates, and what counts as a device."""

    resolution_m: float = Field(default=0.2, gt=0)  # half of a cone's base: every cone fills a cell
    max_range_m: float = Field(default=60.0, gt=0)  # of returns that go into a map; a cone has six rays there
    min_points: int = Field(default=1, ge=1)  # in an occupied cell of the raw view; Chen et al. 2022 project every point
    hit_log_odds: float = Field(default=0.85, gt=0)  # Hornung et al. 2013, p = 0.7
    miss_log_odds: float = Field(default=-0.4, lt=0)  # ibid., p = 0.4
    log_odds_limits: tuple[float, float] = (-2.0, 3.5)  # ibid., p = 0.12 and 0.97
    carve_height_m: float = Field(default=0.4, gt=0)  # rays carve below it only: higher ones pass over a cone of 28 in
    device_height_m: tuple[float, float] = (0.35, 1.3)  # highest point; MUTCD 6K: 28 in cones to 42 in tubular markers
    device_extent_m: float = Field(default=1.2, gt=0)  # widest footprint: a lying 36 in cone, smeared by the poses' error
    device_scans: int = Field(default=3, ge=1)  # in which it must have been seen; what moves is not long in one cell
    max_gap_m: float = Field(default=45.0, gt=0)  # joined at most; MUTCD 6K: spacing up to 2 x 60..75 ft = 36.6..45.7 m
    barrier_half_width_m: float = Field(default=0.2, gt=0)  # a cone's radius, up to the cell


@dataclass(frozen=True, kw_only=True, eq=False)
class SlamMaps:
    """The three maps over the same cells, and what the strong one was made of."""

    birds_eye: OccupancyGrid  # 1 hit, 0 everything else: the paper's reading, by which unseen cells are free
    log_odds: OccupancyGrid  # 0.5 where nothing was seen
    barrier: OccupancyGrid
    devices: FloatArray  # (n, 2) centres of what was taken for a device
    links: npt.NDArray[np.int64]  # (m, 2) pairs of devices that were joined


def build_maps(posed_scans: Iterable[PosedScan], spec: SlamMapSpec, *, bounds: tuple[float, float, float, float]) -> SlamMaps:
    """All maps over `bounds` (x_min, y_min, x_max, y_max) [m] from one pass over the scans, which are not kept."""
    blank = blank_grid(bounds, resolution=spec.resolution_m, p_occupied=0.0)
    count, scans = np.zeros(blank.shape, np.int32), np.zeros(blank.shape, np.int32)
    height = np.full(blank.shape, -np.inf)
    odds = np.full(blank.shape, np.nan)
    frame = np.array([*blank.origin, spec.resolution_m])
    empty = True
    for posed in posed_scans:
        empty = False
        seen = np.zeros(blank.shape, np.int8)
        near = np.hypot(posed.cloud[:, 0] - posed.sensor[0], posed.cloud[:, 1] - posed.sensor[1]) < spec.max_range_m
        cloud, standing = np.ascontiguousarray(posed.cloud[near]), posed.standing[near]
        _carve(
            cloud,
            posed.sensor,
            np.ascontiguousarray(posed.pose),
            frame,
            spec.carve_height_m,
            seen,
        )
        _hit(cloud, standing, np.ascontiguousarray(posed.pose), frame, count, scans, height, seen)
        _vote(seen, odds, np.array([spec.miss_log_odds, spec.hit_log_odds, *spec.log_odds_limits]))
    if empty:
        raise InputError("no scans to map; a drive gives one scan a turn of its LiDAR")
    log_odds = blank.with_p_occupied(np.where(np.isnan(odds), 0.5, 1 / (1 + np.exp(-np.nan_to_num(odds)))))
    devices = find_devices(count, scans, height, blank, spec)
    links = join_devices(devices, max_gap_m=spec.max_gap_m)
    return SlamMaps(
        birds_eye=blank.with_p_occupied(count >= spec.min_points),
        log_odds=log_odds,
        barrier=with_barrier(log_odds, devices, links, half_width_m=spec.barrier_half_width_m),
        devices=devices,
        links=links,
    )


def find_devices(
    count: CountArray, scans: CountArray, height: FloatArray, grid: OccupancyGrid, spec: SlamMapSpec
) -> FloatArray:
    """Centres (n, 2) [m] of the clusters of hit cells that have a device's size; cells count their points, scans, top."""
    # Cells one apart belong together: a sparse cone may leave a cell between its hits empty.
    square = np.ones((3, 3), dtype=bool)
    label, n = ndimage.label(ndimage.binary_dilation(count > 0, square), square)
    label[count == 0] = 0
    if n == 0:
        return np.empty((0, 2))
    numbers = np.arange(1, n + 1)
    top, often = ndimage.maximum(height, label, numbers), ndimage.maximum(scans, label, numbers)
    boxes = ndimage.find_objects(label)
    extent = np.array([max(s.stop - s.start for s in box) * grid.resolution if box else np.inf for box in boxes])
    low, high = spec.device_height_m
    kept = (top >= low) & (top <= high) & (often >= spec.device_scans) & (extent <= spec.device_extent_m)
    rows, cols = np.array(ndimage.center_of_mass(count, label, numbers[kept])).reshape(-1, 2).T
    return grid.centre_of(rows, cols)


def join_devices(devices: FloatArray, *, max_gap_m: float) -> npt.NDArray[np.int64]:
    """Pairs (m, 2) of devices that are neighbours of one line: the minimum spanning tree without its long edges.

    On points along a line the tree is the line itself, whatever the spacing; no direction of travel is needed.
    """
    if len(devices) < 2:
        return np.empty((0, 2), dtype=np.int64)
    distance = np.maximum(cdist(devices, devices), 1e-9)
    tree = minimum_spanning_tree(np.triu(distance, 1)).tocoo()
    near = tree.data <= max_gap_m
    return np.column_stack([tree.row[near], tree.col[near]]).astype(np.int64)


def with_barrier(
    grid: OccupancyGrid, devices: FloatArray, links: npt.NDArray[np.int64], *, half_width_m: float
) -> OccupancyGrid:
    """The map with every device and the straight between joined ones occupied."""
    width = max(half_width_m, grid.resolution * 0.75)  # a thinner band would leave diagonal leaks between cells
    shapes = [LineString(devices[list(pair)]).buffer(width) for pair in links]
    shapes += [LineString([point, point + 1e-6]).buffer(width) for point in devices]
    if not shapes:
        return grid
    return grid.with_p_occupied(np.where(cells_inside(grid, union_all(shapes)), 1.0, grid.p_occupied))


def compile_kernels() -> None:
    """Compile, or load from the cache, every kernel of LiDAR mapping."""
    smrf.compile_kernels()
    registration.compile_kernels()
    features.compile_kernels()
    pose = np.eye(4)
    cloud, standing = np.array([[1.0, 0.0, 0.0], [1.5, 0.5, 0.5]]), np.array([False, True])
    posed = PosedScan(
        time_s=0.0, pose=pose, dead_reckoned=pose, state=ScanState.FIRST_SCAN, free_directions=0, scale_m=0.0,
        deviation=np.zeros(6), has_gnss=False, cloud=cloud, standing=standing, sensor=np.array([0.0, 0.0, 1.0]),
    )  # fmt: skip
    build_maps([posed], SlamMapSpec(), bounds=(0.0, 0.0, 2.0, 2.0))


@njit(cache=True, error_model="numpy")
def _carve(
    cloud: FloatArray, sensor: FloatArray, pose: FloatArray, frame: FloatArray, height: float, seen: npt.NDArray[np.int8]
) -> None:
    """Mark the cells under each ray, from where it is lower than `height` above the car's ground to before its return.

    The ray advances by half a cell; a corner that it cuts by less may be left out.
    """
    rows, cols = seen.shape
    sx = (pose[0, 0] * sensor[0] + pose[0, 1] * sensor[1] + pose[0, 2] * sensor[2] + pose[0, 3] - frame[0]) / frame[2]
    sy = (pose[1, 0] * sensor[0] + pose[1, 1] * sensor[1] + pose[1, 2] * sensor[2] + pose[1, 3] - frame[1]) / frame[2]
    for i in range(len(cloud)):
        x, y, z = cloud[i]
        if z >= height:
            continue
        ex = (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3] - frame[0]) / frame[2]
        ey = (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3] - frame[1]) / frame[2]
        share = 0.0 if sensor[2] <= height else (sensor[2] - height) / (sensor[2] - z)
        cells = np.hypot(ex - sx, ey - sy)
        steps = int((1.0 - share) * cells * 2.0) + 1
        for k in range(steps):
            t = share + (1.0 - share) * k / steps
            col, row = int(np.floor(sx + t * (ex - sx))), int(np.floor(sy + t * (ey - sy)))
            if 0 <= row < rows and 0 <= col < cols:
                seen[row, col] = SEEN_FREE


@njit(cache=True, error_model="numpy")
def _hit(
    cloud: FloatArray, standing: npt.NDArray[np.bool_], pose: FloatArray, frame: FloatArray,
    count: CountArray, scans: CountArray, height: FloatArray, seen: npt.NDArray[np.int8],
) -> None:  # fmt: skip
    """Ground returns mark their cell free, standing ones occupied, whatever was marked before."""
    rows, cols = seen.shape
    for wanted in (False, True):
        for i in range(len(cloud)):
            if standing[i] != wanted:
                continue
            x, y, z = cloud[i]
            col = int(np.floor((pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3] - frame[0]) / frame[2]))
            row = int(np.floor((pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3] - frame[1]) / frame[2]))
            if not (0 <= row < rows and 0 <= col < cols):
                continue
            if wanted:
                scans[row, col] += seen[row, col] != SEEN_HIT
                count[row, col] += 1
                height[row, col] = max(height[row, col], z)
            seen[row, col] = SEEN_HIT if wanted else SEEN_FREE


@njit(cache=True, error_model="numpy")
def _vote(seen: npt.NDArray[np.int8], odds: FloatArray, update: FloatArray) -> None:
    """Add a scan's votes to the log-odds (nan: never seen); `update` = miss, hit, least, most."""
    rows, cols = seen.shape
    for row in range(rows):
        for col in range(cols):
            if seen[row, col] == 0:
                continue
            before = 0.0 if np.isnan(odds[row, col]) else odds[row, col]
            after = before + (update[1] if seen[row, col] == SEEN_HIT else update[0])
            odds[row, col] = min(max(after, update[2]), update[3])
