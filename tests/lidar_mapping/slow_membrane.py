"""The slow twin of the membrane that fills holes."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from wzsumo.frames import BoolArray, FloatArray


def slow_membrane(surface: FloatArray, hole: BoolArray) -> FloatArray:
    """The solution of the membrane's equations by a sparse direct solver."""
    index = np.arange(surface.size).reshape(surface.shape)
    pairs = np.vstack([np.c_[index[:, 1:].ravel(), index[:, :-1].ravel()], np.c_[index[1:].ravel(), index[:-1].ravel()]])
    rows, cols = np.vstack([pairs, pairs[:, ::-1]]).T
    springs = sp.csr_matrix((np.ones(len(rows)), (rows, cols)), shape=(surface.size,) * 2)
    laplacian = sp.csr_matrix(sp.diags(np.asarray(springs.sum(axis=1)).ravel()) - springs)
    flat, empty = np.where(hole, 0.0, surface).ravel(), hole.ravel()
    flat[empty] = spsolve(sp.csc_matrix(laplacian[empty][:, empty]), -laplacian[empty][:, ~empty] @ flat[~empty])
    return np.asarray(flat.reshape(surface.shape))
