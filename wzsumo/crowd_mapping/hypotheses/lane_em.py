"""Expectation-maximisation of one lane hypothesis: where its lanes lie, which lane each trace began in, where its closure is.

The levels y_i [m] of the traces' first lanes are a mixture of normal distributions with equal distances and one spread:

    y_i | first lane k ~ N(right + k width, spread^2),     p(k) = share_k

A trace of weight v_i counts as v_i traces. Each first lane also says how probable the trace's lane changes are, for each pair
of ends p of the closure (`change_likelihood`):

    p(all traces) = sum_p prior_p prod_i [ sum_k share_k N(y_i; right + k width, spread^2) likelihood_ipk ]^v_i

The expectation step gives the probabilities of k and p. The maximisation step is a weighted regression of the levels on k with
a normal prior of the width, Dirichlet pseudocounts for the shares, and a choice of the best among CANDIDATE_SPREADS_M. Sources:
Dempster, Laird and Rubin 1977; Louis 1982 for the covariance, which allows for the information that is missing.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray

# The prior of log(spread / usual spread): a normal distribution with this standard deviation below 0, whose cost has a maximum,
# and a Cauchy distribution with this scale above. All chosen by us.
NARROW_SPREAD_LOG_SD, MAX_NARROW_SPREAD_COST, WIDE_SPREAD_LOG_SCALE = 0.2, 6.0, 0.3
CANDIDATE_SPREADS_M = np.geomspace(0.08, 6.0, 120)  # chosen by us
MIN_ROUND_GAIN = 1e-2  # gain in log posterior below which the rounds end; chosen by us
# Where lanes overlap, part of the information is missing. At least this share is taken to remain in each direction. By us.
MIN_INFORMATION_SHARE = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneMixture:
    """Lanes as a mixture: lane k's middle at right + k width [m], standard deviation `spread` [m], `shares` (lanes,)."""

    right: float
    width: float
    spread: float
    shares: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class MixturePrior:
    """Prior of a mixture: width (mean, standard deviation) [m], usual spread [m], pseudocounts (lanes,) of vehicles."""

    width: tuple[float, float]
    usual_spread: float
    pseudocounts: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneObservations:
    """What the traces say under one hypothesis.

    `levels` (n,) [m] of the traces' first lanes and `weights` (n,); `likelihood` (n, pairs, lanes) of a trace's lane changes
    for each pair of the closure's ends and each first lane; `log_prior` (pairs,) of the pairs.
    """

    levels: FloatArray
    weights: FloatArray
    likelihood: FloatArray
    log_prior: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedMixture:
    """A mixture with the precision (2, 2) [1/m^2] of its right and width.

    `first` (n, lanes) are the probabilities of each trace's first lane and `pair_chance` (pairs,) those of the closure's ends,
    both from the last expectation step; `log_posterior` belongs to the mixture that this step began with.
    """

    mixture: LaneMixture
    precision: FloatArray
    first: FloatArray
    pair_chance: FloatArray
    log_posterior: float


def fit_lane_mixture(seen: LaneObservations, *, start: LaneMixture, prior: MixturePrior, rounds: int) -> FittedMixture:
    """The mixture of highest posterior near a start, after at most so many rounds."""
    right, width, spread, shares, precision, first, pair_chance, log_posterior = _alternate(
        seen.levels, seen.weights, seen.likelihood, seen.log_prior, (start.right, start.width, start.spread), start.shares,
        prior.width, prior.pseudocounts, CANDIDATE_SPREADS_M,
        _log_prior_of_spread(CANDIDATE_SPREADS_M, usual=prior.usual_spread), rounds,
    )  # fmt: skip
    mixture = LaneMixture(right=right, width=width, spread=spread, shares=shares)
    return FittedMixture(
        mixture=mixture, precision=precision, first=first, pair_chance=pair_chance, log_posterior=log_posterior
    )  # fmt: skip


def lane_covariance(fitted: FittedMixture, seen: LaneObservations, prior: MixturePrior) -> FloatArray:
    """Covariance (2, 2) [m^2] of the mixture's right and width, with the shares unknown.

    It is the inverse of the information of labelled traces less the information that is missing because the traces' first lanes
    are unknown (Louis 1982), over the parameters right, width and the logits of the shares.
    """
    at, r, n_lanes = fitted.mixture, fitted.first, fitted.first.shape[1]
    lane, free = np.arange(n_lanes), n_lanes - 1  # shares add up to one: the last one follows from the others
    miss = (seen.levels[:, None] - at.right - at.width * lane) / at.spread**2
    # Slopes (n, lanes, parameters) of each trace's log likelihood if it began in a lane.
    of_shares = np.broadcast_to((np.eye(n_lanes) - at.shares)[:, :free], (*r.shape, free))
    slopes = np.concatenate([miss[:, :, None], (lane * miss)[:, :, None], of_shares], axis=2)
    mean = np.einsum("nk,nkp->np", r, slopes)
    missing = np.einsum("n,nk,nkp,nkq->pq", seen.weights, r, slopes, slopes)
    missing -= np.einsum("n,np,nq->pq", seen.weights, mean, mean)
    information = np.zeros((2 + free, 2 + free))
    information[:2, :2] = fitted.precision
    of_one = np.diag(at.shares[:free]) - np.outer(at.shares[:free], at.shares[:free])
    information[2:, 2:] = (seen.weights.sum() + prior.pseudocounts.sum()) * of_one
    root = np.linalg.inv(np.linalg.cholesky(information))
    left, axes = np.linalg.eigh(root @ (information - missing) @ root.T)
    side = (axes.T @ root)[:, :2]
    return np.asarray(side.T / np.maximum(left, MIN_INFORMATION_SHARE) @ side)


