"""The ground that a LiDAR sees: a tilted plane plus a relief that holds unevenness, verge and superelevation.

On a perfectly smooth plane the rings of a LiDAR look the same from every place, and a registration of whole clouds would lock
on them. The unevenness is fixed in the world, so two scans of one place see the same bumps.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from pydantic import Field
from scipy.ndimage import gaussian_filter, map_coordinates

from wzsumo.frames import FloatArray
from wzsumo.road import Road
from wzsumo.spec import Spec

COARSE_NODE_M = 4.0  # spacing of the nodes at which s and d of the road are computed; both are smooth in between. Chosen by us


class GroundSpec(Spec):
    """Slopes and unevenness of road and verge."""

    grade_pct: float = Field(default=1.0, ge=-12, le=12)  # rise along the road; AASHTO Green Book: freeways up to 3..6 %
    cross_slope_pct: float = Field(default=2.0, ge=-8, le=8)  # fall towards the right; AASHTO Green Book: 1.5..2 %
    road_roughness_m: float = Field(default=0.003, ge=0)  # rms; a profile of IRI 1.5 m/km deviates by 2..4 mm, Sayers 1998
    road_bump_length_m: float = Field(default=0.5, gt=0)  # correlation length; the shorter wavelengths of ISO 8608
    verge_roughness_m: float = Field(default=0.05, ge=0)  # rms of mown grass and soil; chosen by us
    verge_bump_length_m: float = Field(default=0.3, gt=0)  # correlation length, of the size of tufts; chosen by us
    verge_width_m: float = Field(default=30.0, ge=0)  # of modelled ground beside the pavement; chosen by us
    node_m: float = Field(default=0.25, gt=0)  # spacing of the relief's nodes; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """The surface z = level + slope_x x + slope_y y + relief(x, y) [m] in the world frame.

    `relief` (rows, cols) [m] holds nodes `node` metres apart, row = y up, node [0, 0] at `origin` = (x, y). It is bilinear
    between the nodes and constant beyond the outermost ones.
    """

    level: float
    slope: tuple[float, float]
    relief: npt.NDArray[np.float32]
    node: float
    origin: tuple[float, float]

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """Lowest and highest value of the relief [m]."""
        return float(self.relief.min()), float(self.relief.max())

    def height(self, xy: npt.ArrayLike) -> FloatArray:
        """Heights (n,) [m] at world points (n, 2)."""
        points = np.asarray(xy, dtype=float).reshape(-1, 2)
        at = (points - self.origin).T[::-1] / self.node
        relief = map_coordinates(self.relief, at, order=1, mode="nearest", output=np.float64)
        return np.asarray(self.level + points @ np.array(self.slope) + relief)

    def tilt(self, heading: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """(roll, pitch) [rad], as in `rigid.rotation_from_rpy`, of a vehicle that stands on the plane at a heading [rad]."""
        psi = np.asarray(heading, dtype=float)
        along = self.slope[0] * np.cos(psi) + self.slope[1] * np.sin(psi)
        across = -self.slope[0] * np.sin(psi) + self.slope[1] * np.cos(psi)
        pitch = -np.arctan(along)
        return np.arctan(across * np.cos(pitch)), pitch


def flat_ground(*, level: float = 0.0, slope: tuple[float, float] = (0.0, 0.0)) -> Ground:
    """A plane without relief."""
    return Ground(level=level, slope=slope, relief=np.zeros((1, 1), dtype=np.float32), node=1.0, origin=(0.0, 0.0))


def ground_of(road: Road, spec: GroundSpec, *, seed: int) -> Ground:
    """The ground of a road and its verges: the plane that fits the road's start, and a relief that holds the rest.

    On a curved road the relief also holds the difference between the plane and the superelevated surface.
    """
    grade, cross = spec.grade_pct / 100, spec.cross_slope_pct / 100
    heading = float(road.heading_at(0.0))
    along, across = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    slope = grade * along + cross * across
    (first_s,), (first_d,) = road.to_sd(road.reference_line[:1])
    level = float(grade * first_s + cross * first_d - slope @ road.reference_line[0])
    margin = spec.verge_width_m + max(road.left_edge, road.right_shoulder)
    low = road.reference_line.min(axis=0) - margin
    cols, rows = (int(np.ceil(n)) for n in (road.reference_line.max(axis=0) + margin - low) / spec.node_m)
    s, d = _road_coordinates(road, low, rows=rows, cols=cols, node=spec.node_m)
    x, y = low[0] + np.arange(cols) * spec.node_m, low[1] + np.arange(rows) * spec.node_m
    plane = level + slope[0] * x[None, :] + slope[1] * y[:, None]
    # Share of the verge's roughness: 0 on the pavement, 1 from a metre beside it.
    verge = np.clip(np.maximum(d - road.left_edge, -road.right_shoulder - d), 0.0, 1.0)
    rng = np.random.default_rng([seed, 1])
    bumps = _noise(rng, (rows, cols), spec.road_bump_length_m / spec.node_m) * spec.road_roughness_m * (1 - verge)
    bumps += _noise(rng, (rows, cols), spec.verge_bump_length_m / spec.node_m) * spec.verge_roughness_m * verge
    relief = (grade * s + cross * d - plane + bumps).astype(np.float32)
    return Ground(
        level=level, slope=(float(slope[0]), float(slope[1])), relief=relief, node=spec.node_m, origin=(low[0], low[1])
    )


def _road_coordinates(
    road: Road, low: FloatArray, *, rows: int, cols: int, node: float
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Station s and offset d (rows, cols) [m] of the relief's nodes, bilinear between coarser nodes."""
    coarse_x = np.arange(low[0], low[0] + cols * node + COARSE_NODE_M, COARSE_NODE_M)
    coarse_y = np.arange(low[1], low[1] + rows * node + COARSE_NODE_M, COARSE_NODE_M)
    s, d = road.to_sd(np.stack(np.meshgrid(coarse_x, coarse_y), axis=-1).reshape(-1, 2))
    at = np.stack(np.meshgrid(np.arange(rows), np.arange(cols), indexing="ij")) * (node / COARSE_NODE_M)
    shape = (len(coarse_y), len(coarse_x))
    fine = [map_coordinates(field.reshape(shape), at, order=1, output=np.float32, mode="nearest") for field in (s, d)]
    return fine[0], fine[1]


def _noise(rng: np.random.Generator, shape: tuple[int, int], length: float) -> npt.NDArray[np.float32]:
    """Gaussian noise (rows, cols) of unit variance; `length` is its correlation length in nodes."""
    noise = gaussian_filter(rng.standard_normal(shape, dtype=np.float32), sigma=length / 2, mode="wrap")
    return np.asarray(noise / max(float(noise.std()), 1e-9), dtype=np.float32)
