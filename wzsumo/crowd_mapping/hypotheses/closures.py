"""ClosurePrior: between which stations the closed lanes of a pattern may be closed, and how probable each pair of ends is.

A closure has two ends: the station from which its lanes are closed, a, and the one from which they are open again, b. Both are
chosen from a few candidate stations. Where nothing is announced, only the closed length counts:

    log p(a, b) = -1/2 (log((b - a) / 500 m) / 0.6)^2 + constant

An announced zone gives each end a density of its own (`announcement`), and closed lengths below the median stay less probable:

    p(a, b) = p_closing(a) p_opening(b) exp(-1/2 min(log((b - a) / 500 m) / 0.6, 0)^2)
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.hypotheses.announcement import AnnouncedZone, TaperEndPrior
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern
from wzsumo.frames import FloatArray, IntArray

CLOSED_LENGTH_MEDIAN_M, CLOSED_LENGTH_LOG_SD = 500.0, 0.6  # of the stretch where lanes are fully closed; chosen by us
N_CANDIDATE_STATIONS = 18  # for either end; chosen by us
DOWNSTREAM_TAPER_M = 30.48  # 100 ft a lane; MUTCD 11th ed., Table 6B-3: 50 to 100 ft
P_ELSEWHERE = 0.02  # that a closure's end is not where it is announced but at any candidate; chosen by us
DENSITY_STEP_M = 2.0  # at which the announcement's density is summed


@dataclass(frozen=True, kw_only=True, eq=False)
class CandidateClosures:
    """Pairs of ends that a closure may have.

    `ends` (pairs, 2) are indices of stations: the first closed one, and the first that is open again. `log_prior` (pairs,) are
    the logs of their probabilities.
    """

    ends: IntArray
    log_prior: FloatArray


def known_closure(closed_from: int, open_from: int) -> CandidateClosures:
    """The one closure between two stations (indices); no lane is closed anywhere where both are the same."""
    return CandidateClosures(ends=np.array([(closed_from, open_from)]), log_prior=np.zeros(1))


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosurePrior:
    """What is known of closures beforehand, on equally spaced `stations` (n,) [m].

    `announced` is None where no zone is announced; `merging_length_m` is the length L of a merging taper.
    """

    stations: FloatArray
    announced: AnnouncedZone | None
    merging_length_m: float

    @property
    def mirrored(self) -> "ClosurePrior":
        """The same with right and left exchanged."""
        return replace(self, announced=self.announced.mirrored) if self.announced else self

    def candidates(self, pattern: LanePattern) -> CandidateClosures:
        """The closures that a pattern's closed lanes may have, with their probabilities."""
        if not pattern.closed:
            return known_closure(0, 0)
        n, spacing = len(self.stations), float(self.stations[1] - self.stations[0])
        places = np.unique(np.linspace(1, n, N_CANDIDATE_STATIONS).astype(int))
        first, second = np.triu_indices(len(places), k=1)
        ends = np.column_stack([places[first], places[second]])
        log_length = np.log(spacing * (ends[:, 1] - ends[:, 0]) / CLOSED_LENGTH_MEDIAN_M) / CLOSED_LENGTH_LOG_SD
        if self.announced is None:
            chance = np.exp(-0.5 * log_length**2)
        else:
            at = self.stations[0] + spacing * places
            # Ahead of interior closed lanes an outer lane closes first, to make room for their traffic (MUTCD 11th ed., TA-38).
            before = len(pattern.closed) - (not pattern.is_interior)
            closing = self.announced.closing_prior(pattern.closed[0], lanes_before=before)
            opening = self.announced.opening_prior(lanes_before=before)
            closes = _chances(at, closing, length=self.merging_length_m)
            opens = _chances(-at, opening, length=DOWNSTREAM_TAPER_M)
            chance = closes[first] * opens[second] * np.exp(-0.5 * np.minimum(log_length, 0.0) ** 2)
        return CandidateClosures(ends=ends, log_prior=np.log(chance / chance.sum()))


def _chances(places: FloatArray, prior: TaperEndPrior, *, length: float) -> FloatArray:
    """Probability (n,) that a taper's end is nearest to each of `places` (n,) [m], which ascend or descend."""
    fine = np.arange(places.min(), places.max() + DENSITY_STEP_M, DENSITY_STEP_M)
    nearest = np.abs(fine[:, None] - places).argmin(axis=1)
    mass = np.bincount(nearest, weights=prior.density(fine, length=length), minlength=len(places))
    return np.asarray((1 - P_ELSEWHERE) * mass / max(mass.sum(), 1e-12) + P_ELSEWHERE / len(places))
