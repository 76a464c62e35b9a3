"""LanePattern: how many lanes there are and which of them the work closes, with its prior probability.

    log p(pattern) = log p(m lanes are closed) + (n_lanes - 1) log p(a further lane) + [interior] log p(interior) + constant

A pattern's closed lanes are the leftmost ones, or interior ones with open lanes on both sides. Closures on the right are
fitted in the mirror image (`lane_levels`). The shares of traffic in the lanes have a Dirichlet prior, whose pseudocounts are
vehicles that are counted in each lane beforehand.
"""

from dataclasses import dataclass

import numpy as np

from wzsumo.frames import FloatArray

MAX_OPEN_LANES = 4  # of one direction; chosen by us
# Log prior of each lane beyond the first; chosen by us. At a GNSS error of 2 m three wide lanes and four narrow
# ones explain 100 traces about equally well, and a lane too many is more dangerous than one too few.
LOG_PRIOR_FURTHER_LANE = -1.0
LOG_PRIOR_CLOSED_LANES = np.log([0.3, 0.5, 0.2])  # of 0, 1 and 2 closed lanes; chosen by us for work zones
# Of closed lanes between open ones: TA-30 and TA-38 are two of some ten lane closures in MUTCD 11th ed., chapter 6P.
LOG_PRIOR_INTERIOR = np.log(0.1)
OPEN_LANE_PSEUDOCOUNT = 3.0  # vehicles; open lanes are used about alike. Chosen by us
CLOSED_LANE_PSEUDOCOUNT = 0.5  # vehicles; a closing lane may be nearly empty. Chosen by us


@dataclass(frozen=True)
class LanePattern:
    """Lanes 0 (rightmost) .. n_lanes - 1, of which adjacent ones, never lane 0, are closed for a stretch."""

    n_lanes: int
    closed: tuple[int, ...]

    @property
    def n_open(self) -> int:
        """Number of lanes that are open all along."""
        return self.n_lanes - len(self.closed)

    @property
    def is_interior(self) -> bool:
        """Whether open lanes pass on both sides of the closed ones."""
        return bool(self.closed) and self.closed[-1] < self.n_lanes - 1

    @property
    def log_prior(self) -> float:
        """Log of the probability that a work zone has this pattern, up to a constant."""
        return float(
            LOG_PRIOR_CLOSED_LANES[len(self.closed)]
            + LOG_PRIOR_INTERIOR * self.is_interior
            + LOG_PRIOR_FURTHER_LANE * (self.n_lanes - 1)
        )

    @property
    def pseudocounts(self) -> FloatArray:
        """Vehicles (n_lanes,) that are counted in each lane beforehand."""
        closed = np.isin(np.arange(self.n_lanes), self.closed)
        return np.asarray(np.where(closed, CLOSED_LANE_PSEUDOCOUNT, OPEN_LANE_PSEUDOCOUNT))


def candidate_patterns(n_open: int | None, *, min_closed: int) -> list[LanePattern]:
    """The patterns to fit, with `n_open` open lanes where that is known and at least `min_closed` closed ones.

    Patterns without a closure on one side only (none closed, or interior lanes closed) look the same in the mirror. They are
    in the list only where `min_closed` is 0.
    """
    patterns = []
    for k in range(1, MAX_OPEN_LANES + 1) if n_open is None else [n_open]:
        for m in range(min_closed, len(LOG_PRIOR_CLOSED_LANES)):
            # The first closed lane is k where all k open lanes are on its right, less where the closed lanes are interior.
            interior = range(1, k) if m and not min_closed and k + m <= MAX_OPEN_LANES else ()
            patterns += [LanePattern(k + m, tuple(range(first, first + m))) for first in (k, *interior)]
    return patterns
