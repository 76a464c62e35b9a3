"""The course: how far the lanes lie beside the axis at each station, from all traces at once, with its covariance.

    y_i - w x_i = D + u_i + e_i,    u_i ~ N(0, K_i) Gauss-Markov,    e_i ~ N(0, R_i)

x_i is the expected lane. With W_i = (K_i + R_i)^-1 the information about D is sum W_i, that about the lanes' width sum
x_i' W_i x_i. W is never formed: by Woodbury W v = R^-1 v - R^-1 (K^-1 + R^-1)^-1 R^-1 v, and K^-1 of a Gauss-Markov series is
tridiagonal. D is bent at few places (Laplace prior of its second differences, by reweighting) and lies, outside the zone, at
one shift c of all receivers against the road, unless the lanes are moved there (a Cauchy density).
"""

from dataclasses import dataclass

import numba
import numpy as np

from wzsumo.frames import FloatArray

KINK_SCALE = 0.004  # [1]: mean change of direction at a station; a shifting taper of 1:30 begins with 0.033
SMALLEST_KINK = 0.02  # of that: smaller ones cost nothing
KINK_ROUNDS = 6
# (probability, sd [m]) of the shift of all positions together: ionosphere and clocks; a datum, or a road drawn off its place
SHIFT_PRIOR = ((0.9, 0.7), (0.1, 3.0))
MOVED_M = 0.3  # off the known road: beyond, the lanes are taken to be moved (a Cauchy density)


