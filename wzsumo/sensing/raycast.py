"""Ray casting: the first hit of every ray of a spinning LiDAR, exact for solids.

Every azimuth column has its own sensor pose. Solids are sorted into the columns that their bounding spheres can touch during
the turn. Within a column a solid is tested only against the layers between its sphere's lowest and highest elevation, so a ray
is tested against a few solids out of hundreds. The ground is tested last, up to the nearest solid. The kernel releases Python's
lock, so that a second thread can map a scan while the next one is cast.
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

NO_RETURN = -1  # in place of an object id, where a ray meets neither a solid nor the ground within range


@dataclass(frozen=True, kw_only=True, eq=False)
class Hits:
    """Distances [m] (columns, layers), inf for no hit, and what was hit: NO_RETURN, GROUND or an object id of the scene."""

    distance: FloatArray
    object_id: npt.NDArray[np.int32]


def cast_rays(scene: Scene, *, poses: FloatArray, azimuth: FloatArray, elevation: FloatArray, max_range: float) -> Hits:
    """First hits of the rays at every azimuth (columns,) and elevation (layers,) [rad] of the sensor's own frame.

    Azimuths run counter-clockwise over one turn, elevations ascend. `poses` (columns, 4, 4) take points from the sensor's frame
    to the world, one pose for each azimuth.
    """
    spheres = np.vstack([spheres_of_frusta(scene.frusta), spheres_of_boxes(scene.boxes)])
    first, last = columns_touched(spheres, poses, azimuth)
    start, members = sorted_into_columns(first, last, len(azimuth))
    relief, surface = surface_of(scene.ground)
    distance = np.empty((len(azimuth), len(elevation)))
    object_id = np.empty((len(azimuth), len(elevation)), dtype=np.int32)
    elevations = np.column_stack([np.cos(elevation), np.sin(elevation), elevation])
    _cast(
        np.ascontiguousarray(poses), np.column_stack([np.cos(azimuth), np.sin(azimuth)]), elevations,
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
        object_id[j, :] = NO_RETURN
        for k in range(start[j], start[j + 1]):
            _meet_solid(poses[j], azimuth[j], elevation, frusta, boxes, spheres, members[k], distance[j], object_id[j])
        meet_ground(poses[j], azimuth[j], elevation, relief, surface, distance[j], object_id[j])
        for layer in range(len(elevation)):
            if object_id[j, layer] == NO_RETURN:
                distance[j, layer] = np.inf


@njit(cache=True, error_model="numpy")
def _meet_solid(
    pose: FloatArray, azimuth: FloatArray, elevation: FloatArray,
    frusta: FloatArray, boxes: FloatArray, spheres: FloatArray, solid: int,
    distance: FloatArray, object_id: npt.NDArray[np.int32],
) -> None:  # fmt: skip
    """Lower `distance` (layers,) and set `object_id` (layers,) where the rays of one column hit one solid first."""
    x, y, z = spheres[solid, 0] - pose[0, 3], spheres[solid, 1] - pose[1, 3], spheres[solid, 2] - pose[2, 3]
    forward = pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z
    left = pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z
    up = pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z
    radius, range_ = spheres[solid, 3], np.sqrt(x * x + y * y + z * z)
    ahead = forward * azimuth[0] + left * azimuth[1]
    if abs(left * azimuth[0] - forward * azimuth[1]) > radius or ahead < -radius:
        return
    lowest, highest = 0, len(elevation)
    # Seen from outside, a sphere's elevations lie within asin(radius / range) of its centre's. Close by, all layers are tested.
    if range_ > 1.5 * radius:
        middle, half = np.arctan2(up, np.hypot(forward, left)), np.arcsin(radius / range_) + 1e-6
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
