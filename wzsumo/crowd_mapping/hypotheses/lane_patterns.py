"""LanePattern: how many lanes there are, and which of them are closed for a while, with how likely a work zone has them."""

from dataclasses import dataclass

import numpy as np

# A lane too many is a danger, one too few is room left over: each further lane has to be 90 times as likely as not. At 2 m of
# error three wide lanes and four narrow ones fit 100 levels alike; at 0.5 m they do not.
LOG_FURTHER_LANE = -1.0
MOST_OPEN, LOG_CLOSED = 4, np.log([0.3, 0.5, 0.2])  # prior of 0 to 2 closed lanes on one side: it is a work zone
LOG_INTERIOR = np.log(0.1)  # of as many between open ones: TA-30 and TA-38 are two of the some ten lane closures of MUTCD 6P


@dataclass(frozen=True)
class LanePattern:
    """Lanes 0 (rightmost) .. n_lanes - 1, some of which, side by side, are closed for a while; never lane 0."""

    n_lanes: int
    closed: tuple[int, ...]

    @property
    def n_open(self) -> int:
        """Number of lanes that go through."""
        return self.n_lanes - len(self.closed)

    @property
    def is_interior(self) -> bool:
        """Whether open lanes pass on both sides of the closed ones."""
        return bool(self.closed) and self.closed[-1] < self.n_lanes - 1

    @property
    def log_prior(self) -> float:
        """Log of the chance that a work zone has such lanes, up to a constant."""
        return float(LOG_CLOSED[len(self.closed)] + LOG_INTERIOR * self.is_interior + LOG_FURTHER_LANE * (self.n_lanes - 1))


def likely_patterns(n_open: int | None, *, least_closed: int) -> list[LanePattern]:
    """Patterns worth a try; those that look the same in the mirror only where `least_closed` is 0."""
    patterns = []
    for k in range(1, MOST_OPEN + 1) if n_open is None else [n_open]:
        for m in range(least_closed, len(LOG_CLOSED)):
            # Counted from the first closed lane; k open lanes to its right: all of them, or between them.
            inner = range(1, k) if m and not least_closed and k + m <= MOST_OPEN else ()
            patterns += [LanePattern(k + m, tuple(range(first, first + m))) for first in (k, *inner)]
    return patterns
