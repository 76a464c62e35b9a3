"""How well lanes are known that were fitted to traces whose own lanes are not: the information that observed levels hold.

Were each trace's lane known, their levels would tell the lanes' place to spread / sqrt(n). At errors of 2 m they are not: more
traces in one lane and fewer in the next look like lanes that lie elsewhere. The information is less by what the lanes that
were not observed would have added (Louis 1982, "Finding the observed information matrix when using the EM algorithm").
"""

import numpy as np

from wzsumo.crowd_mapping.lane_em import FittedLanes, LaneLikelihood, LanePrior
from wzsumo.frames import FloatArray

LEAST_LEFT = 0.02  # of the information: below, the levels say nothing of the lanes, and the fit is none


def covariance_of(fitted: FittedLanes, seen: LaneLikelihood, prior: LanePrior) -> FloatArray:
    """Covariance (2, 2) [m^2] of the lanes' right and width, whatever their shares of the traces may be."""
    at, r, n_lanes = fitted.places, fitted.first, fitted.first.shape[1]
    lane, free = np.arange(n_lanes), n_lanes - 1  # shares add up to one: the last one follows from the others
    miss = (seen.levels[:, None] - at.right - at.width * lane) / at.spread**2
    # Slopes (n, lanes, parameters) of each trace's log likelihood, were it in a lane: by right, width, logits of the shares.
    of_shares = np.broadcast_to((np.eye(n_lanes) - at.shares)[:, :free], (*r.shape, free))
    slopes = np.concatenate([miss[:, :, None], (lane * miss)[:, :, None], of_shares], axis=2)
    mean = np.einsum("nk,nkp->np", r, slopes)
    missing = np.einsum("n,nk,nkp,nkq->pq", seen.weights, r, slopes, slopes)
    missing -= np.einsum("n,np,nq->pq", seen.weights, mean, mean)
    information = np.zeros((2 + free, 2 + free))
    information[:2, :2] = fitted.precision
    of_one = np.diag(at.shares[:free]) - np.outer(at.shares[:free], at.shares[:free])
    information[2:, 2:] = (seen.weights.sum() + prior.counts.sum()) * of_one
    root = np.linalg.inv(np.linalg.cholesky(information))
    left, axes = np.linalg.eigh(root @ (information - missing) @ root.T)
    side = (axes.T @ root)[:, :2]
    return np.asarray(side.T / np.maximum(left, LEAST_LEFT) @ side)
