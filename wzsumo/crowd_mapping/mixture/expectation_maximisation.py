"""Expectation-maximisation (EM) of a Gaussian mixture in the plane.

The density of a point x is  p(x) = sum_j w_j N(x; m_j, S_j).  One iteration takes, for points x_i and components j,

    E:  r_ij = w_j N(x_i; m_j, S_j) / p(x_i)                                        the responsibilities
    M:  n_j = sum_i r_ij,  w_j = n_j / n,  m_j = sum_i r_ij x_i / n_j,
        S_j = sum_i r_ij (x_i - m_j)(x_i - m_j)' / n_j + reg_covar I

(Dempster, Laird and Rubin 1977). Regularisation and stopping rule are those of scikit-learn's GaussianMixture: from the same
start both reach the same mixture.

Both steps are one pass over the points, which adds responsibilities up at once: no (points, components) table is stored.
Points lie in blocks of neighbours (`point_blocks`). Over the bounding box of a block each component's density has an upper
and a lower bound. A component that stays below the best one by a factor of exp(-NEGLIGIBLE_LOG_RATIO) everywhere in the box
is left out there: its responsibility would vanish against 1 in double precision.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from wzsumo.crowd_mapping.mixture.point_blocks import BLOCK_SIZE, PointBlocks
from wzsumo.frames import FloatArray, IntArray

NEGLIGIBLE_LOG_RATIO = 37.0  # exp(-37) is below half the spacing of doubles at 1
_LOG_2_PI = float(np.log(2 * np.pi))
_TINY_COUNT = 10 * float(np.finfo(float).eps)  # added to n_j: keeps an empty component finite, as in scikit-learn


class Components(NamedTuple):
    """Weights (k,), means (k, 2) and covariances (k, 2, 2) of a mixture."""

    weights: FloatArray
    means: FloatArray
    covariances: FloatArray


class Fit(NamedTuple):
    """Where expectation-maximisation ended: the log-likelihood is that of exactly these components."""

    components: Components
    log_likelihood: float
    converged: bool


def run_em(blocks: PointBlocks, start: Components, *, reg_covar: float, tol: float, max_iterations: int) -> Fit:
    """The fit after at most `max_iterations` from a start, both in the axes of the blocks.

    EM stops where the mean log-likelihood of a point changes by less than `tol` in an iteration. `reg_covar` [m^2] is added to
    both variances of every component.
    """
    end = Components(*(part.copy() for part in start))
    log_likelihood, converged = _iterate(blocks.x, blocks.y, blocks.boxes, BLOCK_SIZE, *end, reg_covar, tol, max_iterations)
    return Fit(end, float(log_likelihood), bool(converged))


def to_block_axes(blocks: PointBlocks, components: Components) -> Components:
    """Components given in the world's axes, in the axes of the blocks."""
    weights, means, covariances = components
    turned = np.ascontiguousarray(blocks.axes.T @ covariances @ blocks.axes)
    return Components(np.array(weights, dtype=float), (means - blocks.centre) @ blocks.axes, turned)


def to_world_axes(blocks: PointBlocks, components: Components) -> Components:
    """Components given in the axes of the blocks, in the world's axes."""
    weights, means, covariances = components
    return Components(weights, means @ blocks.axes.T + blocks.centre, blocks.axes @ covariances @ blocks.axes.T)


def most_responsible(x: FloatArray, y: FloatArray, components: Components) -> IntArray:
    """Index (n,) of the component with the largest responsibility for each point x, y (n,)."""
    return np.asarray(_most_responsible(x, y, *components))


@njit(cache=True)
def _iterate(
    x: FloatArray, y: FloatArray, boxes: FloatArray, block_size: int, weights: FloatArray, means: FloatArray,
    covariances: FloatArray, reg_covar: float, tol: float, max_iterations: int,
) -> tuple[float, bool]:  # fmt: skip
    """(log-likelihood, whether EM converged) after the iterations; the components are changed in place."""
    n = len(x)
    sums = np.zeros((len(weights), 6))
    before = -np.inf
    converged = False
    for _ in range(max_iterations):
        sums[:] = 0.0
        mean_log_likelihood = _expectation(x, y, boxes, block_size, _densities_of(weights, means, covariances), sums) / n
        _maximisation(sums, n, reg_covar, weights, means, covariances)
        if abs(mean_log_likelihood - before) < tol:
            converged = True
            break
        before = mean_log_likelihood
    return _expectation(x, y, boxes, block_size, _densities_of(weights, means, covariances), sums), converged


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _expectation(x: FloatArray, y: FloatArray, boxes: FloatArray, block_size: int, rows: FloatArray, sums: FloatArray) -> float:
    """Log-likelihood of all points. Adds r, r u, r v, r u u, r u v, r v v of every component to `sums` (k, 6).

    r are the responsibilities, (u, v) the points' coordinates from the component's mean.
    """
    n, k = len(x), len(rows)
    chosen = np.empty(k, dtype=np.int64)
    log_density = np.empty((k, block_size))
    top = np.empty(block_size)
    total = np.empty(block_size)
    log_likelihood = 0.0
    for block in range(len(boxes)):
        first = block * block_size
        size = min(block_size, n - first)
        count = _candidates(boxes[block], rows, chosen)
        top[:size] = -np.inf
        for i in range(count):
            factor, mx, my, a, b, c = rows[chosen[i]]
            for p in range(size):
                u = x[first + p] - mx
                v = y[first + p] - my
                z1 = a * u
                z2 = b * u + c * v
                value = factor - 0.5 * (z1 * z1 + z2 * z2)
                log_density[i, p] = value
                top[p] = max(top[p], value)
        total[:size] = 0.0
        for i in range(count):
            for p in range(size):
                below = log_density[i, p] - top[p]
                share = 1.0 if below == 0.0 else (np.exp(below) if below > -NEGLIGIBLE_LOG_RATIO else 0.0)
                log_density[i, p] = share
                total[p] += share
        for p in range(size):
            log_likelihood += top[p]
            if total[p] != 1.0:
                log_likelihood += np.log(total[p])
                total[p] = 1.0 / total[p]
        for i in range(count):
            j = chosen[i]
            mx, my = rows[j, 1], rows[j, 2]
            s0 = s1 = s2 = s3 = s4 = s5 = 0.0
            for p in range(size):
                r = log_density[i, p] * total[p]
                u = x[first + p] - mx
                v = y[first + p] - my
                s0 += r
                s1 += r * u
                s2 += r * v
                s3 += r * u * u
                s4 += r * u * v
                s5 += r * v * v
            sums[j, 0] += s0
            sums[j, 1] += s1
            sums[j, 2] += s2
            sums[j, 3] += s3
            sums[j, 4] += s4
            sums[j, 5] += s5
    return log_likelihood


