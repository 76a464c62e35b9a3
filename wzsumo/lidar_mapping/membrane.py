"""Holes of a surface filled by a membrane: the discrete Laplace equation on the empty cells, by conjugate gradients.

Each cell of the membrane is the mean of its four neighbours (springs of equal stiffness, free at the border of the grid). This
is the fill of Pingel et al. 2013 (their `inpaint_nans` with springs) with another solver. The first guess is the membrane over
coarser cells; the preconditioner is the modified incomplete Cholesky factor without fill-in (Gustafsson 1978).
"""

import numpy as np
import numpy.typing as npt
from numba import njit

from wzsumo.frames import BoolArray, FloatArray

IndexArray = npt.NDArray[np.int32]
FILL_IN_SHARE = 0.97  # share of the dropped fill-in that is moved to the diagonal; Bridson 2015, Fluid Simulation, ch. 5.3
MIN_PIVOT_SHARE = 0.25  # of a diagonal entry; a smaller pivot is replaced by the entry, ibid.
MAX_ITERATIONS = 2000  # of one level; from a coarser level's guess far fewer are needed
RESIDUAL_SHARE = 0.01  # of the tolerance that a residual may have, for the slow modes of wide holes; chosen by us
BLOCK = 4  # cells of a level along each axis that form one cell of the next coarser level; chosen by us


def fill_holes(surface: FloatArray, hole: BoolArray, *, tolerance: float = 1e-4) -> FloatArray:
    """The surface (rows, cols) [m] with the cells of `hole` replaced by the membrane through all other cells.

    Iterates until no hole cell differs from the mean of its neighbours by more than RESIDUAL_SHARE of `tolerance` [m]. Finite
    values of hole cells serve as the first guess. At least one cell must not be a hole.
    """
    filled = np.ascontiguousarray(surface, dtype=np.float64).copy()
    known = ~hole
    if not hole.any():
        return filled
    level = float(np.median(filled[known]))
    filled -= level
    unguessed = hole & ~np.isfinite(filled)
    if unguessed.any():
        filled[unguessed] = _from_coarser(np.where(hole, np.nan, filled), tolerance)[unguessed]
    springs, degree, right_side = _assemble(filled, np.ascontiguousarray(hole))
    stop = np.array([RESIDUAL_SHARE * tolerance, MAX_ITERATIONS])
    filled[hole] = _conjugate_gradients(springs, degree, right_side, np.append(filled[hole], 0.0), stop)[:-1]
    return np.asarray(filled + level)


