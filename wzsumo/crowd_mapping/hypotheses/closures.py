"""Closures: between which stations lanes may be closed, and how likely each pair of ends is before any trace is looked at."""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.hypotheses.announcement import Announced, Announcement
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern
from wzsumo.frames import FloatArray, IntArray

CORE_M, CORE_SPREAD = 500.0, 0.6  # median length of the closed stretch and the standard deviation of its logarithm
PLACES = 18  # tried for either end of the closure
DOWNSTREAM_TAPER_M = 30.48  # per lane; MUTCD 11th ed., Table 6B-3: 50 to 100 ft
ANYWHERE_SHARE = 0.02  # of the closures that are not at all where they are announced
STEP_M = 2.0  # between places at which the announcement is asked


@dataclass(frozen=True, kw_only=True, eq=False)
class Closures:
    """`pairs` (pairs, 2) of stations (indices), first closed and first open again, and the log (pairs,) of their chances."""

    pairs: IntArray
    log_chance: FloatArray


def one_closure(closes: int, opens: int) -> Closures:
    """The one closure that is known, or none where both ends are the same station."""
    return Closures(pairs=np.array([(closes, opens)]), log_chance=np.zeros(1))


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosurePrior:
    """What is known of closures beforehand, on equally spaced `stations` (n,) [m].

    `announced` is the zone's announcement, if there is one; `merging_m` is the length L of a merging taper.
    """

    stations: FloatArray
    announced: Announced | None
    merging_m: float

    @property
    def mirrored(self) -> "ClosurePrior":
        """The same with right and left exchanged."""
        return replace(self, announced=self.announced.mirrored) if self.announced else self

    def closures(self, pattern: LanePattern) -> Closures:
        """The closures of a pattern's closed lanes, which are the leftmost ones or some between open ones."""
        if not pattern.closed:
            return one_closure(0, 0)
        n, spacing = len(self.stations), float(self.stations[1] - self.stations[0])
        places = np.unique(np.linspace(1, n, PLACES).astype(int))
        first, second = np.triu_indices(len(places), k=1)
        pairs = np.column_stack([places[first], places[second]])
        length = np.log(spacing * (pairs[:, 1] - pairs[:, 0]) / CORE_M) / CORE_SPREAD
        if self.announced is None:
            chance = np.exp(-0.5 * length**2)
        else:
            at = self.stations[0] + spacing * places
            # Ahead of lanes between open ones another lane ends, to make way for their traffic (MUTCD 11th ed., TA-38).
            before = len(pattern.closed) - (not pattern.is_interior)
            closes = _chances(at, self.announced.closing(pattern.closed[0], lanes_before=before), length=self.merging_m)
            opens = _chances(-at, self.announced.opening(lanes_before=before), length=DOWNSTREAM_TAPER_M)
            chance = closes[first] * opens[second] * np.exp(-0.5 * np.minimum(length, 0.0) ** 2)
        return Closures(pairs=pairs, log_chance=np.log(chance / chance.sum()))


def _chances(places: FloatArray, announcement: Announcement, *, length: float) -> FloatArray:
    """Chance (n,) that the end of a lane is nearest to each of places (n,) [m], which ascend or descend."""
    fine = np.arange(places.min(), places.max() + STEP_M, STEP_M)
    nearest = np.abs(fine[:, None] - places).argmin(axis=1)
    mass = np.bincount(nearest, weights=announcement.density(fine, length=length), minlength=len(places))
    return np.asarray((1 - ANYWHERE_SHARE) * mass / max(mass.sum(), 1e-12) + ANYWHERE_SHARE / len(places))
