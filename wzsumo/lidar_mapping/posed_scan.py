"""PosedScan: a scan with the pose that odometry found for it; the error of a trajectory of poses."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.rigid import inverse


class ScanState(StrEnum):
    """What the pose of a scan was estimated from."""

    FIRST_SCAN = "first_scan"  # the given start
    REGISTERED = "registered"  # the scan and the prior, in all six directions
    DEGENERATE = "degenerate"  # the prior alone in some directions, the scan too in the others
    TOO_FEW_FEATURES = "too_few_features"  # the prior alone: too little to match, as in an empty scan
    IDENTICAL_SCAN = "identical_scan"  # the prior alone: the same points as in the last scan, a frozen sensor
    CONTRADICTS_PRIOR = "contradicts_prior"  # the prior alone: the scan fits at an implausible pose


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedScan:
    """A scan and its pose. `pose` and `dead_reckoned` (4, 4) take the car's frame to the world; the cloud is in the former.

    The car's frame is that at the scan's start, with its origin at the rear axle on the ground. `deviation` (6,) holds standard
    deviations of translation [m] and rotation vector [rad] along the car's axes.
    """

    time_s: float
    pose: FloatArray
    dead_reckoned: FloatArray
    state: ScanState
    free_directions: int  # number of directions that the prior alone decided
    scale_m: float  # residual scale of the registration; 0 where there was no registration
    deviation: FloatArray
    has_gnss: bool
    cloud: FloatArray  # (n, 3) [m], deskewed
    standing: BoolArray  # (n,): points above the ground
    sensor: FloatArray  # (3,): the LiDAR's place in the car's frame


def without_clouds(posed: PosedScan) -> PosedScan:
    """The same pose without the points, for the log of a long drive."""
    return replace(
        posed, cloud=np.empty((0, 3)), standing=np.empty(0, dtype=bool)
    )  # a slice would keep the whole cloud in memory


def trajectory_error_m(estimated: FloatArray, truth: FloatArray) -> FloatArray:
    """Position errors (n,) [m] of poses (n, 4, 4) against the truth, the first pose aligned."""
    aligned = truth[0] @ inverse(estimated[0]) @ estimated
    return np.asarray(np.linalg.norm(aligned[:, :3, 3] - truth[:, :3, 3], axis=1))
