"""Point clouds of a room and of a street, as LiDARs see them."""

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.rigid import moved, rigid, rotation_from_rpy


def room(seed: int, n: int = 5000, noise: float = 0.01) -> FloatArray:
    """Points on floor and four walls of a room of 20 x 12 x 6 m."""
    rng = np.random.default_rng(seed)
    face, points = rng.integers(0, 5, n), rng.uniform(-1, 1, (n, 3)) * (10, 6, 3)
    for number, (axis, side) in enumerate([(2, -3), (0, 10), (0, -10), (1, 6), (1, -6)]):
        points[face == number, axis] = side
    return points + noise * rng.standard_normal(points.shape)


def street(x: float, seed: int, *, yaw: float = 0.0, y: float = 0.0) -> FloatArray:
    """What a LiDAR at (x, y) sees of a flat road with poles and cones: rings on the ground that travel with it."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(-np.pi, np.pi, 400, endpoint=False)
    reach = 1.9 / np.tan(np.deg2rad(np.linspace(2.5, 25, 40)))
    rings = np.column_stack([np.outer(reach, np.cos(turn)).ravel(), np.outer(reach, np.sin(turn)).ravel()])
    clouds = [np.column_stack([rings, np.full(len(rings), -1.9)])]
    for k, centre in enumerate([(-25, 6), (-7, 6), (11, 6.5), (29, 7), (-30, -9), (4, -8), (33, -10)]):
        height = np.linspace(-1.4, -1.0 if k < 4 else 0.6, 14)
        away = np.subtract(centre, (x, y))
        face = np.arctan2(-away[1], -away[0]) + np.linspace(-1.2, 1.2, 5)
        mantle = away + 0.12 * np.column_stack([np.cos(face), np.sin(face)])
        clouds.append(np.column_stack([np.tile(mantle, (14, 1)), np.repeat(height, 5)]))
    cloud = np.vstack(clouds)
    return moved(cloud + 0.02 * rng.standard_normal(cloud.shape), rigid(rotation_from_rpy([0, 0, -yaw]), np.zeros(3)))


def beside_rail(x: float, seed: int) -> FloatArray:
    """What a LiDAR at (x, 0) sees of a flat road beside a smooth rail that goes on for ever: the same from every x."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(-np.pi, np.pi, 360, endpoint=False) + np.deg2rad(7 * x)
    reach = 1.8 / np.tan(np.deg2rad(np.linspace(2.4, 25, 16)))
    rings = np.column_stack([np.outer(reach, np.cos(turn)).ravel(), np.outer(reach, np.sin(turn)).ravel()])
    bearing = np.deg2rad(np.arange(-165.0, -15.0, 0.35))
    rail = np.column_stack([-5.1 / np.tan(bearing), np.full(len(bearing), -5.1)])
    heights = np.repeat([-1.4, -1.25, -1.1], len(rail))
    clouds = [np.column_stack([rings, np.full(len(rings), -1.8)]), np.column_stack([np.tile(rail, (3, 1)), heights])]
    return np.vstack(clouds) + 0.01 * rng.standard_normal((len(rings) + len(heights), 3))


def tunnel(seed: int, n: int = 6000) -> FloatArray:
    """Points on floor and vault of a straight tunnel of 5 m radius."""
    rng = np.random.default_rng(seed)
    x, turn = rng.uniform(-20, 20, n), rng.uniform(-0.3, np.pi + 0.3, n)
    return np.column_stack([x, 5 * np.cos(turn), 5 * np.sin(turn)]) + 0.01 * rng.standard_normal((n, 3))
