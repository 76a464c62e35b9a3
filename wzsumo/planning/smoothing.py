"""A path without jumps of curvature: of several smoothings, strong ones first, the strongest that keeps off obstacles."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.path import ReferencePath
from wzsumo.planning.easing import EASING_WAVELENGTHS_M, eased_points
from wzsumo.planning.footprint import Body, sweep_margin
from wzsumo.planning.path_check import cost_along, poses_through, touching_poses
from wzsumo.planning.pushing import smooth
from wzsumo.planning.terrain import Terrain

# Wavelengths [m] and shares of the preferred clearance that are asked for, tried in turn; set on the maps of
# analysis/benchmarks/planning.py, where the first gives clearances of 0.51 to 0.65 m in corridors of 3.6 m.
_STRONG_SMOOTHINGS = ((90.0, 0.7), (60.0, 0.7), (40.0, 0.7))
_WEAK_SMOOTHINGS = ((60.0, 0.35), (40.0, 0.35), (25.0, 0.35), (15.0, 0.2), (8.0, 0.1), (4.0, 0.01))
# Costs in terms of that of the searched path. The first strong smoothing that costs little more is taken, else the cheapest one
# that does not cost too much: a path that cuts through what the search went round comes nearer to obstacles and costs more.
_LITTLE_MORE_COST, _MAX_COST = 1.05, 1.2  # chosen by us
# Where a strong smoothing fails, less clearance is asked for: by this factor, this share of a wavelength to either side of the
# place, at most so often. Chosen by us; analysis/drives/library_drives.py measures clearances.
_RELIEF_FACTOR, _RELIEF_REACH_WAVELENGTHS, _MAX_RELIEFS = 0.8, 0.25, 8
_MIN_POINTS = 9  # a shorter path is not smoothed; chosen by us


class _Candidate(NamedTuple):
    strong: bool  # whether it comes of a strong smoothing
    poses: FloatArray  # (n, 3)
    curvature_jump: float  # largest between two poses [1/m]
    failing: BoolArray  # (n,) poses that bend too sharply or touch a blocked cell


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

    `poses` (n, 3) are free and evenly spaced. The smoothed path may cost at most 1.2 times as much.
    Where no smoothing keeps the jumps of curvature within their limit, it is the one with the least jumps; where none is free
    and within `max_curvature`, the poses come back as they are.
    """
    best, _ = best_smoothing(
        poses,
        terrain=terrain,
        body=body,
        preferred_clearance_m=preferred_clearance_m,
        max_curvature=max_curvature,
        max_curvature_jump=max_curvature_jump,
    )
    return poses if best is None else best


def best_smoothing(
    poses: FloatArray,
    *,
    terrain: Terrain,
    body: Body,
    preferred_clearance_m: float,
    max_curvature: float,
    max_curvature_jump: float,
) -> tuple[FloatArray | None, float]:
    """The smoothing of `smoothed_poses` and its largest jump of curvature [1/m]; (None, inf) where none is free."""
    if len(poses) < _MIN_POINTS:
        return None, math.inf
    searched = cost_along(poses, terrain)
    best: FloatArray | None = None
    least = (math.inf, math.inf)
    for candidate in _candidates(poses, preferred_clearance_m, max_curvature, terrain, body):
        if not candidate.strong and least[0] <= max_curvature_jump:
            break
        cost = cost_along(candidate.poses, terrain)
        rank = (max(candidate.curvature_jump, max_curvature_jump), cost)  # jumps within the limit do not count
        if candidate.failing.any() or cost > _MAX_COST * searched or rank >= least:
            continue
        best, least = candidate.poses, rank
        if candidate.curvature_jump <= max_curvature_jump and cost <= _LITTLE_MORE_COST * searched:
            break
    return best, least[0]


def _candidates(
    poses: FloatArray, preferred_clearance_m: float, max_curvature: float, terrain: Terrain, body: Body
) -> Iterator[_Candidate]:
    """Smoothed paths in the order in which they are tried: pushed off the obstacles, then eased within the room of the poses.

    A strong one that fails somewhere is tried again with less clearance asked for there and the same everywhere else.
    """
    ends, step = poses[[0, -1], 2], float(np.hypot(*(poses[1, :2] - poses[0, :2])))

    def pushed(wavelength_m: float, clearances_m: FloatArray, *, strong: bool) -> _Candidate:
        points = smooth(
            poses[:, :2], headings=ends, wavelength_m=wavelength_m, clearances_m=clearances_m, terrain=terrain, body=body
        )
        return checked(points, strong=strong)

    def checked(points: FloatArray, *, strong: bool) -> _Candidate:
        smoothed = poses_through(points, ends=ends)
        curvature = ReferencePath(poses=smoothed).curvature
        touching = touching_poses(smoothed, sweep_margin(body, step_m=step), terrain, body)
        jump = float(np.abs(np.diff(curvature)).max())
        return _Candidate(strong, smoothed, jump, touching | (np.abs(curvature) > max_curvature))

    for wavelength_m, share in _STRONG_SMOOTHINGS:
        clearances_m = np.full(len(poses), share * preferred_clearance_m)
        for _ in range(_MAX_RELIEFS):
            yield (candidate := pushed(wavelength_m, clearances_m, strong=True))
            if not candidate.failing.any():
                break
            relieved = _near(candidate.failing, round(_RELIEF_REACH_WAVELENGTHS * wavelength_m / step))
            clearances_m = np.where(relieved, _RELIEF_FACTOR, 1.0) * clearances_m
    for wavelength_m, share in _WEAK_SMOOTHINGS:
        yield pushed(wavelength_m, np.full(len(poses), share * preferred_clearance_m), strong=False)
    for wavelength_m in EASING_WAVELENGTHS_M:
        yield checked(eased_points(poses, wavelength_m=wavelength_m, terrain=terrain, body=body), strong=False)


def _near(marked: BoolArray, reach: int) -> BoolArray:
    """Which places (n,) are at most `reach` places from a marked one."""
    return np.asarray(np.convolve(marked, np.ones(2 * reach + 1))[reach : reach + len(marked)] > 0)
