"""The map of posts: where each cone, pole or guardrail post stands, located mainly by bearings.

The LiDAR sees the side of a post that faces it. Across the ray, the middle of that side is the middle of the post, whatever its
shape. Along the ray, the depth of the post's middle behind its surface depends on its shape, which is unknown. This error is
the same for all posts of a row and turns with the car, so a map that trusts the depth bends the trajectory (measured on our
simulated guardrail: 0.3 degrees in 300 m). A sighting therefore has a large standard deviation along its ray, and a post is
located by intersecting the bearings from several places (resection).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from wzsumo.frames import FloatArray, IntArray
from wzsumo.lidar_mapping.patches import Patches
from wzsumo.rigid import moved

# Standard deviations of a sighting.
DEPTH_SD_M = 0.05  # along its ray, when it is matched to the map: a third of a guardrail post's 0.15 m
# Along its ray, when it goes into the map: the depth error is common to all sightings from one side and must not average out.
# Set on our simulated drives (0.4, 1 and 3 m were tried).
MAPPED_DEPTH_SD_M = 3.0
ACROSS_SD_M = 0.01  # across its ray, besides the azimuth step: range noise and the car's motion. Chosen by us
MIN_SCANS = 3  # that a post must be seen in before sightings are matched to it; chosen by us


class PostMap:
    """Posts as vertical lines at `places` (m, 2) [m] in the world frame, whose `information` grows with each sighting.

    A sighting within `apart` [m] of a post is of that post.
    """

    def __init__(self, *, apart: float) -> None:
        self.apart = apart
        self.places: FloatArray = np.empty((0, 2))
        self.information: FloatArray = np.empty((0, 2, 2))  # of each place [1/m^2]
        self.scans: IntArray = np.empty(0, dtype=np.int64)

    def insert(self, points: FloatArray, *, sensor: FloatArray, step: float) -> None:
        """Add the sightings (n, 3) of one scan from a sensor at (3,), in the world frame; `step` is the azimuth step [rad].

        All sightings of one post, one for each layer of the LiDAR, together have the weight of one.
        """
        if len(points) == 0:
            return
        post = self._posts_of(points)
        share = 1 / np.bincount(post, minlength=len(self.places))[post]
        covariance = sighting_covariance(points, sensor=sensor, step=step, depth_sd=MAPPED_DEPTH_SD_M)
        information = share[:, None, None] * np.linalg.inv(covariance)
        pull = np.einsum("nij,nj->ni", information, points[:, :2] - self.places[post])
        gained, pulled = np.zeros_like(self.information), np.zeros_like(self.places)
        np.add.at(gained, post, information)
        np.add.at(pulled, post, pull)
        seen = np.unique(post)
        self.information[seen] += gained[seen]
        self.places[seen] += np.linalg.solve(self.information[seen], pulled[seen, :, None])[..., 0]
        self.scans[seen] += 1

    def nearest(self, points: FloatArray, *, within: float) -> IntArray:
        """Index (n,) of the post nearest to each point, -1 where no post within [m] was seen in at least MIN_SCANS scans."""
        known = np.flatnonzero(self.scans >= MIN_SCANS)
        if not (len(known) and len(points)):
            return np.full(len(points), -1, dtype=np.int64)
        away, number = cKDTree(self.places[known]).query(points[:, :2], distance_upper_bound=within)
        return np.where(np.isfinite(away), known[np.minimum(number, len(known) - 1)], -1)

    def _posts_of(self, points: FloatArray) -> IntArray:
        """Index (n,) of the post that each sighting is of. Sightings far from all known posts make new posts."""
        post = np.full(len(points), -1, dtype=np.int64)
        if len(self.places):
            away, number = cKDTree(self.places).query(points[:, :2], distance_upper_bound=self.apart)
            post = np.where(np.isfinite(away), number, -1)
        while (unmatched := np.flatnonzero(post < 0)).size:
            near = np.hypot(*(points[unmatched, :2] - points[unmatched[0], :2]).T) < self.apart
            post[unmatched[near]] = len(self.places)
            self.places = np.vstack([self.places, points[unmatched[near], :2].mean(axis=0)])
            self.information = np.concatenate([self.information, np.zeros((1, 2, 2))])
            self.scans = np.append(self.scans, 0)
        return post


@dataclass(frozen=True, kw_only=True, eq=False)
class PostMatcher:
    """Sightings (n, 3) of posts by a sensor at a place (3,) in the same frame, the azimuth step [rad], and the map of posts."""

    features: FloatArray
    sensor: FloatArray
    step: float
    target: PostMap

    def patches(self, pose: FloatArray, radius: float) -> Patches:
        """See Matcher. Directions are scaled by ACROSS_SD_M over the standard deviation of sighting and post together."""
        points = moved(self.features, pose)
        post = self.target.nearest(points, within=min(radius, self.target.apart))
        found, n = post >= 0, len(points)
        sensor = moved(self.sensor[None], pose)[0]
        covariance = sighting_covariance(points[found], sensor=sensor, step=self.step, depth_sd=DEPTH_SD_M)
        covariance = covariance + np.linalg.inv(self.target.information[post[found]])
        values, vectors = np.linalg.eigh(covariance)
        projector, centre, share = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros(n)
        projector[found, :2, :2] = np.einsum("nik,nk,njk->nij", vectors, ACROSS_SD_M / np.sqrt(values), vectors)
        centre[found, :2] = self.target.places[post[found]]
        share[found] = 1 / np.bincount(post[found])[post[found]] if found.any() else 0.0
        return Patches(centre=centre, projector=projector, dimension=2 * found.astype(np.int64), share=share)


def sighting_covariance(points: FloatArray, *, sensor: FloatArray, step: float, depth_sd: float) -> FloatArray:
    """Covariances (n, 2, 2) [m^2] of sightings (n, 3): `depth_sd` [m] along the ray, range noise and azimuth step across it."""
    ray = points[:, :2] - sensor[:2]
    range_ = np.maximum(np.hypot(*ray.T), 1e-6)
    ahead = ray / range_[:, None]
    across = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    sideways = ACROSS_SD_M**2 + (step * range_) ** 2 / 12  # variance of a uniform distribution over one azimuth step
    return depth_sd**2 * ahead[:, :, None] * ahead[:, None] + sideways[:, None, None] * across[:, :, None] * across[:, None]
