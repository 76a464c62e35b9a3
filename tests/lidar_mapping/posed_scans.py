"""Posed scans of a flat road with cones, and the cells of a map of it."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid, blank_grid
from wzsumo.lidar_mapping.posed_scan import PosedScan, ScanState
from wzsumo.rigid import inverse, moved

CELLS = blank_grid((0.0, -10.0, 60.0, 10.0), resolution=0.2, p_occupied=0.0)  # half of a cone's base: every cone fills a cell
SENSOR = np.array([1.4, 0.0, 1.9])


def posed_scan(cloud: npt.ArrayLike, standing: npt.ArrayLike, *, pose: FloatArray | None = None) -> PosedScan:
    return PosedScan(
        time_s=0.0,
        pose=np.eye(4) if pose is None else pose,
        dead_reckoned=np.eye(4),
        state=ScanState.REGISTERED,
        free_directions=0,
        scale_m=0.02,
        deviation=np.zeros(6),
        has_gnss=False,
        cloud=np.asarray(cloud, dtype=float).reshape(-1, 3),
        standing=np.asarray(standing, dtype=bool),
        sensor=SENSOR,
    )


def cone_points(x: float, y: float, seed: int = 0) -> FloatArray:
    rng = np.random.default_rng(seed)
    height = rng.uniform(0.25, 0.85, 40)
    turn = rng.uniform(0, 2 * np.pi, 40)
    return np.column_stack([x + 0.12 * np.cos(turn), y + 0.12 * np.sin(turn), height])


def ground_points() -> FloatArray:
    x, y = np.meshgrid(np.arange(2.0, 58.0, 0.1), np.arange(-9.0, 9.0, 0.1))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def zone_scans(cones: Sequence[tuple[float, float]], *, pose: FloatArray | None = None) -> list[PosedScan]:
    """Four scans of a wide flat road with cones at (n, 2), all taken from one place."""
    ground = ground_points()
    solid = np.vstack([cone_points(x, y, seed=k) for k, (x, y) in enumerate(cones)])
    cloud = np.vstack([ground, solid])
    standing = np.repeat([False, True], [len(ground), len(solid)])
    if pose is not None:
        cloud = moved(cloud, inverse(pose))
    return [posed_scan(cloud, standing, pose=pose) for _ in range(4)]


def cell(grid: OccupancyGrid, x: float, y: float) -> float:
    (row,), (col,) = grid.cell_of([[x, y]])
    return float(grid.p_occupied[row, col])
