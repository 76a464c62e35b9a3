"""VehicleGeometry: the outline and the axles of one vehicle."""

from typing import Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from wzsumo.frames import FloatArray
from wzsumo.spec import Spec


class VehicleGeometry(Spec):
    """Outline, axles and steering of one vehicle. Reference point: centre of the REAR AXLE. Lengths in metres.

    Chen et al. 2022 use the LENGTH of their car, L = 4.6391 m, as its wheelbase in the pure-pursuit law. Here `wheelbase_m` is
    the wheelbase; the controller that follows the paper uses the paper's number.
    """

    length_m: float = Field(4.64, gt=0, le=30)  # 4.6391 m in Chen et al. 2022, rounded up
    width_m: float = Field(1.86, gt=0, le=30)  # 1.85 m between the outlines of the paper's Figure 11, rounded up
    wheelbase_m: float = Field(2.85, gt=0, le=30)  # mid-size sedan
    rear_overhang_m: float = Field(0.92, ge=0, le=30)  # length - wheelbase - front overhang (0.87 m)
    max_steering_deg: float = Field(35.0, gt=0, lt=90)  # of the front wheels; a turning circle of some 11 m

    @model_validator(mode="after")
    def _axles_inside_the_outline(self) -> Self:
        if self.rear_overhang_m + self.wheelbase_m > self.length_m:
            raise ValueError(
                f"rear_overhang_m={self.rear_overhang_m} + wheelbase_m={self.wheelbase_m} must fit in length_m={self.length_m}"
            )
        return self

    @property
    def axle_to_bumper_m(self) -> float:
        """Distance [m] from the rear axle to the front bumper."""
        return self.length_m - self.rear_overhang_m

    @property
    def axle_to_centre_m(self) -> float:
        """Distance [m] from the rear axle to the centre of the outline."""
        return self.length_m / 2 - self.rear_overhang_m

    @property
    def min_turning_radius_m(self) -> float:
        """Radius [m] that the rear axle turns at full steering, kinematic bicycle."""
        return self.wheelbase_m / float(np.tan(np.deg2rad(self.max_steering_deg)))

    def outline(self, poses: npt.ArrayLike) -> FloatArray:
        """Corners (..., 4, 2) in the world, counter-clockwise from rear right, of the vehicle with its rear axle at `poses`."""
        rear, front, half = -self.rear_overhang_m, self.axle_to_bumper_m, self.width_m / 2
        x, y = np.array([(rear, -half), (front, -half), (front, half), (rear, half)]).T
        pose = np.asarray(poses, dtype=float)[..., None]
        cos, sin = np.cos(pose[..., 2, :]), np.sin(pose[..., 2, :])
        return np.stack([pose[..., 0, :] + x * cos - y * sin, pose[..., 1, :] + x * sin + y * cos], axis=-1)