def _log_prior_of_spread(spread: FloatArray, *, usual: float) -> FloatArray:
    """Log prior (n,) of spreads (n,) [m], 0 at the usual one.

    Narrow spreads are doubted sooner than wide ones, for many narrow lanes explain any levels. Far from the usual spread the
    prior is nearly flat.
    """
    away = np.log(spread / usual)
    return np.asarray(
        np.where(
            away < 0,
            -np.minimum(0.5 * (away / NARROW_SPREAD_LOG_SD) ** 2, MAX_NARROW_SPREAD_COST),
            -np.log1p((away / WIDE_SPREAD_LOG_SCALE) ** 2),
        )
    )


@njit(cache=True)
def _alternate(
    levels: FloatArray, weights: FloatArray, likelihood: FloatArray, log_prior: FloatArray, start: tuple[float, float, float],
    shares: FloatArray, width_prior: tuple[float, float], pseudocounts: FloatArray, spreads: FloatArray,
    log_of_spread: FloatArray, rounds: int,
) -> tuple[float, float, float, FloatArray, FloatArray, FloatArray, FloatArray, float]:  # fmt: skip
    """Right, width, spread, shares, precision, first, pair_chance and log posterior after the rounds."""
    n = weights.sum()
    mean, sd = width_prior
    at, of_spread = start, np.interp(start[2], spreads, log_of_spread)
    posterior = -np.inf
    for _ in range(rounds):
        first, pair_chance, evidence = _expect(levels, weights, likelihood, log_prior, at, np.log(shares))
        before = posterior
        of_shares = (pseudocounts * np.log(shares * len(shares))).sum()
        posterior = evidence + of_shares + of_spread - 0.5 * ((at[1] - mean) / sd) ** 2
        right, width, square, precision, shares = _regress(levels, weights, first, at[2], mean, sd, pseudocounts)
        best = np.argmax(log_of_spread - max(n - 1.0, 0.5) * np.log(spreads) - square / (2 * spreads**2))
        at, of_spread = (right, width, spreads[best]), log_of_spread[best]
        if posterior - before < MIN_ROUND_GAIN:
            break
    return at[0], at[1], at[2], shares, precision, first, pair_chance, posterior


@njit(cache=True)
def _expect(
    levels: FloatArray, weights: FloatArray, likelihood: FloatArray, log_prior: FloatArray, at: tuple[float, float, float],
    log_shares: FloatArray,
) -> tuple[FloatArray, FloatArray, float]:  # fmt: skip
    """Probabilities (n, lanes) of first lanes and (pairs,) of the closure's ends, and the log evidence of all traces."""
    n, n_pairs, n_lanes = likelihood.shape
    right, width, spread = at
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
                chance += joint[i, k] * likelihood[i, p, k]
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
                first[i, k] += joint[i, k] * likelihood[i, p, k] * share
    return first, pair_chance, log_evidence


@njit(cache=True)
def _regress(
    levels: FloatArray, weights: FloatArray, first: FloatArray, spread: float, mean: float, sd: float, pseudocounts: FloatArray
) -> tuple[float, float, float, FloatArray, FloatArray]:
    """Right and width of the lanes, the sum of squares [m^2] about them, the precision of both, and the shares.

    `first` (n, lanes) are the probabilities of first lanes; `mean` and `sd` [m] are those of the width's prior.
    """
    n_lanes = first.shape[1]
    shares = pseudocounts.copy()
    a, b, c = 0.0, 0.0, (spread / sd) ** 2
    side_right, side_width = 0.0, mean * c
    for i in range(len(levels)):
        for k in range(n_lanes):
            r = weights[i] * first[i, k]
            shares[k] += r
            a, b, c = a + r, b + r * k, c + r * k * k
            side_right, side_width = side_right + r * levels[i], side_width + r * k * levels[i]
    determinant = a * c - b * b
    right = (c * side_right - b * side_width) / determinant
    width = (a * side_width - b * side_right) / determinant
    square = 0.0
    for i in range(len(levels)):
        for k in range(n_lanes):
            square += weights[i] * first[i, k] * (levels[i] - right - k * width) ** 2
    return right, width, square, np.array([[a, b], [b, c]]) / spread**2, shares / shares.sum()
