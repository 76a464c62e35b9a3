"""Exact first hits of the rays of a spinning LiDAR, in numba.

Every azimuth column has its own sensor pose. Solids are sorted into the columns that their bounding sphere can touch at
any time of the turn; inside a column each is tested against the layers between the sphere's lowest and highest elevation
only, so a ray meets a handful of solids of hundreds. The ground comes last and only as far as the nearest solid. One thread
is enough, and it lets go of Python's lock: the next scan is cast while this one is mapped.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from wzsumo.frames import FloatArray, IntArray
from wzsumo.sensing.ground import flat_ground
from wzsumo.sensing.ray_columns import columns_touched, sorted_into_columns
from wzsumo.sensing.ray_ground import meet_ground, surface_of
from wzsumo.sensing.ray_solids import box_distance, direction, frustum_distance, spheres_of_boxes, spheres_of_frusta
from wzsumo.sensing.scene import Scene

MISS = -1  # no solid, no ground within range


@dataclass(frozen=True, kw_only=True, eq=False)
class Hits:
    """Distances [m] (columns, layers), inf for a miss, and what was hit: MISS, 0 for ground, else object ids of the scene."""

    distance: FloatArray
    object_id: npt.NDArray[np.int32]


def cast_rays(scene: Scene, *, poses: FloatArray, azimuth: FloatArray, elevation: FloatArray, max_range: float) -> Hits:
    """First hits of rays at every azimuth x elevation [rad] of the sensor's own frame, elevations ascending.

    `poses` (columns, 4, 4) take sensor to world, one for each azimuth; azimuths run counter-clockwise over one turn.
    """
    spheres = np.vstack([spheres_of_frusta(scene.frusta), spheres_of_boxes(scene.boxes)])
    first, last = columns_touched(spheres, poses, azimuth)
    start, members = sorted_into_columns(first, last, len(azimuth))
    relief, surface = surface_of(scene.ground)
    distance = np.empty((len(azimuth), len(elevation)))
    object_id = np.empty((len(azimuth), len(elevation)), dtype=np.int32)
    sines = np.column_stack([np.cos(elevation), np.sin(elevation), elevation])
    _cast(
        np.ascontiguousarray(poses), np.column_stack([np.cos(azimuth), np.sin(azimuth)]), sines,
        scene.frusta, scene.boxes, spheres, start, members, relief, surface, max_range, distance, object_id,
    )  # fmt: skip
    return Hits(distance=distance, object_id=object_id)


def compile_kernels() -> None:
    """Compile, or load from the cache, every kernel of the ray cast."""
    frustum = np.array([[5.0, 0, 0, 0, 0, 1, 1, 0.2, 0.1]])
    box = np.array([[-5.0, 0, 1, 1, 1, 1, 1, 0]])
    scene = Scene(ground=flat_ground(), frusta=frustum, boxes=box, kinds=("cone", "box"), device_id=np.array([1]))
    pose = np.tile(np.eye(4), (4, 1, 1))
    pose[:, 2, 3] = 2.0
    cast_rays(scene, poses=pose, azimuth=np.arange(4) * np.pi / 2, elevation=np.array([-0.2, 0.0]), max_range=50.0)


@njit(cache=True, error_model="numpy", nogil=True)
def _cast(
    poses: FloatArray, azimuth: FloatArray, elevation: FloatArray,
    frusta: FloatArray, boxes: FloatArray, spheres: FloatArray, start: IntArray, members: IntArray,
    relief: npt.NDArray[np.float32], surface: FloatArray, max_range: float,
    distance: FloatArray, object_id: npt.NDArray[np.int32],
) -> None:  # fmt: skip
    """Fill `distance` and `object_id`. `azimuth` holds cos, sin; `elevation` cos, sin, angle."""
    for j in range(len(azimuth)):
        distance[j, :] = max_range
        object_id[j, :] = MISS
        for k in range(start[j], start[j + 1]):
            _meet_solid(poses[j], azimuth[j], elevation, frusta, boxes, spheres, members[k], distance[j], object_id[j])
        meet_ground(poses[j], azimuth[j], elevation, relief, surface, distance[j], object_id[j])
        for layer in range(len(elevation)):
            if object_id[j, layer] == MISS:
                distance[j, layer] = np.inf


@njit(cache=True, error_model="numpy")
def _meet_solid(
    pose: FloatArray, azimuth: FloatArray, elevation: FloatArray,
    frusta: FloatArray, boxes: FloatArray, spheres: FloatArray, solid: int,
    distance: FloatArray, object_id: npt.NDArray[np.int32],
) -> None:  # fmt: skip
    x, y, z = spheres[solid, 0] - pose[0, 3], spheres[solid, 1] - pose[1, 3], spheres[solid, 2] - pose[2, 3]
    forward = pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z
    left = pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z
    up = pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z
    radius, away = spheres[solid, 3], np.sqrt(x * x + y * y + z * z)
    ahead = forward * azimuth[0] + left * azimuth[1]
    if abs(left * azimuth[0] - forward * azimuth[1]) > radius or ahead < -radius:
        return
    lowest, highest = 0, len(elevation)
    # Where the sphere is cut by the column's plane its elevations lie within asin(radius / away) of its centre's.
    if away > 1.5 * radius:
        middle, half = np.arctan2(up, np.hypot(forward, left)), np.arcsin(radius / away) + 1e-6
        lowest = np.searchsorted(elevation[:, 2], middle - half)
        highest = np.searchsorted(elevation[:, 2], middle + half)
    for layer in range(lowest, highest):
        dx, dy, dz = direction(pose, azimuth, elevation[layer])
        if solid < len(frusta):
            t = frustum_distance(pose, dx, dy, dz, frusta[solid])
        else:
            t = box_distance(pose, dx, dy, dz, boxes[solid - len(frusta)])
        if t < distance[layer]:
            distance[layer] = t
            object_id[layer] = solid + 1
