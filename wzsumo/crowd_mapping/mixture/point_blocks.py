"""PointBlocks: points sorted into blocks of neighbours with bounding boxes, for sums that leave out what is far away."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from wzsumo.frames import FloatArray

BLOCK_SIZE = 128  # points; of 32, 64 and 128 the fastest per iteration by a little (analysis/benchmarks/mixture.py)
ALONG_TO_ACROSS = 10.0  # blocks are made longer than wide, as the components of road traces are


@dataclass(frozen=True, kw_only=True, eq=False)
class PointBlocks:
    """Points sorted into blocks of neighbours, in axes that keep the numbers small.

    `x`, `y` (n,) are coordinates about `centre` (2,) along the columns of `axes` (2, 2), the principal axes of the points;
    `order` (n,) says which given point each one is; `boxes` (blocks, 4) hold middle and half extent of each block.
    """

    x: FloatArray
    y: FloatArray
    boxes: FloatArray
    centre: FloatArray
    axes: FloatArray
    order: npt.NDArray[np.intp]

    def subset(self, count: int) -> "PointBlocks":
        """About `count` of the points, every n-th of the sorted ones: spread evenly over all places."""
        return self.select(slice(None, None, max(1, len(self.x) // count)))

    def select(self, which: slice | npt.NDArray[np.intp]) -> "PointBlocks":
        """Some of the points, in the same axes."""
        x, y = np.ascontiguousarray(self.x[which]), np.ascontiguousarray(self.y[which])
        return PointBlocks(x=x, y=y, boxes=_boxes(x, y), centre=self.centre, axes=self.axes, order=self.order[which])


def block_points(points: FloatArray) -> PointBlocks:
    """Blocks of points (n, 2)."""
    centre = points.mean(axis=0)
    local = points - centre
    axes = np.linalg.eigh(local.T @ local)[1][:, ::-1]
    turned = local @ axes
    # The tree's leaves are boxes of neighbours; its index lists the points leaf by leaf.
    order = np.asarray(cKDTree(turned / (ALONG_TO_ACROSS, 1.0), leafsize=BLOCK_SIZE, balanced_tree=False).indices)
    x, y = np.ascontiguousarray(turned[order].T)
    return PointBlocks(x=x, y=y, boxes=_boxes(x, y), centre=centre, axes=np.ascontiguousarray(axes), order=order)


def _boxes(x: FloatArray, y: FloatArray) -> FloatArray:
    starts = np.arange(0, len(x), BLOCK_SIZE)
    low = np.column_stack([np.minimum.reduceat(x, starts), np.minimum.reduceat(y, starts)])
    high = np.column_stack([np.maximum.reduceat(x, starts), np.maximum.reduceat(y, starts)])
    return np.ascontiguousarray(np.hstack([(low + high) / 2, (high - low) / 2]))