@njit(cache=True)
def _candidates(box: FloatArray, rows: FloatArray, chosen: IntArray) -> int:
    """Number of components that are not negligible everywhere in the box; their indices go into `chosen`."""
    k = len(rows)
    upper = np.empty(k)
    best = -np.inf
    for j in range(k):
        a, b, c = rows[j, 3], rows[j, 4], rows[j, 5]
        u, v = box[0] - rows[j, 1], box[1] - rows[j, 2]
        middle = np.hypot(a * u, b * u + c * v)
        # A norm is convex: over the box it is largest in a corner.
        wide, tall = a * box[2], b * box[2]
        reach = np.hypot(wide, abs(tall) + c * box[3])
        near = max(middle - reach, 0.0)
        upper[j] = rows[j, 0] - 0.5 * near * near
        best = max(best, rows[j, 0] - 0.5 * (middle + reach) * (middle + reach))
    count = 0
    for j in range(k):
        if upper[j] > best - NEGLIGIBLE_LOG_RATIO:
            chosen[count] = j
            count += 1
    return count


@njit(cache=True)
def _maximisation(
    sums: FloatArray, n: int, reg_covar: float, weights: FloatArray, means: FloatArray, covariances: FloatArray
) -> None:
    """Write weights, means and covariances that the `sums` of `_expectation` over n points give."""
    total = 0.0
    for j in range(len(weights)):
        count = sums[j, 0] + _TINY_COUNT
        du, dv = sums[j, 1] / count, sums[j, 2] / count
        means[j, 0] += du
        means[j, 1] += dv
        covariances[j, 0, 0] = sums[j, 3] / count - du * du + reg_covar
        covariances[j, 0, 1] = covariances[j, 1, 0] = sums[j, 4] / count - du * dv
        covariances[j, 1, 1] = sums[j, 5] / count - dv * dv + reg_covar
        weights[j] = count / n
        total += weights[j]
    for j in range(len(weights)):
        weights[j] /= total


@njit(cache=True)
def _most_responsible(
    x: FloatArray, y: FloatArray, weights: FloatArray, means: FloatArray, covariances: FloatArray
) -> IntArray:
    rows = _densities_of(weights, means, covariances)
    out = np.empty(len(x), dtype=np.int64)
    for p in range(len(x)):
        top = -np.inf
        for j in range(len(rows)):
            u, v = x[p] - rows[j, 1], y[p] - rows[j, 2]
            z1, z2 = rows[j, 3] * u, rows[j, 4] * u + rows[j, 5] * v
            value = rows[j, 0] - 0.5 * (z1 * z1 + z2 * z2)
            if value > top:
                top = value
                out[p] = j
    return out


@njit(cache=True)
def _densities_of(weights: FloatArray, means: FloatArray, covariances: FloatArray) -> FloatArray:
    """Rows (k, 6) f, mean x, mean y, a, b, c:  log(w N) = f - ((a u)^2 + (b u + c v)^2) / 2  at (u, v) from the mean."""
    k = len(weights)
    rows = np.empty((k, 6))
    for j in range(k):
        # Inverse of the lower Cholesky factor of the covariance.
        l11 = np.sqrt(covariances[j, 0, 0])
        l21 = covariances[j, 0, 1] / l11
        l22 = np.sqrt(max(covariances[j, 1, 1] - l21 * l21, 1e-300))
        rows[j, 0] = np.log(max(weights[j], 1e-300)) - _LOG_2_PI - np.log(l11) - np.log(l22)
        rows[j, 1] = means[j, 0]
        rows[j, 2] = means[j, 1]
        rows[j, 3] = 1.0 / l11
        rows[j, 4] = -l21 / (l11 * l22)
        rows[j, 5] = 1.0 / l22
    return rows
