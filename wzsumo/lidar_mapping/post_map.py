"""The map of posts: where each cone, pole or rail post stands, told mostly by bearings.

Of something narrow the LiDAR sees the side that faces it. The middle of that side is the middle of the post across the ray,
whatever its shape; how far behind the surface the middle lies depends on the shape, which nobody knows: half the width of a
cone, less of a box seen along the road, more of it from abreast. That error is the same for every post of a row and turns
with the car, so that a map that believes it bends the way (0.3 degrees in 300 m beside a guardrail). So along its ray a
sighting counts for little, and passing by a post fixes it by intersection, as surveyors do.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from wzsumo.frames import FloatArray, IntArray
from wzsumo.lidar_mapping.patches import Patches
from wzsumo.rigid import moved

DEPTH_M = 0.05  # standard deviation of a post's middle behind what is seen of it: a third of a rail post's 0.15 m
# The same in the map. The error is one and the same in all sightings from one side, so it must not average out: bearings
# alone place a post, and this only holds one that was seen from one side. Chosen among 0.4, 1 and 3 m (seeds 1, 2 and 82).
MAPPED_DEPTH_M = 3.0
ACROSS_M = 0.01  # of a sighting across its ray, besides the azimuth step: range noise and the car's own motion
FEWEST_SCANS = 3  # that a post was seen in before anything is laid on it


class PostMap:
    """Posts as vertical lines at places (m, 2) that grow surer with each sighting.

    `apart` [m]: sightings nearer to a post than this are of it.
    """

    def __init__(self, *, apart: float) -> None:
        self.apart = apart
        self.places: FloatArray = np.empty((0, 2))
        self.information: FloatArray = np.empty((0, 2, 2))  # of each place [1/m^2]
        self.scans: IntArray = np.empty(0, dtype=np.int64)

    def insert(self, points: FloatArray, *, sensor: FloatArray, step: float) -> None:
        """Add the sightings (n, 3) of one scan by a sensor at a place (3,) with an azimuth step [rad].

        The sightings of one post, a layer of the LiDAR each, count as one.
        """
        if len(points) == 0:
            return
        post = self._posts_of(points)
        share = 1 / np.bincount(post, minlength=len(self.places))[post]
        doubt = sighting_covariance(points, sensor=sensor, step=step, depth=MAPPED_DEPTH_M)
        told = share[:, None, None] * np.linalg.inv(doubt)
        pull = np.einsum("nij,nj->ni", told, points[:, :2] - self.places[post])
        gained, moved_by = np.zeros_like(self.information), np.zeros_like(self.places)
        np.add.at(gained, post, told)
        np.add.at(moved_by, post, pull)
        seen = np.unique(post)
        self.information[seen] += gained[seen]
        self.places[seen] += np.linalg.solve(self.information[seen], moved_by[seen, :, None])[..., 0]
        self.scans[seen] += 1

    def nearest(self, points: FloatArray, *, within: float) -> IntArray:
        """Number of the post (n,) nearest to each point, -1 where none that was seen often enough is near."""
        known = np.flatnonzero(self.scans >= FEWEST_SCANS)
        if not (len(known) and len(points)):
            return np.full(len(points), -1, dtype=np.int64)
        away, number = cKDTree(self.places[known]).query(points[:, :2], distance_upper_bound=within)
        return np.where(np.isfinite(away), known[np.minimum(number, len(known) - 1)], -1)

    def _posts_of(self, points: FloatArray) -> IntArray:
        """Number of the post (n,) that each sighting is of; new posts are made of those far from all known ones."""
        post = np.full(len(points), -1, dtype=np.int64)
        if len(self.places):
            away, number = cKDTree(self.places).query(points[:, :2], distance_upper_bound=self.apart)
            post = np.where(np.isfinite(away), number, -1)
        while (left := np.flatnonzero(post < 0)).size:
            near = np.hypot(*(points[left, :2] - points[left[0], :2]).T) < self.apart
            post[left[near]] = len(self.places)
            self.places = np.vstack([self.places, points[left[near], :2].mean(axis=0)])
            self.information = np.concatenate([self.information, np.zeros((1, 2, 2))])
            self.scans = np.append(self.scans, 0)
        return post


@dataclass(frozen=True, kw_only=True, eq=False)
class PostMatcher:
    """Sightings (n, 3) of posts by a sensor at a place (3,) in the same frame, its azimuth step [rad], and a map of posts."""

    features: FloatArray
    sensor: FloatArray
    step: float
    target: PostMap

    def patches(self, pose: FloatArray, radius: float) -> Patches:
        """See Matcher: of each sighting the post and how sure both are, in units of ACROSS_M."""
        points = moved(self.features, pose)
        post = self.target.nearest(points, within=min(radius, self.target.apart))
        found, n = post >= 0, len(points)
        sensor = moved(self.sensor[None], pose)[0]
        covariance = sighting_covariance(points[found], sensor=sensor, step=self.step, depth=DEPTH_M)
        covariance = covariance + np.linalg.inv(self.target.information[post[found]])
        values, vectors = np.linalg.eigh(covariance)
        projector, centre, share = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros(n)
        projector[found, :2, :2] = np.einsum("nik,nk,njk->nij", vectors, ACROSS_M / np.sqrt(values), vectors)
        centre[found, :2] = self.target.places[post[found]]
        share[found] = 1 / np.bincount(post[found])[post[found]] if found.any() else 0.0
        return Patches(centre=centre, projector=projector, dimension=2 * found.astype(np.int64), share=share)


def sighting_covariance(points: FloatArray, *, sensor: FloatArray, step: float, depth: float) -> FloatArray:
    """Covariances (n, 2, 2) [m^2] of posts' places (n, 3) as one scan tells them: `depth` along the ray, less across it."""
    away = points[:, :2] - sensor[:2]
    reach = np.maximum(np.hypot(*away.T), 1e-6)
    ahead = away / reach[:, None]
    across = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    sideways = ACROSS_M**2 + (step * reach) ** 2 / 12  # the middle of a run is known to an azimuth step
    return depth**2 * ahead[:, :, None] * ahead[:, None] + sideways[:, None, None] * across[:, :, None] * across[:, None]
