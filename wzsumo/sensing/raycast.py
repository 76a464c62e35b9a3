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

from wzsumo.frames import FloatArray
from wzsumo.sensing.ground import Ground
from wzsumo.sensing.scene import Scene

IntArray = npt.NDArray[np.int64]
MISS = -1  # no solid, no ground within range
FLATTEST = 1e-4  # rays that approach the plane by less than this slope meet it beyond any range
SURFACE_M = 5e-4  # a ray that is this near to the relief has met it
MAX_MARCH = 64
PAD_RAD = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Hits:
    """Distances [m] (columns, layers), inf for a miss, and what was hit: MISS, 0 for ground, else object ids of the scene."""

    distance: FloatArray
    object_id: npt.NDArray[np.int32]


def cast_rays(scene: Scene, *, poses: FloatArray, azimuth: FloatArray, elevation: FloatArray, max_range: float) -> Hits:
    """First hits of rays at every azimuth x elevation [rad] of the sensor's own frame, elevations ascending.

    `poses` (columns, 4, 4) take sensor to world, one for each azimuth; azimuths run counter-clockwise over one turn.
    """
    spheres = np.vstack([_spheres_of_frusta(scene.frusta), _spheres_of_boxes(scene.boxes)])
    first, last = _columns_touched(spheres, poses, azimuth)
    start, members = _sorted_into_columns(first, last, len(azimuth))
    surface, shape = _surface(scene.ground)
    distance = np.empty((len(azimuth), len(elevation)))
    object_id = np.empty((len(azimuth), len(elevation)), dtype=np.int32)
    sines = np.column_stack([np.cos(elevation), np.sin(elevation), elevation])
    _cast(
        np.ascontiguousarray(poses), np.column_stack([np.cos(azimuth), np.sin(azimuth)]), sines,
        scene.frusta, scene.boxes, spheres, start, members, surface, shape, max_range, distance, object_id,
    )  # fmt: skip
    return Hits(distance=distance, object_id=object_id)


def compile_kernels() -> None:
    """Compile, or load from the cache, every kernel of the ray cast."""
    frustum = np.array([[5.0, 0, 0, 0, 0, 1, 1, 0.2, 0.1]])
    box = np.array([[-5.0, 0, 1, 1, 1, 1, 1, 0]])
    plane = Ground(level=0.0, slope=(0.0, 0.0), relief=np.zeros((1, 1), np.float32), node=1.0, origin=(0.0, 0.0))
    scene = Scene(ground=plane, frusta=frustum, boxes=box, kinds=("cone", "box"), device_id=np.array([1]))
    pose = np.tile(np.eye(4), (4, 1, 1))
    pose[:, 2, 3] = 2.0
    cast_rays(scene, poses=pose, azimuth=np.arange(4) * np.pi / 2, elevation=np.array([-0.2, 0.0]), max_range=50.0)


def _spheres_of_frusta(frusta: FloatArray) -> FloatArray:
    """Bounding spheres (n, 4): about the middle of the axis, out to the wider rim."""
    half = frusta[:, 6] / 2
    centre = frusta[:, :3] + half[:, None] * frusta[:, 3:6]
    return np.column_stack([centre, np.hypot(half, np.maximum(frusta[:, 7], frusta[:, 8])) + 1e-6])


def _spheres_of_boxes(boxes: FloatArray) -> FloatArray:
    return np.column_stack([boxes[:, :3], np.linalg.norm(boxes[:, 3:6], axis=1) + 1e-6])


