"""Quality of a map: its free cells against the cells that are drivable in truth."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label

from wzsumo.frames import BoolArray


@dataclass(frozen=True, kw_only=True)
class MapQuality:
    """Shares of cells. Precision alone says little: a map with one free cell in the right place has a precision of 1."""

    precision: float  # share of the map's free cells that are drivable; nan where no cell is free
    recall: float  # share of the drivable cells that are free on the map
    iou: float  # intersection over union of the free and the drivable cells
    n_fragments: int  # pieces of the free area that touch neither at a side nor at a corner


def quality_of_cells(free: BoolArray, *, drivable: BoolArray, counted: BoolArray) -> MapQuality:
    """Quality of a map's `free` cells (rows, cols) among the `counted` ones; all `drivable` cells are counted ones."""
    counted_free = free & counted
    n_both = int((counted_free & drivable).sum())
    n_free, n_drivable = int(counted_free.sum()), int(drivable.sum())
    n_union = n_free + n_drivable - n_both
    return MapQuality(
        precision=n_both / n_free if n_free else float("nan"),
        recall=n_both / n_drivable if n_drivable else float("nan"),
        iou=n_both / n_union if n_union else float("nan"),
        n_fragments=int(label(counted_free, structure=np.ones((3, 3)))[1]),
    )
