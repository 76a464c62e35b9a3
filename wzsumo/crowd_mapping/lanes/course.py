"""The course: how far the lanes lie beside the axis at each station, from all traces at once, with its covariance.

    y_i - w x_i = D + u_i + e_i,    u_i ~ N(0, K_i) Gauss-Markov,    e_i ~ N(0, R_i)

x_i is the expected lane. With W_i = (K_i + R_i)^-1 the information about D is sum W_i; about the lanes' width, sum x_i' W_i x_i. W is
never formed: by Woodbury W v = R^-1 v - R^-1 (K^-1 + R^-1)^-1 R^-1 v, and K^-1 of a Gauss-Markov series is tridiagonal.
D is bent at few places (Laplace prior of its second differences, by reweighting) and lies, outside the zone, at one shift c of
all receivers against the road.
"""

from dataclasses import dataclass

import numba
import numpy as np

from wzsumo.frames import FloatArray

KINK_SCALE = 0.004  # [1]: mean change of direction at a station; a shifting taper of 1:30 begins with 0.033
KINK_ROUNDS = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """`offset` (stations,) [m] of lane 0 from its nominal place, with the common shift; `sd` (stations,) [m] without the shift's.

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
def _information(y, weight, x, rho, sigma2):
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
    spacing: float,
    known: FloatArray | None,
    width: tuple[float, float],
    shift_sd: float,
    start: FloatArray,
) -> Course:
    """The course of traces with offsets (n, m) [m], information `weight` (n, m) [1/m^2] and expected lanes `position` (n, m).

    `known` (m,) [1/m^2] is the information that D lies at the common shift, None where nothing is known of the road; `width` the
    prior mean and sd of a lane's width.
    """
    m = offset.shape[1]
    h, g = _information(offset, weight, position, rho, sigma**2)
    if known is None:
        known = np.full(m, 1e-6)
    matrix, right = np.zeros((m + 2, m + 2)), np.zeros(m + 2)
    matrix[: m + 1, : m + 1], right[: m + 1] = h, g
    matrix[m, m] += 1 / width[1] ** 2
    right[m] += width[0] / width[1] ** 2
    matrix[np.arange(m), np.arange(m)] += known
    matrix[:m, m + 1] -= known
    matrix[m + 1, :m] -= known
    matrix[m + 1, m + 1] += known.sum() + 1 / shift_sd**2
    second = np.zeros((m - 2, m))
    rows = np.arange(m - 2)
    second[rows, rows], second[rows, rows + 1], second[rows, rows + 2] = 1.0, -2.0, 1.0
    scale, least = KINK_SCALE * spacing, 0.1 * KINK_SCALE * spacing
    d = start
    for _ in range(KINK_ROUNDS):
        stiff = 1 / (scale * np.maximum(np.abs(second @ d), least))
        full = matrix.copy()
        full[:m, :m] += second.T @ (stiff[:, None] * second)
        covariance = np.linalg.inv(full)
        solution = covariance @ right
        d = solution[:m]
    along_shift = covariance[:m, m + 1]
    variance = np.diag(covariance)[:m] - 2 * along_shift + covariance[m + 1, m + 1]
    bends = np.abs(second @ d)
    return Course(
        offset=d,
        sd=np.sqrt(np.maximum(variance if known.max() > 1e-3 else np.diag(covariance)[:m], 0)),
        shift=float(solution[m + 1]),
        shift_sd=float(np.sqrt(covariance[m + 1, m + 1])),
        width=float(solution[m]),
        width_sd=float(np.sqrt(covariance[m, m])),
        log_prior=float(-(np.maximum(bends - least, 0) / scale).sum() - 0.5 * (solution[m + 1] / shift_sd) ** 2
                        - 0.5 * ((solution[m] - width[0]) / width[1]) ** 2 - 0.5 * (known * (d - solution[m + 1]) ** 2).sum()),
    )
