"""Evidence: what one trace may say at most, and the sums that grow while traces speak for a change.

A chart is a cumulative sum (Page 1954) of what each trace says for its hypothesis against "as mapped", never below zero:

    W <- max(0, W + g(l)),   g(l) = log(1 - r + r e^l) - log(1 - q + q e^l)

l is a trace's log likelihood ratio. r is the share of traces that a change shows in, q the share that look like one without a
change; so no single trace says more than log(r / q) for a change, or log((1 - r) / (1 - q)) against it.

Vehicles that pass soon after each other often share a cause that is none of the zone's: a platoon that waits between two lanes
to overtake one truck steps aside as a whole, and then leaves its lane as a whole. So a trace soon behind another one does as
that one did with a chance that fades with the time between them, whatever the zone is like.
"""

import numba
import numpy as np

SHOWN_SHARE = 0.95  # r: of traces that show a change that is there
ODD_SHARE = 0.02  # q: of traces that seem to show one that is not
ALIKE = 0.5  # chance that a vehicle right behind another one does as that one does. Chosen by us, above what SUMO's drivers do
FOLLOWER_S = 3.0  # headways up to which a vehicle follows the one ahead (HCM 6th ed., ch. 15), and belongs to its platoon


@numba.njit(cache=True, nogil=True, inline="always")
def bounded(log_ratio: float, odd: float) -> float:
    """What a trace says, g(l) in nats, of its log likelihood ratio l; `odd` is q."""
    if log_ratio > 30.0:
        return np.log(SHOWN_SHARE / odd)
    ratio = np.exp(log_ratio)
    return np.log((1 - SHOWN_SHARE + SHOWN_SHARE * ratio) / (1 - odd + odd * ratio))


@numba.njit(cache=True, nogil=True, inline="always")
def likeness(gap_s: float) -> float:
    """Chance that a trace that ends `gap_s` [s] after another one does as that one did; nan where there was none: 0."""
    return 0.0 if np.isnan(gap_s) else ALIKE * np.exp(-((max(gap_s, 0.0) / FOLLOWER_S) ** 2))