def _from_coarser(holed: FloatArray, tolerance: float) -> FloatArray:
    """A first guess (rows, cols) for the NaN cells of a surface: the membrane over blocks of its cells, bilinear between them.

    The errors left by a level are only a few of its cells wide, so a hole of a thousand cells takes hardly more iterations than
    one of ten (nested iteration; Briggs, Henson & McCormick 2000, A Multigrid Tutorial, ch. 3).
    """
    known = np.isfinite(holed)
    rows, cols = (-(-n // BLOCK) for n in holed.shape)
    padding = ((0, BLOCK * rows - holed.shape[0]), (0, BLOCK * cols - holed.shape[1]))
    sums, counts = (
        np.pad(values, padding).reshape(rows, BLOCK, cols, BLOCK).sum(axis=(1, 3))
        for values in (np.where(known, holed, 0.0), known)
    )
    coarse = fill_holes(np.where(counts > 0, sums / np.maximum(counts, 1), np.nan), counts == 0, tolerance=tolerance)
    below, above, share = _blocks_around(holed.shape[0])
    between = coarse[below] * (1 - share)[:, None] + coarse[above] * share[:, None]
    before, behind, share = _blocks_around(holed.shape[1])
    return np.asarray(between[:, before] * (1 - share) + between[:, behind] * share)


def _blocks_around(n: int) -> tuple[IndexArray, IndexArray, FloatArray]:
    """For each of n cells: the two blocks whose middles enclose its own, and the weight of the second one."""
    last = -(-n // BLOCK) - 1
    at = np.clip((np.arange(n) + 0.5) / BLOCK - 0.5, 0, last)
    low = at.astype(np.int32)
    return low, np.minimum(low + 1, last).astype(np.int32), at - low


@njit(cache=True, error_model="numpy", nogil=True)
def _assemble(filled: FloatArray, hole: BoolArray) -> tuple[IndexArray, FloatArray, FloatArray]:
    """The equations of n hole cells, in row order: degree * u - sum of u over `springs` = right side.

    `springs` (n, 4) holds the indices of the neighbours above, before, below and behind that are hole cells too; for other
    neighbours the index n of a dummy cell of value 0.
    """
    rows, cols = filled.shape
    n = int(np.sum(hole))
    number = np.full((rows + 2, cols + 2), n, np.int32)
    count = 0
    for row in range(rows):
        for col in range(cols):
            if hole[row, col]:
                number[row + 1, col + 1] = count
                count += 1
    springs = np.empty((n, 4), np.int32)
    degree, right_side = np.ones(n + 1), np.zeros(n + 1)
    for row in range(rows):
        for col in range(cols):
            i = number[row + 1, col + 1]
            if i == n:
                continue
            degree[i] = 0.0
            for side, (down, right) in enumerate(((-1, 0), (0, -1), (1, 0), (0, 1))):
                r, c = row + down, col + right
                springs[i, side] = number[r + 1, c + 1]
                if 0 <= r < rows and 0 <= c < cols:
                    degree[i] += 1.0
                    right_side[i] += 0.0 if hole[r, c] else filled[r, c]
    return springs, degree, right_side


@njit(cache=True, error_model="numpy", nogil=True)
def _factor(springs: IndexArray, degree: FloatArray) -> FloatArray:
    """Inverse diagonal (n + 1,) of the modified incomplete Cholesky factor; its other entries are -pivot."""
    n = len(springs)
    pivot = np.zeros(n + 1)
    for i in range(n):
        kept, dropped = degree[i], 0.0
        for side in range(2):
            j = springs[i, side]
            kept -= pivot[j] ** 2
            if j < n and springs[j, 3 - side] < n:  # the cell before has a neighbour below, the cell above one behind
                dropped += pivot[j] ** 2
        rest = kept - FILL_IN_SHARE * dropped
        pivot[i] = 1.0 / np.sqrt(rest if rest > MIN_PIVOT_SHARE * degree[i] else degree[i])
    return pivot


@njit(cache=True, error_model="numpy", nogil=True)
def _conjugate_gradients(
    springs: IndexArray, degree: FloatArray, right_side: FloatArray, guess: FloatArray, stop: FloatArray
) -> FloatArray:
    """The solution (n + 1,) from a guess; `stop` = largest residual of a cell [m], greatest number of iterations."""
    n, pivot, x = len(springs), _factor(springs, degree), guess.copy()
    residual, z, search = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1)
    image = _multiplied(springs, degree, x)
    for i in range(n):
        residual[i] = right_side[i] - image[i]
    energy = 1.0
    for iteration in range(int(stop[1])):
        worst = 0.0
        for i in range(n):
            worst = max(worst, abs(residual[i]) / degree[i])
        if worst < stop[0]:
            break
        for i in range(n):
            before, above = springs[i, 1], springs[i, 0]
            z[i] = (residual[i] + pivot[above] * z[above] + pivot[before] * z[before]) * pivot[i]
        last_energy, energy = energy, 0.0
        for i in range(n - 1, -1, -1):
            z[i] = (z[i] + pivot[i] * (z[springs[i, 2]] + z[springs[i, 3]])) * pivot[i]
            energy += z[i] * residual[i]
        growth = energy / last_energy if iteration else 0.0
        for i in range(n):
            search[i] = z[i] + growth * search[i]
        image = _multiplied(springs, degree, search)
        bend = 0.0
        for i in range(n):
            bend += search[i] * image[i]
        step = energy / bend
        for i in range(n):
            x[i] += step * search[i]
            residual[i] -= step * image[i]
    return x


@njit(cache=True, error_model="numpy", nogil=True)
def _multiplied(springs: IndexArray, degree: FloatArray, u: FloatArray) -> FloatArray:
    """The left side of the equations, degree * u - sum of u over `springs`."""
    image = np.zeros(u.size)
    for i in range(len(springs)):
        image[i] = degree[i] * u[i] - u[springs[i, 0]] - u[springs[i, 1]] - u[springs[i, 2]] - u[springs[i, 3]]
    return image
