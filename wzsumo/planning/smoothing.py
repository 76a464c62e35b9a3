"""A path without jumps of curvature: of ever smoother and ever more yielding lines the strongest that keeps off obstacles."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.path import ReferencePath
from wzsumo.planning.easing import EASING_LADDER_M, eased_points
from wzsumo.planning.footprint import Body, sweep_margin
from wzsumo.planning.path_check import cost_along, poses_through, touching_poses
from wzsumo.planning.pushing import smooth
from wzsumo.planning.terrain import Terrain

# Wavelength [m] and share of the preferred clearance that is asked for, tried in turn. On a work zone of 900 m with corridors
# of 3.6 m, straight, turned and bent, the first gave clearances of 0.51 to 0.65 m (analysis/benchmarks/planning.py).
_STRONG_LADDER = ((90.0, 0.7), (60.0, 0.7), (40.0, 0.7))
_WEAK_LADDER = ((60.0, 0.35), (40.0, 0.35), (25.0, 0.35), (15.0, 0.2), (8.0, 0.1), (4.0, 0.01))
# The first strong one that costs little more than the searched path is taken, else the cheapest of them: one that cuts
# through what that went round comes nearer to obstacles, and costs more.
_DEARER, _DEAREST = 1.05, 1.2  # times the cost of the searched path: little more, and the most for any
# Where a strong one fails less is asked for, by a factor, wavelengths to either side, so often. Factors of 0.5 and 0.7 gave
# away more than it took: of 100 plans (seeds 102, 103) 5 and 2 came nearer than 0.5 m to a device, with 0.8 one, without 6.
_RELIEF, _RELIEF_REACH, _N_RELIEFS = 0.8, 0.25, 8
_FEWEST_POINTS = 9


class _Try(NamedTuple):
    strong: bool
    poses: FloatArray  # (n, 3)
    jump: float  # largest between two poses [1/m]
    failing: BoolArray  # (n,) where a pose bends too sharply or touches a blocked cell


def smoothed_poses(
    poses: FloatArray,
    *,
    terrain: Terrain,
    body: Body,
    preferred_clearance_m: float,
    max_curvature: float,
    max_curvature_jump: float,
) -> FloatArray:
    """Poses (n, 3) under the strongest smoothing that keeps off blocked cells and within the limits [1/m].

    `poses` (n, 3) are free and evenly spaced. Clearance and p(occupied) may cost little more than before.
    Where no smoothing keeps the jumps of curvature within their limit, the one with the least jumps; where none is free and
    within `max_curvature`, the poses as they were given.
    """
    if len(poses) < _FEWEST_POINTS:
        return poses
    searched = cost_along(poses, terrain)
    best, least = poses, (math.inf, math.inf)
    for one in _tries(poses, preferred_clearance_m, max_curvature, terrain, body):
        if not one.strong and least[0] <= max_curvature_jump:
            break
        cost = cost_along(one.poses, terrain)
        rank = (max(one.jump, max_curvature_jump), cost)  # all jumps within the limit are alike
        if one.failing.any() or cost > _DEAREST * searched or rank >= least:
            continue
        best, least = one.poses, rank
        if one.jump <= max_curvature_jump and cost <= _DEARER * searched:
            break
    return best


def _tries(
    poses: FloatArray, preferred_clearance_m: float, max_curvature: float, terrain: Terrain, body: Body
) -> Iterator[_Try]:
    """Smoother and smoother compliance: off the obstacles first, then within the room that the poses have.

    A strong one that fails somewhere is tried again with less clearance asked for there, as strong everywhere else.
    """
    ends, step = poses[[0, -1], 2], float(np.hypot(*(poses[1, :2] - poses[0, :2])))

    def pushed(wavelength_m: float, clearances_m: FloatArray, *, strong: bool) -> _Try:
        points = smooth(
            poses[:, :2], headings=ends, wavelength_m=wavelength_m, clearances_m=clearances_m, terrain=terrain, body=body
        )
        return looked_at(points, strong=strong)

    def looked_at(points: FloatArray, *, strong: bool) -> _Try:
        candidate = poses_through(points, ends=ends)
        curvature = ReferencePath(poses=candidate).curvature
        touching = touching_poses(candidate, sweep_margin(body, step_m=step), terrain, body)
        return _Try(strong, candidate, float(np.abs(np.diff(curvature)).max()), touching | (np.abs(curvature) > max_curvature))

    for wavelength_m, share in _STRONG_LADDER:
        clearances_m = np.full(len(poses), share * preferred_clearance_m)
        for _ in range(_N_RELIEFS):
            yield (one := pushed(wavelength_m, clearances_m, strong=True))
            if not one.failing.any():
                break
            clearances_m = np.where(_near(one.failing, round(_RELIEF_REACH * wavelength_m / step)), _RELIEF, 1.0) * clearances_m
    for wavelength_m, share in _WEAK_LADDER:
        yield pushed(wavelength_m, np.full(len(poses), share * preferred_clearance_m), strong=False)
    for wavelength_m in EASING_LADDER_M:
        yield looked_at(eased_points(poses, wavelength_m=wavelength_m, terrain=terrain, body=body), strong=False)


def _near(marked: BoolArray, reach: int) -> BoolArray:
    """Which places (n,) are at most `reach` from a marked one."""
    return np.asarray(np.convolve(marked, np.ones(2 * reach + 1))[reach : reach + len(marked)] > 0)
