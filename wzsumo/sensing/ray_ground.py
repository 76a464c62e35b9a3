"""Where rays meet the ground and its relief."""

import numpy as np
import numpy.typing as npt
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.scan import GROUND
from wzsumo.sensing.ground import Ground
from wzsumo.sensing.ray_solids import direction

MIN_APPROACH = 1e-4  # metres by which a ray must approach the plane per metre; flatter rays meet it beyond any range
HIT_TOLERANCE_M = 5e-4  # a point of a ray that is this near to the relief is on it; a fortieth of the range noise
STEP_SHARE = 0.7  # of the step that would reach the ground if it were flat; longer steps skip crests. Chosen by us
MIN_STEP_M = 0.05  # a step at least; a fifth of the relief's node spacing. Chosen by us
MAX_STEPS = 64  # for one ray


def surface_of(ground: Ground) -> tuple[npt.NDArray[np.float32], FloatArray]:
    """The ground for kernels: the relief; level, two slopes, origin x and y, node, lowest and highest relief."""
    return ground.relief, np.array([ground.level, *ground.slope, *ground.origin, ground.node, *ground.extremes])


@njit(cache=True, error_model="numpy")
def meet_ground(
    pose: FloatArray, azimuth: FloatArray, elevation: FloatArray,
    relief: npt.NDArray[np.float32], surface: FloatArray, distance: FloatArray, object_id: npt.NDArray[np.int32],
) -> None:  # fmt: skip
    """Lower `distance` (layers,) and set `object_id` (layers,) where a ray meets the ground before what it has met so far.

    A ray is followed from the height of the highest relief. Each step is most of the way that the gap to the relief below would
    take on flat ground. Once a step ends below the relief, the crossing is found by false position.
    """
    above_plane = pose[2, 3] - surface[0] - surface[1] * pose[0, 3] - surface[2] * pose[1, 3]
    for layer in range(len(elevation)):
        dx, dy, dz = direction(pose, azimuth, elevation[layer])
        fall = surface[1] * dx + surface[2] * dy - dz
        if fall < MIN_APPROACH:
            continue
        before = max((above_plane - surface[7]) / fall, 0.0)
        if before > distance[layer]:
            continue
        gap_before = (
            above_plane - fall * before - _relief_at(relief, surface, pose[0, 3] + before * dx, pose[1, 3] + before * dy)
        )
        t, gap = before, gap_before
        for _ in range(MAX_STEPS):
            if abs(gap) < HIT_TOLERANCE_M or before > distance[layer]:
                break
            if gap > 0:
                before, gap_before = t, gap
                t += max(STEP_SHARE * gap / fall, MIN_STEP_M) if surface[7] > surface[6] else gap / fall
            else:
                share = gap_before / (gap_before - gap)
                middle = before + share * (t - before)
                level = above_plane - fall * middle
                between = level - _relief_at(relief, surface, pose[0, 3] + middle * dx, pose[1, 3] + middle * dy)
                if between > HIT_TOLERANCE_M:
                    before, gap_before = middle, between
                else:
                    t, gap = middle, between
                continue
            gap = above_plane - fall * t - _relief_at(relief, surface, pose[0, 3] + t * dx, pose[1, 3] + t * dy)
        if t < distance[layer]:
            distance[layer] = t
            object_id[layer] = GROUND


@njit(cache=True, error_model="numpy")
def _relief_at(relief: npt.NDArray[np.float32], surface: FloatArray, x: float, y: float) -> float:
    """The relief [m] at (x, y), as in `Ground.height`."""
    rows, cols = relief.shape
    u = min(max((x - surface[3]) / surface[5], 0.0), cols - 1.0)
    v = min(max((y - surface[4]) / surface[5], 0.0), rows - 1.0)
    col, row = min(int(u), max(cols - 2, 0)), min(int(v), max(rows - 2, 0))
    u, v = u - col, v - row
    next_col, next_row = min(col + 1, cols - 1), min(row + 1, rows - 1)
    lower = (1.0 - u) * relief[row, col] + u * relief[row, next_col]
    upper = (1.0 - u) * relief[next_row, col] + u * relief[next_row, next_col]
    return (1.0 - v) * lower + v * upper
