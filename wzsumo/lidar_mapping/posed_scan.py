"""A scan in its place: what odometry says of it, and how far a whole way of them is from the truth."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.rigid import inverse


class ScanState(StrEnum):
    """What the pose of a scan rests on."""

    FIRST_SCAN = "first_scan"  # the start, as given
    REGISTERED = "registered"  # the scan in all six directions, and the prior
    DEGENERATE = "degenerate"  # in some directions the prior alone
    TOO_FEW_FEATURES = "too_few_features"  # the prior alone: an empty scan, no device in range
    IDENTICAL_SCAN = "identical_scan"  # the prior alone: the same points as before, a frozen sensor
    CONTRADICTS_PRIOR = "contradicts_prior"  # the prior alone: the scan fits elsewhere, most likely on moving vehicles


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedScan:
    """A scan in its place. `pose` (4, 4) and `dead_reckoned` take the car's frame to the world; clouds are in the car's frame.

    The car's frame: rear axle on the ground, at the scan's start. `deviation` (6,): standard deviations of translation
    and rotation vector along the car's axes [m, rad].
    """

    time_s: float
    pose: FloatArray
    dead_reckoned: FloatArray
    state: ScanState
    free_directions: int
    scale_m: float  # residual scale of the registration; 0 where there was none
    deviation: FloatArray
    has_gnss: bool
    cloud: FloatArray  # (n, 3), freed of the car's motion
    standing: BoolArray  # (n,): above the ground
    sensor: FloatArray  # (3,): where the LiDAR sat in the car's frame


def without_clouds(posed: PosedScan) -> PosedScan:
    """The same pose without its points, for logs of long drives."""
    return replace(posed, cloud=np.empty((0, 3)), standing=np.empty(0, dtype=bool))  # a slice would keep the whole cloud alive


def trajectory_error_m(estimated: FloatArray, truth: FloatArray) -> FloatArray:
    """Position errors (n,) [m] of poses (n, 4, 4) against the truth, the first pose aligned."""
    aligned = truth[0] @ inverse(estimated[0]) @ estimated
    return np.asarray(np.linalg.norm(aligned[:, :3, 3] - truth[:, :3, 3], axis=1))
