"""Evidence: what one trace may say at most, and the sums that grow while traces speak for a change.

A chart is a cumulative sum (Page 1954) of what each trace says for its hypothesis against "as mapped", never below zero:

    W <- max(0, W + g(l)),   g(l) = log(1 - r + r e^l) - log(1 - q + q e^l)

l is a trace's log likelihood ratio. r is the share of traces that a change shows in, q the share that look like one without a
change; so no single trace says more than log(r / q) for a change, or log((1 - r) / (1 - q)) against it.
"""

import numba
import numpy as np

SHOWN_SHARE = 0.95  # r: of traces that show a change that is there
ODD_SHARE = 0.02  # q: of traces that seem to show one that is not


@numba.njit(cache=True, nogil=True, inline="always")
def bounded(log_ratio: float) -> float:
    """What a trace says, g(l) in nats, of its log likelihood ratio l."""
    if log_ratio > 30.0:
        return np.log(SHOWN_SHARE / ODD_SHARE)
    ratio = np.exp(log_ratio)
    return np.log((1 - SHOWN_SHARE + SHOWN_SHARE * ratio) / (1 - ODD_SHARE + ODD_SHARE * ratio))
