"""Expectation-maximisation of a lane hypothesis: which lane each trace began in, where the lanes lie, where the closure is."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray

LESS_SD, MOST_DOUBT, MORE_SCALE = 0.2, 6.0, 0.3  # of the logarithm of the spread between traces against the usual one
SPREADS_M = np.geomspace(0.08, 6.0, 120)  # tried
SETTLED = 1e-2  # gain in log posterior below which a further round is not worth it


@dataclass(frozen=True, kw_only=True, eq=False)
class LanePlaces:
    """Lane k lies at right + k width [m], a share of the traces (`shares`, (lanes,)) scatters by `spread` [m] about it."""

    right: float
    width: float
    spread: float
    shares: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LanePrior:
    """What is likely beforehand: the width (mean, sd) [m], the spread [m], and counts (lanes,) of vehicles in each lane."""

    width: tuple[float, float]
    usual_spread: float
    counts: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneLikelihood:
    """What the traces say: `levels` (n,) [m] and `weights` (n,) of theirs; how well their lane changes suit the hypothesis.

    `fit` (n, pairs, lanes) is the chance of a trace's changes for each pair of a closure's ends and each first lane,
    `log_prior` (pairs,) how likely a pair is beforehand.
    """

    levels: FloatArray
    weights: FloatArray
    fit: FloatArray
    log_prior: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedLanes:
    """Places with the precision (2, 2) [1/m^2] of right and width, and what they were fitted to in the last round.

    `first` (n, lanes) are chances of each trace's first lane, `pair_chance` (pairs,) of the closure's ends.
    """

    places: LanePlaces
    precision: FloatArray
    first: FloatArray
    pair_chance: FloatArray
    log_posterior: float


def fit_lanes(seen: LaneLikelihood, *, start: LanePlaces, prior: LanePrior, rounds: int) -> FittedLanes:
    """The likeliest places near a start, after so many rounds of expectation and maximisation or when they have settled."""
    right, width, spread, shares, precision, first, pair_chance, log_posterior = _alternate(
        seen.levels, seen.weights, seen.fit, seen.log_prior, (start.right, start.width, start.spread), start.shares,
        prior.width, prior.counts, SPREADS_M, log_prior_of_spread(SPREADS_M, usual=prior.usual_spread), rounds,
    )  # fmt: skip
    places = LanePlaces(right=right, width=width, spread=spread, shares=shares)
    return FittedLanes(
        places=places, precision=precision, first=first, pair_chance=pair_chance, log_posterior=log_posterior
    )  # fmt: skip


def expected_lanes(seen: LaneLikelihood, places: LanePlaces) -> tuple[FloatArray, FloatArray, float]:
    """Chances (n, lanes) of each trace's first lane and (pairs,) of the closure's two ends, and the log evidence of both."""
    at = (places.right, places.width, places.spread)
    first, pair_chance, log_evidence = _expect(seen.levels, seen.weights, seen.fit, seen.log_prior, at, np.log(places.shares))
    return np.asarray(first), np.asarray(pair_chance), float(log_evidence)


def log_prior_of_spread(spread: FloatArray, *, usual: float) -> FloatArray:
    """Log prior of spreads (n,) [m]: near the usual one it pulls, far away it lets go.

    Traces that differ by less than their drift lets expect are doubted sooner than others: many narrow lanes fit any levels.
    """
    away = np.log(spread / usual)
    return np.asarray(
        np.where(away < 0, -np.minimum(0.5 * (away / LESS_SD) ** 2, MOST_DOUBT), -np.log1p((away / MORE_SCALE) ** 2))
    )


@njit(cache=True)
def _alternate(
    levels: FloatArray, weights: FloatArray, fit: FloatArray, log_prior: FloatArray, start: tuple[float, float, float],
    shares: FloatArray, width_prior: tuple[float, float], counts: FloatArray, spreads: FloatArray, log_of_spread: FloatArray,
    rounds: int,
) -> tuple[float, float, float, FloatArray, FloatArray, FloatArray, FloatArray, float]:  # fmt: skip
    n = weights.sum()
    mean, sd = width_prior
    at, of_spread = start, np.interp(start[2], spreads, log_of_spread)
    posterior = -np.inf
    for _ in range(rounds):
        first, pair_chance, evidence = _expect(levels, weights, fit, log_prior, at, np.log(shares))
        before = posterior
        posterior = evidence + (counts * np.log(shares * len(shares))).sum() + of_spread - 0.5 * ((at[1] - mean) / sd) ** 2
        right, width, square, precision, shares = _regress(levels, weights, first, at[2], mean, sd, counts)
        best = np.argmax(log_of_spread - max(n - 1.0, 0.5) * np.log(spreads) - square / (2 * spreads**2))
        at, of_spread = (right, width, spreads[best]), log_of_spread[best]
        if posterior - before < SETTLED:
            break
    return at[0], at[1], at[2], shares, precision, first, pair_chance, posterior


@njit(cache=True)
def _regress(
    levels: FloatArray, weights: FloatArray, first: FloatArray, spread: float, mean: float, sd: float, counts: FloatArray
) -> tuple[float, float, float, FloatArray, FloatArray]:
    """Right edge, width, sum of squares about them, precision of both, and the lanes' shares, for chances of first lanes."""
    n_lanes = first.shape[1]
    shares = counts.copy()
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


@njit(cache=True)
def _expect(
    levels: FloatArray, weights: FloatArray, fit: FloatArray, log_prior: FloatArray, at: tuple[float, float, float],
    log_shares: FloatArray,
) -> tuple[FloatArray, FloatArray, float]:  # fmt: skip
    n, n_pairs, n_lanes = fit.shape
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
