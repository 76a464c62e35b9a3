"""Rotations and rigid motions in space. Right-handed frames: x forward, y left, z up. A 4 x 4 matrix takes points from
one frame to another. Rotation vectors point along the axis, their length is the angle [rad].
"""

import numpy as np
import numpy.typing as npt

from wzsumo.frames import FloatArray


def rotation_from_rpy(rpy: npt.ArrayLike) -> FloatArray:
    """Rotations (..., 3, 3) of roll, pitch, yaw (..., 3) [rad]: about x, then the fixed y, then the fixed z.

    Positive pitch lowers the nose (right-handed about y, which points left).
    """
    roll, pitch, yaw = np.moveaxis(np.asarray(rpy, dtype=float), -1, 0)
    (cr, cp, cy), (sr, sp, sy) = (f([roll, pitch, yaw]) for f in (np.cos, np.sin))
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rpy_from_rotation(rotation: npt.ArrayLike) -> FloatArray:
    """Roll, pitch, yaw (..., 3) [rad] of rotations (..., 3, 3), pitch within a quarter turn."""
    R = np.asarray(rotation, dtype=float)
    pitch = np.arcsin(np.clip(-R[..., 2, 0], -1, 1))
    return np.stack([np.arctan2(R[..., 2, 1], R[..., 2, 2]), pitch, np.arctan2(R[..., 1, 0], R[..., 0, 0])], axis=-1)


def rotation_from_vector(vector: npt.ArrayLike) -> FloatArray:
    """Rotations (..., 3, 3) of rotation vectors (..., 3) (Rodrigues)."""
    v = np.asarray(vector, dtype=float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    K = cross_matrix(v)
    # sin(a)/a and (1 - cos a)/a^2 = (sinc(a/2))^2 / 2, both finite at 0.
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * (K @ K))


def vector_from_rotation(rotation: npt.ArrayLike) -> FloatArray:
    """Rotation vectors (..., 3) [rad] of rotations (..., 3, 3) by less than half a turn."""
    R = np.asarray(rotation, dtype=float)
    twice_sine_axis = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1)
    sine = np.linalg.norm(twice_sine_axis, axis=-1, keepdims=True) / 2
    cosine = (np.trace(R, axis1=-2, axis2=-1)[..., None] - 1) / 2
    angle = np.arctan2(sine, cosine)
    return np.asarray(twice_sine_axis / 2 / np.sinc(angle / np.pi))


def cross_matrix(vector: npt.ArrayLike) -> FloatArray:
    """Matrices (..., 3, 3) that multiply as the cross product with vectors (..., 3) does."""
    x, y, z = np.moveaxis(np.asarray(vector, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    return np.stack([np.stack(row, axis=-1) for row in ([zero, -z, y], [z, zero, -x], [-y, x, zero])], axis=-2)


def rigid(rotation: npt.ArrayLike, translation: npt.ArrayLike) -> FloatArray:
    """Motions (..., 4, 4) of rotations (..., 3, 3) and translations (..., 3) [m]."""
    R, t = np.asarray(rotation, dtype=float), np.asarray(translation, dtype=float)
    shape = np.broadcast_shapes(R.shape[:-2], t.shape[:-1])
    motion = np.zeros((*shape, 4, 4))
    motion[..., :3, :3], motion[..., :3, 3], motion[..., 3, 3] = R, t, 1.0
    return motion


def inverse(motion: FloatArray) -> FloatArray:
    """Inverse motions (..., 4, 4)."""
    back = np.swapaxes(motion[..., :3, :3], -1, -2)
    return rigid(back, -(back @ motion[..., :3, 3:])[..., 0])


def moved(points: npt.ArrayLike, motion: FloatArray) -> FloatArray:
    """Points (n, 3) taken through one motion (4, 4)."""
    return np.asarray(np.asarray(points, dtype=float) @ motion[:3, :3].T + motion[:3, 3])