@dataclass(frozen=True, kw_only=True, eq=False)
class CoursePrior:
    """`known` (m,) [1/m^2] is the information that the course lies at the common shift, 0 where nothing is known of it.

    `width` and `width_sd` [m] are of a lane, `spacing` [m] of the stations.
    """

    known: FloatArray
    width: float
    width_sd: float
    spacing: float

    @property
    def has_road(self) -> bool:
        """Whether anything is known of the road."""
        return bool(self.known.max() > 1e-3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """`offset` (stations,) [m] of lane 0 from its nominal place, with the common shift; `sd` (stations,) [m] without its own.

    `shift` and `shift_sd` [m] are the common shift; `width` [m] of a lane and its sd.
    """

    offset: FloatArray
    sd: FloatArray
    shift: float
    shift_sd: float
    width: float
    width_sd: float
    log_prior: float


@numba.njit(cache=True, nogil=True)
def _information(  # noqa: C901 - one pass over each trace: a call in it costs more than reading it
    y: FloatArray, weight: FloatArray, x: FloatArray, rho: FloatArray, sigma2: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(H (m + 1, m + 1), g (m + 1,)): information about D and a factor of x, summed over traces."""
    n, m = y.shape
    h = np.zeros((m + 1, m + 1))
    g = np.zeros(m + 1)
    for i in range(n):
        low, high = m, 0
        for t in range(m):
            if weight[i, t] > 0:
                low, high = min(low, t), max(high, t + 1)
        size = high - low
        if size <= 0:
            continue
        q = sigma2[i] * (1 - rho[i] ** 2)
        r = rho[i]
        diagonal, beside = np.empty(size), -r / q
        w, yy, xx = weight[i, low:high], y[i, low:high], x[i, low:high]
        for t in range(size):
            ends = (t == 0) + (t == size - 1)
            base = (1 + r * r) / q if ends == 0 else (1 / q if ends == 1 else 1 / sigma2[i])
            diagonal[t] = base + w[t]
        # (K^-1 + R^-1)^-1 of a tridiagonal matrix: by elimination from both ends.
        down, up = np.empty(size), np.empty(size)
        down[0] = diagonal[0]
        for t in range(1, size):
            down[t] = diagonal[t] - beside * beside / down[t - 1]
        up[size - 1] = diagonal[size - 1]
        for t in range(size - 2, -1, -1):
            up[t] = diagonal[t] - beside * beside / up[t + 1]
        for b in range(size):
            if w[b] == 0:
                continue
            value = 1.0 / (down[b] + up[b] - diagonal[b])
            # column b of the inverse, upwards and downwards
            for a in range(b, -1, -1):
                if a < b:
                    value = -value * beside / down[a]
                if w[a] > 0:
                    part = -w[a] * value * w[b]
                    if a == b:
                        part += w[a]
                    h[low + a, low + b] += part
                    if a != b:
                        h[low + b, low + a] += part
                    g[low + a] += part * yy[b]
                    if a != b:
                        g[low + b] += part * yy[a]
                    hx = part * xx[b]
                    h[low + a, m] += hx
                    if a != b:
                        h[low + b, m] += part * xx[a]
                    h[m, m] += part * xx[a] * xx[b] * (1.0 if a == b else 2.0)
                    g[m] += part * (xx[a] * yy[b] + (0.0 if a == b else xx[b] * yy[a]))
    for a in range(m):
        h[m, a] = h[a, m]
    return h, g


def fit_course(
    offset: FloatArray,
    weight: FloatArray,
    position: FloatArray,
    *,
    rho: FloatArray,
    sigma: FloatArray,
    prior: CoursePrior,
    start: FloatArray,
) -> Course:
    """The course of traces with offsets (n, m) [m], information `weight` (n, m) [1/m^2], expected lanes `position` (n, m)."""
    m = offset.shape[1]
    h, g = _information(offset, weight, position, rho, sigma**2)
    known = prior.known
    matrix, right = np.zeros((m + 2, m + 2)), np.zeros(m + 2)
    matrix[: m + 1, : m + 1], right[: m + 1] = h, g
    matrix[m, m] += 1 / prior.width_sd**2
    right[m] += prior.width / prior.width_sd**2
    rows = np.arange(m - 2)
    second = np.zeros((m - 2, m))
    second[rows, rows], second[rows, rows + 1], second[rows, rows + 2] = 1.0, -2.0, 1.0
    scale = KINK_SCALE * prior.spacing
    d, shift = start, start_shift(start, prior)
    for _ in range(KINK_ROUNDS):
        stiff = 1 / (scale * np.maximum(np.abs(second @ d), SMALLEST_KINK * scale))
        binding = known / (1 + ((d - shift) / MOVED_M) ** 2)
        full = matrix.copy()
        full[np.arange(m), np.arange(m)] += binding
        full[:m, m + 1] -= binding
        full[m + 1, :m] -= binding
        full[m + 1, m + 1] += binding.sum() + _shift_information(shift)
        full[:m, :m] += second.T @ (stiff[:, None] * second)
        solution = np.linalg.solve(full, right)
        d, shift = solution[:m], float(solution[m + 1])
    covariance = np.linalg.inv(full)
    variance = np.diag(covariance)[:m]
    if prior.has_road:
        variance = variance - 2 * covariance[:m, m + 1] + covariance[m + 1, m + 1]
    return Course(
        offset=d,
        sd=np.sqrt(np.maximum(variance, 0)),
        shift=float(solution[m + 1]),
        shift_sd=float(np.sqrt(covariance[m + 1, m + 1])),
        width=float(solution[m]),
        width_sd=float(np.sqrt(covariance[m, m])),
        log_prior=log_prior(d, prior, shift=float(solution[m + 1]), width=float(solution[m])),
    )


def log_prior(offset: FloatArray, prior: CoursePrior, *, shift: float, width: float) -> float:
    """Log prior density of a course, but for a constant."""
    scale = KINK_SCALE * prior.spacing
    kinks = np.maximum(np.abs(np.diff(offset, 2)) - SMALLEST_KINK * scale, 0) / scale
    return float(
        -kinks.sum()
        - 0.5 * (prior.known * MOVED_M**2 * np.log1p(((offset - shift) / MOVED_M) ** 2)).sum()
        + log_shift_prior(shift)
        - 0.5 * ((width - prior.width) / prior.width_sd) ** 2
    )


def log_shift_prior(shift: float) -> float:
    """Log prior density of the common shift [m], but for a constant."""
    return float(np.logaddexp.reduce(_log_shift_parts(shift)))


def _shift_information(shift: float) -> float:
    """Curvature [1/m^2] of the prior about 0: of the part of the mixture that the shift likely is of."""
    parts = _log_shift_parts(shift)
    return float(np.exp(parts - np.logaddexp.reduce(parts)) @ [1 / sd**2 for _, sd in SHIFT_PRIOR])


def _log_shift_parts(shift: float) -> FloatArray:
    return np.array([np.log(p / sd) - 0.5 * (shift / sd) ** 2 for p, sd in SHIFT_PRIOR])


def start_shift(offset: FloatArray, prior: CoursePrior) -> float:
    """The shift [m] at which most of the known road lies under a course; 0 where nothing is known."""
    known = prior.known > max(1e-3, 0.5 * prior.known.max())
    return float(np.median(offset[known])) if known.any() else 0.0


def course_at_start(offset: FloatArray, prior: CoursePrior) -> Course:
    """A first guess as a Course."""
    shift = start_shift(offset, prior)
    return Course(
        offset=offset, sd=np.zeros_like(offset), shift=shift, shift_sd=SHIFT_PRIOR[-1][1], width=prior.width,
        width_sd=prior.width_sd,
        log_prior=log_prior(offset, prior, shift=shift, width=prior.width),
    )  # fmt: skip