def _columns_touched(spheres: FloatArray, poses: FloatArray, azimuth: FloatArray) -> tuple[IntArray, IntArray]:
    """First and last column (n,) that a sphere can touch while the sensor moves; last may exceed the count: it wraps.

    The sphere's bearing is taken at the start, the middle and the end of the turn. The sensor moves almost straight in
    between, so that its bearing sweeps between these; the half width is that of the nearest approach.
    """
    count = len(azimuth)
    bearing, reach = [], []
    for pose in (poses[0], poses[count // 2], poses[-1]):
        local = (spheres[:, :3] - pose[:3, 3]) @ pose[:3, :3]
        bearing.append(np.arctan2(local[:, 1], local[:, 0]))
        reach.append(np.hypot(local[:, 0], local[:, 1]))
    travelled = float(np.linalg.norm(poses[-1, :3, 3] - poses[0, :3, 3]))
    nearest = np.min(reach, axis=0) - travelled / 4  # between two of the three the sensor is at most this much nearer
    around = nearest <= spheres[:, 3] * 1.01
    half = np.arcsin(np.clip(spheres[:, 3] / np.where(around, 1.0, nearest), 0, 1)) + PAD_RAD
    offset = [np.mod(b - bearing[0] + np.pi, 2 * np.pi) - np.pi for b in bearing]
    # A bearing sweeps by less than half a turn, but 1/4 of the way's chord may lie outside the three samples' hull.
    swing = np.max(np.abs(np.diff(offset, axis=0)), axis=0) / 4
    low, high = np.min(offset, axis=0) - swing - half, np.max(offset, axis=0) + swing + half
    step = 2 * np.pi / count
    start = np.mod(bearing[0] + low - azimuth[0], 2 * np.pi) / step
    first = np.floor(start).astype(np.int64)
    last = np.ceil(start + (high - low) / step).astype(np.int64)
    whole = around | (last - first >= count)
    return np.where(whole, 0, first), np.where(whole, count - 1, last)


def _sorted_into_columns(first: IntArray, last: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """(start (count + 1,), members): the solids of column j are members[start[j]:start[j + 1]]."""
    count_of = np.zeros(count + 1, dtype=np.int64)
    _count_columns(first, last, count_of)
    start = np.cumsum(count_of)
    members = np.empty(start[-1], dtype=np.int64)
    _fill_columns(first, last, start.copy(), members)
    return start, members


@njit(cache=True, error_model="numpy")
def _count_columns(first: IntArray, last: IntArray, count_of: IntArray) -> None:
    """Count the solids of column j in count_of[j + 1]."""
    for solid in range(len(first)):
        for column in range(first[solid], last[solid] + 1):
            count_of[column % (len(count_of) - 1) + 1] += 1


@njit(cache=True, error_model="numpy")
def _fill_columns(first: IntArray, last: IntArray, place: IntArray, members: IntArray) -> None:
    """Write each solid to the next free place of its columns."""
    for solid in range(len(first)):
        for column in range(first[solid], last[solid] + 1):
            j = column % (len(place) - 1)
            members[place[j]] = solid
            place[j] += 1


def _surface(ground: Ground) -> tuple[npt.NDArray[np.float32], FloatArray]:
    return ground.relief, np.array([ground.level, *ground.slope, *ground.origin, ground.node, *ground.extremes])


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
        _meet_ground(poses[j], azimuth[j], elevation, relief, surface, distance[j], object_id[j])
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
        dx, dy, dz = _direction(pose, azimuth, elevation[layer])
        if solid < len(frusta):
            t = _frustum_distance(pose, dx, dy, dz, frusta[solid])
        else:
            t = _box_distance(pose, dx, dy, dz, boxes[solid - len(frusta)])
        if t < distance[layer]:
            distance[layer] = t
            object_id[layer] = solid + 1


@njit(cache=True, error_model="numpy", inline="always")
def _direction(pose: FloatArray, azimuth: FloatArray, elevation: FloatArray) -> tuple[float, float, float]:
    x, y, z = elevation[0] * azimuth[0], elevation[0] * azimuth[1], elevation[1]
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
    )


@njit(cache=True, error_model="numpy")
def _frustum_distance(pose: FloatArray, dx: float, dy: float, dz: float, frustum: FloatArray) -> float:
    """Distance to the mantle or an end disk, inf for a miss.

    A point is on the mantle where its distance from the axis equals foot + k h, h its height along the axis: with
    h = ao + t ad that is a quadratic in t.
    """
    ox, oy, oz = pose[0, 3] - frustum[0], pose[1, 3] - frustum[1], pose[2, 3] - frustum[2]
    ax, ay, az, height, foot, top = frustum[3], frustum[4], frustum[5], frustum[6], frustum[7], frustum[8]
    ad, ao = ax * dx + ay * dy + az * dz, ax * ox + ay * oy + az * oz
    od, oo = ox * dx + oy * dy + oz * dz, ox * ox + oy * oy + oz * oz
    k = (top - foot) / height
    edge = foot + k * ao
    a = 1.0 - ad * ad * (1.0 + k * k)
    b = od - ao * ad - k * ad * edge
    c = oo - ao * ao - edge * edge
    nearest = np.inf
    root = b * b - a * c
    if root >= 0.0 and abs(a) > 1e-12:
        root = np.sqrt(root)
        for t in ((-b - root) / a, (-b + root) / a):
            if 0.0 < t < nearest and 0.0 <= ao + t * ad <= height:
                nearest = t
    if abs(ad) > 1e-12:
        for end in range(2):
            t, rim = ((height - ao) / ad, top) if end else (-ao / ad, foot)
            at = height if end else 0.0
            if 0.0 < t < nearest and oo + 2.0 * t * od + t * t - at * at <= rim * rim:
                nearest = t
    return nearest


@njit(cache=True, error_model="numpy")
def _box_distance(pose: FloatArray, dx: float, dy: float, dz: float, box: FloatArray) -> float:
    """Distance to an upright box (slabs), inf for a miss or a sensor inside it."""
    ox, oy, oz = pose[0, 3] - box[0], pose[1, 3] - box[1], pose[2, 3] - box[2]
    entry, leave = 0.0, np.inf
    for axis in range(3):
        if axis == 0:
            o, d = ox * box[6] + oy * box[7], dx * box[6] + dy * box[7]
        elif axis == 1:
            o, d = oy * box[6] - ox * box[7], dy * box[6] - dx * box[7]
        else:
            o, d = oz, dz
        half = box[3 + axis]
        if abs(d) < 1e-12:
            if abs(o) > half:
                return np.inf
            continue
        near, far = (-half - o) / d, (half - o) / d
        entry, leave = max(entry, min(near, far)), min(leave, max(near, far))
    return entry if 0.0 < entry <= leave else np.inf


@njit(cache=True, error_model="numpy")
def _meet_ground(
    pose: FloatArray, azimuth: FloatArray, elevation: FloatArray,
    relief: npt.NDArray[np.float32], surface: FloatArray, distance: FloatArray, object_id: npt.NDArray[np.int32],
) -> None:  # fmt: skip
    """Steps along each ray by most of its height above the relief below it; false position between above and below."""
    above_plane = pose[2, 3] - surface[0] - surface[1] * pose[0, 3] - surface[2] * pose[1, 3]
    for layer in range(len(elevation)):
        dx, dy, dz = _direction(pose, azimuth, elevation[layer])
        fall = surface[1] * dx + surface[2] * dy - dz
        if fall < FLATTEST:
            continue
        before = max((above_plane - surface[7]) / fall, 0.0)
        if before > distance[layer]:
            continue
        gap_before = (
            above_plane - fall * before - _relief_at(relief, surface, pose[0, 3] + before * dx, pose[1, 3] + before * dy)
        )
        t, gap = before, gap_before
        for _ in range(MAX_MARCH):
            if abs(gap) < SURFACE_M or before > distance[layer]:
                break
            if gap > 0:
                before, gap_before = t, gap
                t += max(0.7 * gap / fall, 0.05) if surface[7] > surface[6] else gap / fall
            else:
                share = gap_before / (gap_before - gap)
                middle = before + share * (t - before)
                level = above_plane - fall * middle
                between = level - _relief_at(relief, surface, pose[0, 3] + middle * dx, pose[1, 3] + middle * dy)
                if between > SURFACE_M:
                    before, gap_before = middle, between
                else:
                    t, gap = middle, between
                continue
            gap = above_plane - fall * t - _relief_at(relief, surface, pose[0, 3] + t * dx, pose[1, 3] + t * dy)
        if t < distance[layer]:
            distance[layer] = t
            object_id[layer] = 0


@njit(cache=True, error_model="numpy")
def _relief_at(relief: npt.NDArray[np.float32], surface: FloatArray, x: float, y: float) -> float:
    rows, cols = relief.shape
    u = min(max((x - surface[3]) / surface[5], 0.0), cols - 1.0)
    v = min(max((y - surface[4]) / surface[5], 0.0), rows - 1.0)
    col, row = min(int(u), max(cols - 2, 0)), min(int(v), max(rows - 2, 0))
    u, v = u - col, v - row
    next_col, next_row = min(col + 1, cols - 1), min(row + 1, rows - 1)
    lower = (1.0 - u) * relief[row, col] + u * relief[row, next_col]
    upper = (1.0 - u) * relief[next_row, col] + u * relief[next_row, next_col]
    return (1.0 - v) * lower + v * upper
