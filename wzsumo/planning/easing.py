"""A path eased within the room beside it: for places so narrow that pushing the path off the obstacles does not settle.

Each pose may move to either side as far as the body stays free. Among all lines within these limits the eased line bends least
and stays near the poses: a quadratic program with bounds for each point, solved by the alternating direction method of
multipliers on the banded system of `bending`. Headings change too, so the caller checks the result for contact again.
Sources: Boyd et al., Distributed Optimization and Statistical Learning via ADMM, 2011; Zhang et al., Optimal Vehicle Path
Planning Using Quadratic Optimization for Baidu Apollo Open Platform, IV 2020 (the bounds).
"""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.bending import BANDWIDTH, add_bending, bending_matrix, end_chords, factorise, move_line, stiffness_of
from wzsumo.planning.footprint import Body, pose_is_free, sweep_margin
from wzsumo.planning.path_check import poses_through, touching_poses
from wzsumo.planning.terrain import Terrain

EASING_WAVELENGTHS_M = (25.0, 18.0, 13.0)  # tried in turn; chosen by us
_MAX_ROOM_M = 0.6  # to one side; chosen by us
_ROOM_STEP_M = 0.02  # the room is found in such steps: a change of curvature of 0.017 1/m spread over 10 m takes 0.07 m
_PENALTY = 100.0  # of leaving the bounds in a round, against leaving the poses: of 1, 4, 20 and 100 the quickest to settle
_N_ROUNDS = 400  # of the method of multipliers; chosen by us
_N_HALVINGS = 5  # of the room where the eased body touches something; chosen by us


@njit(cache=True, error_model="numpy")
def room_beside(poses: FloatArray, terrain: Terrain, body: Body) -> FloatArray:
    """How far (n, 2) [m] each of the free poses (n, 3) may move to the right, below 0, and to the left."""
    room = np.zeros((len(poses), 2))
    for i in range(len(poses)):
        x, y, heading = poses[i, 0], poses[i, 1], poses[i, 2]
        for side in range(2):
            sign, moved = 2.0 * side - 1.0, 0.0
            while moved < _MAX_ROOM_M:
                to_x, to_y = (
                    x - sign * (moved + _ROOM_STEP_M) * np.sin(heading),
                    y + sign * (moved + _ROOM_STEP_M) * np.cos(heading),
                )
                if not pose_is_free(terrain.distance, terrain.resolution, body, to_x, to_y, heading, 0.0):
                    break
                moved += _ROOM_STEP_M
            room[i, side] = sign * moved
    return room


def eased_points(poses: FloatArray, *, wavelength_m: float, terrain: Terrain, body: Body) -> FloatArray:
    """Points (n, 2) beside evenly spaced free poses (n, 3), n >= 6, without waves below `wavelength_m` where there is room.

    Both ends and the headings there are kept. Where the body, turned with the line, touches something, the room is halved.
    """
    step = float(np.hypot(*(poses[1, :2] - poses[0, :2])))
    reach = np.ones(2 * round((body.front - body.rear) / step) + 1)
    room = room_beside(poses, terrain, body)
    for _ in range(_N_HALVINGS):
        points = ease(poses, room=room, wavelength_m=wavelength_m)
        touching = touching_poses(poses_through(points, ends=poses[[0, -1], 2]), sweep_margin(body, step_m=step), terrain, body)
        if not touching.any():
            break
        room[np.convolve(touching, reach, mode="same")[: len(room)] > 0] /= 2
    return points


def ease(poses: FloatArray, *, room: FloatArray, wavelength_m: float) -> FloatArray:
    """Points (n, 2) of the line that bends least within `room` (n, 2) beside the poses (n, 3)."""
    step = float(np.hypot(*(poses[1, :2] - poses[0, :2])))
    x, y = poses[:, 0].copy(), poses[:, 1].copy()
    normals = np.column_stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])])
    chords = end_chords((poses[0, 2], poses[-1, 2]), step)
    _ease(x, y, normals, room, chords, stiffness_of(wavelength_m, step))
    return np.column_stack([x, y])


@njit(cache=True, error_model="numpy")
def _ease(x: FloatArray, y: FloatArray, normals: FloatArray, room: FloatArray, chords: FloatArray, stiffness: float) -> None:
    """Move the inner points of the line in place; `chords` (2, 2) run over either end."""
    n = len(x)
    from_x, from_y = x.copy(), y.copy()
    inside_x, inside_y, over_x, over_y = x.copy(), y.copy(), np.zeros(n), np.zeros(n)
    pull_x, pull_y, step, lower = np.zeros(n), np.zeros(n), np.empty(n), np.empty((n, BANDWIDTH + 1))
    factorise(bending_matrix(n), np.full(n, 1.0 + _PENALTY), stiffness, lower)
    for _ in range(_N_ROUNDS):
        for i in range(n):
            pull_x[i] = from_x[i] - x[i] + _PENALTY * (inside_x[i] - over_x[i] - x[i])
            pull_y[i] = from_y[i] - y[i] + _PENALTY * (inside_y[i] - over_y[i] - y[i])
        add_bending(x, chords[0, 0], chords[1, 0], stiffness, pull_x)
        add_bending(y, chords[0, 1], chords[1, 1], stiffness, pull_y)
        move_line(x, pull_x, lower, step)
        move_line(y, pull_y, lower, step)
        for i in range(n):
            aside = (x[i] + over_x[i] - from_x[i]) * normals[i, 0] + (y[i] + over_y[i] - from_y[i]) * normals[i, 1]
            aside = min(max(aside, room[i, 0]), room[i, 1])
            inside_x[i], inside_y[i] = from_x[i] + aside * normals[i, 0], from_y[i] + aside * normals[i, 1]
            over_x[i] += x[i] - inside_x[i]
            over_y[i] += y[i] - inside_y[i]
