"""Edge and planar points of a scan by the curvature of its scan lines (LOAM, Zhang & Singh 2014, Section V-A), and posts.

A cone or a pole has no edge that is fixed in the world: its outline and its visible face travel around it as the car passes.
Its axis is fixed. So where a scan line crosses something narrow that stands free on both sides, the feature is a post: the
middle of the crossing, moved away from the sensor by half the crossing's width.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit
from pydantic import Field

from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.lidar_mapping.scan_lines import EDGE, PLANAR, POST, classify_lines
from wzsumo.scan import LidarScan
from wzsumo.spec import Spec


class FeatureSpec(Spec):
    """How many features a scan line gives, and how sharp or smooth they are."""

    # Each scan line is cut into sectors, so that features surround the car; Zhang & Singh 2014: 4, their program: 6.
    sectors: int = Field(default=6, ge=1, le=64)
    edges_per_sector: int = Field(default=2, ge=0)  # at most; Zhang & Singh 2014. Posts are not counted
    planars_per_sector: int = Field(default=4, ge=0)  # at most; ibid.
    edge_curvature: float = Field(default=0.02, gt=0)  # of an edge at least; chosen by us
    planar_curvature: float = Field(default=0.002, gt=0)  # of a planar point at most; chosen by us
    min_range_m: float = Field(default=2.0, ge=0)  # nearer returns come from the car itself; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class Features:
    """Features of a scan by kind, each (n, 3) [m], in the frame of the deskewed cloud.

    `ground` and `walls` hold the flattest points of each sector; they are matched to the map. `smooth_ground` and
    `smooth_walls` hold all smooth points; they go into the map, where later scans find planes in them.
    """

    edge: FloatArray
    posts: FloatArray  # points on the posts' axes
    ground: FloatArray
    walls: FloatArray  # of standing points
    smooth_ground: FloatArray
    smooth_walls: FloatArray

    def __len__(self) -> int:
        return len(self.edge) + len(self.posts) + len(self.ground) + len(self.walls)


def extract_features(
    scan: LidarScan, cloud: FloatArray, standing: BoolArray, spec: FeatureSpec, *, motion: FloatArray
) -> Features:
    """Features of a scan whose deskewed points are `cloud` (n, 3); `standing` (n,) tells which of them are above the ground.

    `motion` (columns, 4, 4) is what deskewed them. Edges and posts are taken from standing points only: a rough verge is full
    of sharp points that the next scan does not see again.
    """
    kind, place = classify_points(scan, standing, spec)
    return Features(
        edge=cloud[kind == EDGE],
        posts=_deskewed(place[kind == POST], scan.column[kind == POST], motion),
        ground=cloud[(kind == PLANAR) & ~standing],
        walls=cloud[(kind == PLANAR) & standing],
        smooth_ground=cloud[(kind >= PLANAR) & ~standing],
        smooth_walls=cloud[(kind >= PLANAR) & standing],
    )


def classify_points(scan: LidarScan, standing: BoolArray, spec: FeatureSpec) -> tuple[IntArray, FloatArray]:
    """(kind (n,): NEITHER, EDGE, POST, PLANAR or SMOOTH; place (n, 3): the point itself, or that on the axis of a POST)."""
    kind, place = np.zeros(len(scan.points), dtype=np.int64), np.array(scan.points, dtype=np.float64)
    if len(kind) == 0:
        return kind, place
    image = np.full((int(scan.ring.max()) + 1, int(scan.column.max()) + 1), -1, dtype=np.int64)
    image[scan.ring, scan.column] = np.arange(len(kind))
    counts = np.array([spec.sectors, spec.edges_per_sector, spec.planars_per_sector])
    limits = np.array([spec.edge_curvature, spec.planar_curvature, spec.min_range_m])
    classify_lines(np.ascontiguousarray(scan.points), image, standing, counts, limits, kind, place)
    return kind, place


def deskew(scan: LidarScan, motion: FloatArray) -> FloatArray:
    """Points (n, 3) of a scan in one common frame: each is moved by the `motion` (columns, 4, 4) of its azimuth column."""
    return _deskewed(scan.points, scan.column, motion)


def _deskewed(points: FloatArray, column: npt.NDArray[np.int32], motion: FloatArray) -> FloatArray:
    moved = np.empty_like(points)
    _move(np.ascontiguousarray(points), column, np.ascontiguousarray(motion), moved)
    return moved


def compile_kernels() -> None:
    """Compile, or load from the cache, every kernel of the features."""
    column = np.arange(20, dtype=np.int32)
    points = np.column_stack([np.full(20, 5.0), np.linspace(-1, 1, 20), np.zeros(20)])
    scan = LidarScan(
        start_s=0.0, period_s=0.1, points=points, ring=np.zeros_like(column), column=column, time_s=column / 200.0,
        object_id=np.zeros_like(column),
    )  # fmt: skip
    classify_points(scan, np.ones(20, dtype=bool), FeatureSpec())
    deskew(scan, np.tile(np.eye(4), (20, 1, 1)))


@njit(cache=True, error_model="numpy", nogil=True)
def _move(points: FloatArray, column: npt.NDArray[np.int32], motion: FloatArray, moved: FloatArray) -> None:
    for i in range(len(points)):
        m = motion[column[i]]
        for a in range(3):
            moved[i, a] = m[a, 0] * points[i, 0] + m[a, 1] * points[i, 1] + m[a, 2] * points[i, 2] + m[a, 3]
