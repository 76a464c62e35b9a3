"""Where a ray hits a frustum or a box, in closed form, and the bounding spheres of both."""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray


def spheres_of_frusta(frusta: FloatArray) -> FloatArray:
    """Bounding spheres (n, 4), x, y, z, radius [m]: about the middle of the axis, out to the wider rim."""
    half = frusta[:, 6] / 2
    centre = frusta[:, :3] + half[:, None] * frusta[:, 3:6]
    return np.column_stack([centre, np.hypot(half, np.maximum(frusta[:, 7], frusta[:, 8])) + 1e-6])


def spheres_of_boxes(boxes: FloatArray) -> FloatArray:
    """Bounding spheres (n, 4), x, y, z, radius [m]: about the centre, out to the corners."""
    return np.column_stack([boxes[:, :3], np.linalg.norm(boxes[:, 3:6], axis=1) + 1e-6])


@njit(cache=True, error_model="numpy", inline="always")
def direction(pose: FloatArray, azimuth: FloatArray, elevation: FloatArray) -> tuple[float, float, float]:
    """Unit vector of a ray in the world frame; `azimuth` and `elevation` hold cos and sin of the sensor's angles."""
    x, y, z = elevation[0] * azimuth[0], elevation[0] * azimuth[1], elevation[1]
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
    )


@njit(cache=True, error_model="numpy")
def frustum_distance(pose: FloatArray, dx: float, dy: float, dz: float, frustum: FloatArray) -> float:
    """Distance [m] to the mantle or an end disk of a frustum, inf for a miss.

    The mantle's points have the distance foot + k h from the axis at height h along it. With h = ao + t ad this is a quadratic
    equation in the distance t along the ray.
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
def box_distance(pose: FloatArray, dx: float, dy: float, dz: float, box: FloatArray) -> float:
    """Distance [m] to an upright box (slab method), inf for a miss or a sensor inside the box."""
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
