"""How well a map tells where one may drive: free cells against the true drivable area."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label
from shapely.geometry.base import BaseGeometry

from wzsumo.frames import BoolArray
from wzsumo.grid import OccupancyGrid, cells_inside


@dataclass(frozen=True, kw_only=True)
class MapQuality:
    """Shares of cells. Precision alone says little: a sliver scores 1."""

    precision: float  # of the cells said to be free, those that are drivable; nan where none is said to be free
    recall: float  # of the drivable cells, those said to be free
    iou: float  # intersection over union of the two
    n_fragments: int  # pieces of the free area that do not touch


def map_quality(grid: OccupancyGrid, *, truth: BaseGeometry, within: BaseGeometry) -> MapQuality:
    """Quality of the free cells of `grid` against the polygon `truth`, counted over cells whose centre lies in `within`."""
    counted = cells_inside(grid, within)
    return quality_of_cells(grid.free, drivable=cells_inside(grid, truth) & counted, counted=counted)


def quality_of_cells(free: BoolArray, *, drivable: BoolArray, counted: BoolArray) -> MapQuality:
    """Quality of free cells (rows, cols) against the `drivable` ones; all lie among the `counted`."""
    said = free & counted
    hit = int((said & drivable).sum())
    n_free, n_drivable = int(said.sum()), int(drivable.sum())
    union = n_free + n_drivable - hit
    return MapQuality(
        precision=hit / n_free if n_free else float("nan"),
        recall=hit / n_drivable if n_drivable else float("nan"),
        iou=hit / union if union else float("nan"),
        n_fragments=int(label(said, structure=np.ones((3, 3)))[1]),
    )
