"""Edge and planar points of a scan, by the curvature of its lines (Zhang & Singh 2014, Section V-A), and axes of posts.

A cone or a pole has no edge that is fixed in the world: its silhouette and its visible face travel around it as the car
passes, and would pull the car back by a millimetre a scan. Its AXIS is fixed. So where a line crosses something narrow
that stands free on both sides, the point of a post is the middle of the crossing, moved in by half its width.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from numba import njit
from pydantic import Field

from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.lidar_mapping.scan_lines import EDGE, PLANAR, POST, classify_lines
from wzsumo.scan import LidarScan
from wzsumo.spec import Spec


class FeatureSpec(Spec):
    """How many features, and how sharp or smooth they must be."""

    sectors: int = Field(
        default=6, ge=1, le=64
    )  # of a line, so that features surround the car; four in LOAM, six in its program
    edges_per_sector: int = Field(default=2, ge=0)  # corners; two in LOAM; posts are taken whole
    planars_per_sector: int = Field(default=4, ge=0)  # ibid.
    edge_curvature: float = Field(default=0.02, gt=0)  # at least; of the mean offset of neighbours over range, see `curvature`
    planar_curvature: float = Field(default=0.002, gt=0)  # at most
    min_range_m: float = Field(default=2.0, ge=0)  # nearer returns are the car's own


@dataclass(frozen=True, kw_only=True, eq=False)
class Features:
    """Points by kind, in the frame the cloud was given in. Ground and walls hold the flattest points of each sector.

    `smooth_ground` and `smooth_walls` are all smooth points, what later scans find planes in.
    """

    edge: FloatArray  # (n, 3)
    posts: FloatArray  # (n, 3): where their axes are
    ground: FloatArray
    walls: FloatArray
    smooth_ground: FloatArray
    smooth_walls: FloatArray

    def __len__(self) -> int:
        return len(self.edge) + len(self.posts) + len(self.ground) + len(self.walls)


def extract_features(
    scan: LidarScan, cloud: FloatArray, standing: BoolArray, spec: FeatureSpec, *, motion: FloatArray
) -> Features:
    """Features of a scan; `cloud` (n, 3) are its points freed of the car's motion, `standing` (n,) those above the ground.

    `motion` (columns, 4, 4) is what freed them (`take_out_motion`). Edges and posts are taken from standing points alone: a
    rough verge is full of sharp points that are gone in the next scan.
    """
    kind, place = classify_points(scan, standing, spec)
    post = kind == POST
    kept = {name: getattr(scan, name)[post] for name in ("ring", "column", "time_s", "object_id")}
    axes = replace(scan, points=place[post], **kept)
    return Features(
        edge=cloud[kind == EDGE],
        posts=take_out_motion(axes, motion),
        ground=cloud[(kind == PLANAR) & ~standing],
        walls=cloud[(kind == PLANAR) & standing],
        smooth_ground=cloud[(kind >= PLANAR) & ~standing],
        smooth_walls=cloud[(kind >= PLANAR) & standing],
    )


def classify_points(scan: LidarScan, standing: BoolArray, spec: FeatureSpec) -> tuple[IntArray, FloatArray]:
    """(NEITHER, EDGE, POST, PLANAR or SMOOTH (n,), the points (n, 3) themselves or, of a post's, the place of its axis)."""
    kind, place = np.zeros(len(scan.points), dtype=np.int64), np.array(scan.points, dtype=np.float64)
    if len(kind) == 0:
        return kind, place
    image = np.full((int(scan.ring.max()) + 1, int(scan.column.max()) + 1), -1, dtype=np.int64)
    image[scan.ring, scan.column] = np.arange(len(kind))
    numbers = np.array([spec.sectors, spec.edges_per_sector, spec.planars_per_sector])
    limits = np.array([spec.edge_curvature, spec.planar_curvature, spec.min_range_m])
    classify_lines(np.ascontiguousarray(scan.points), image, standing, numbers, limits, kind, place)
    return kind, place


def take_out_motion(scan: LidarScan, motion: FloatArray) -> FloatArray:
    """Points (n, 3) of a scan moved by `motion` (columns, 4, 4), one for each azimuth column: into one common frame."""
    moved = np.empty_like(scan.points)
    _move(np.ascontiguousarray(scan.points), scan.column, np.ascontiguousarray(motion), moved)
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
    take_out_motion(scan, np.tile(np.eye(4), (20, 1, 1)))


@njit(cache=True, error_model="numpy", nogil=True)
def _move(points: FloatArray, column: npt.NDArray[np.int32], motion: FloatArray, moved: FloatArray) -> None:
    for i in range(len(points)):
        m = motion[column[i]]
        for a in range(3):
            moved[i, a] = m[a, 0] * points[i, 0] + m[a, 1] * points[i, 1] + m[a, 2] * points[i, 2] + m[a, 3]
