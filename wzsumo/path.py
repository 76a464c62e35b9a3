"""ReferencePath: the path that a planner returns and a controller follows."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import shapely

from wzsumo.errors import InputError
from wzsumo.frames import FloatArray, arc_length, wrap_angle
from wzsumo.vehicle import VehicleGeometry


@dataclass(frozen=True, kw_only=True, eq=False)
class ReferencePath:
    """Poses (n, 3) of the REAR AXLE (x [m], y [m], heading [rad]), forward along the path; n >= 2."""

    poses: FloatArray

    def __post_init__(self) -> None:
        if self.poses.ndim != 2 or self.poses.shape[1] != 3 or len(self.poses) < 2 or not np.isfinite(self.poses).all():
            raise InputError(f"a path of shape {self.poses.shape} must be (n >= 2, 3) finite poses x, y, heading")

    @property
    def arc_length(self) -> FloatArray:
        """Distances (n,) [m] along the path."""
        return arc_length(self.poses[:, :2])

    @property
    def curvature(self) -> FloatArray:
        """Curvature (n,) [1/m], change of heading over arc length, positive to the left."""
        turn = wrap_angle(np.diff(self.poses[:, 2])) / np.maximum(np.diff(self.arc_length), 1e-9)
        return np.concatenate([turn[:1], (turn[1:] + turn[:-1]) / 2, turn[-1:]])

    def to_csv(self, path: Path) -> None:
        """Write columns x_m, y_m, heading_rad, s_m, curvature_1pm (rear axle)."""
        table = np.column_stack([self.poses, self.arc_length, self.curvature])
        np.savetxt(path, table, fmt="%.6f", delimiter=",", header="x_m,y_m,heading_rad,s_m,curvature_1pm", comments="")


def swept_pieces(poses: npt.ArrayLike, vehicle: VehicleGeometry) -> npt.NDArray[np.object_]:
    """Convex hulls (n - 1,) of neighbouring outlines of `vehicle` at rear-axle poses (n, 3): together the area swept."""
    corners = vehicle.outline(poses)
    return np.asarray(shapely.convex_hull(shapely.linestrings(np.concatenate([corners[:-1], corners[1:]], axis=1))))
