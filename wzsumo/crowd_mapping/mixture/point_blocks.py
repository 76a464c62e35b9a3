"""PointBlocks: points sorted into blocks of neighbours with bounding boxes.

A sum over points can then leave out, block by block, the components of a mixture that are far away.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from wzsumo.frames import FloatArray

BLOCK_SIZE = 128  # points; the fastest of 32, 64 and 128 by a little (analysis/benchmarks/mixture.py)
BLOCK_LENGTH_TO_WIDTH = 10.0  # blocks are long and narrow, as the components of road traces are; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class PointBlocks:
    """Points sorted into blocks of BLOCK_SIZE neighbours.

    `x`, `y` (n,) [m] are the points' coordinates from their mean `centre` (2,) along their principal axes, the columns of
    `axes` (2, 2): the numbers stay small even in national grids of some 1e6 m. `boxes` (blocks, 4) [m] hold each block's middle
    (x, y) and half extents.
    """

    x: FloatArray
    y: FloatArray
    boxes: FloatArray
    centre: FloatArray
    axes: FloatArray

    def subset(self, count: int) -> "PointBlocks":
        """At least `count` of the points, every n-th of the sorted ones: they are spread evenly over all places."""
        return self.select(slice(None, None, max(1, len(self.x) // count)))

    def select(self, which: slice | npt.NDArray[np.intp]) -> "PointBlocks":
        """Some of the sorted points, in blocks of their own, in the same axes."""
        x, y = np.ascontiguousarray(self.x[which]), np.ascontiguousarray(self.y[which])
        return PointBlocks(x=x, y=y, boxes=_boxes(x, y), centre=self.centre, axes=self.axes)


def block_points(points: FloatArray) -> PointBlocks:
    """Blocks of points (n, 2)."""
    centre = points.mean(axis=0)
    local = points - centre
    axes = np.linalg.eigh(local.T @ local)[1][:, ::-1]
    turned = local @ axes
    # The tree's leaves are boxes of neighbours; its index lists the points leaf by leaf.
    order = np.asarray(cKDTree(turned / (BLOCK_LENGTH_TO_WIDTH, 1.0), leafsize=BLOCK_SIZE, balanced_tree=False).indices)
    x, y = np.ascontiguousarray(turned[order].T)
    return PointBlocks(x=x, y=y, boxes=_boxes(x, y), centre=centre, axes=np.ascontiguousarray(axes))


def _boxes(x: FloatArray, y: FloatArray) -> FloatArray:
    starts = np.arange(0, len(x), BLOCK_SIZE)
    low = np.column_stack([np.minimum.reduceat(x, starts), np.minimum.reduceat(y, starts)])
    high = np.column_stack([np.maximum.reduceat(x, starts), np.maximum.reduceat(y, starts)])
    return np.ascontiguousarray(np.hstack([(low + high) / 2, (high - low) / 2]))
