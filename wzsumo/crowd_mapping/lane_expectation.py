"""Expectation step of the lane hypotheses: which lane each trace began in, and where the closure lies, for given lanes."""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray


def expected_lanes(
    levels: FloatArray,
    weights: FloatArray,
    fit: FloatArray,
    log_prior: FloatArray,
    *,
    right: float,
    width: float,
    spread: float,
    shares: FloatArray,
) -> tuple[FloatArray, FloatArray, float]:
    """Chances (n, lanes) of each trace's first lane and (pairs,) of the closure's two ends, and the log evidence of both.

    `levels` (n,) [m] and `weights` (n,) are the traces'; `fit` (n, pairs, lanes) says how well each trace's changes of lane
    suit each pair of ends and first lane, `log_prior` (pairs,) how likely a pair is beforehand. Lane k lies at right + k
    width [m], is taken with chance `shares` (lanes,), and levels scatter by `spread` [m] about it.
    """
    first, pair_chance, log_evidence = _expect(levels, weights, fit, log_prior, right, width, spread, np.log(shares))
    return np.asarray(first), np.asarray(pair_chance), float(log_evidence)


@njit(cache=True)
def _expect(
    levels: FloatArray, weights: FloatArray, fit: FloatArray, log_prior: FloatArray, right: float, width: float, spread: float,
    log_shares: FloatArray,
) -> tuple[FloatArray, FloatArray, float]:  # fmt: skip
    n, n_pairs, n_lanes = fit.shape
    joint = np.empty((n, n_lanes))
    total = np.empty((n, n_pairs))
    of_pair = log_prior.copy()
    for i in range(n):
        top = -np.inf
        for k in range(n_lanes):
            miss = (levels[i] - right - width * k) / spread
            joint[i, k] = log_shares[k] - 0.5 * miss * miss - np.log(spread)
            top = max(top, joint[i, k])
        for k in range(n_lanes):
            joint[i, k] = np.exp(joint[i, k] - top)
        for p in range(n_pairs):
            chance = 0.0
            for k in range(n_lanes):
                chance += joint[i, k] * fit[i, p, k]
            total[i, p] = chance
            of_pair[p] += weights[i] * (top + np.log(chance))
    best = of_pair.max()
    pair_chance = np.exp(of_pair - best)
    log_evidence = best + np.log(pair_chance.sum())
    pair_chance /= pair_chance.sum()
    first = np.zeros((n, n_lanes))
    for i in range(n):
        for p in range(n_pairs):
            share = pair_chance[p] / total[i, p]
            for k in range(n_lanes):
                first[i, k] += joint[i, k] * fit[i, p, k] * share
    return first, pair_chance, log_evidence
