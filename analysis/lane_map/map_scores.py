"""How good a map is: precision, recall and IoU of its free cells, its word about its own fixes, and its calibration.

    from map_scores import scores
    scores(grid, case.drivable, case.scored, traces)    # a dict of figures

Counted on the map's own cells inside `scored`; ground of the truth that the map does not cover counts as missed.
"""

import json
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from shapely.geometry.base import BaseGeometry

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import UNKNOWN, OccupancyGrid, cells_inside

FREE = 0.196  # below it a cell is free: default free_thresh of ROS map_server
BIN_EDGES = np.r_[0.01, np.linspace(0.0, 1.0, 21)[1:-1], 0.99]  # of p, for calibration; beyond both ends cells are sure


def scores(grid: OccupancyGrid, drivable: BaseGeometry, scored: BaseGeometry, traces: pd.DataFrame) -> dict[str, Any]:
    """Figures of a map: precision, recall, iou, shares of fixes on free and on occupied cells, calibration errors.

    `ece` is the expected calibration error over all known cells in `scored`, `ece_unsure` over those with 0.01 < p < 0.99;
    `reliability` is the text of what they are made of, each map's cells together as 1, to be summed over maps of a zone.
    """
    window = _window(grid, scored)
    inside = cells_inside(window, scored)
    p, truly = window.p_occupied[inside], cells_inside(window, drivable)[inside]
    free, cell = p < FREE, window.resolution**2
    hit, claimed = float((free & truly).sum() * cell), float(free.sum() * cell)
    there = float(drivable.intersection(scored).area)
    on_free, on_occupied = fix_shares(grid, traces)
    sums = reliability(p, ~truly)
    ece, ece_unsure = calibration_errors(sums)
    return {
        "precision": hit / claimed if claimed else float("nan"),
        "recall": hit / there,
        "iou": hit / (there + claimed - hit),
        "fixes_on_free": on_free,
        "fixes_on_occupied": on_occupied,
        "ece": ece,
        "ece_unsure": ece_unsure,
        "unsure_share": float(sums[0, 1:-1].sum() / len(p)),
        "reliability": json.dumps((sums / max(sums[0].sum(), 1.0)).round(6).tolist()),
    }


def fix_shares(grid: OccupancyGrid, traces: pd.DataFrame) -> tuple[float, float]:
    """Shares of fixes on free cells and on cells with p above 0.5; fixes beyond the map count for neither."""
    points = traces[["x_m", "y_m"]].to_numpy(dtype=float)
    points = points[grid.contains(points)]
    p = grid.p_occupied[grid.cell_of(points)]
    return float((p < FREE).sum() / len(traces)), float((p > UNKNOWN).sum() / len(traces))


def reliability(p: npt.NDArray[np.float32], occupied: BoolArray) -> FloatArray:
    """(number, sum of p, number of occupied ones) (3, bins) of the known cells by bin of p; the outer bins hold sure cells."""
    known = p != UNKNOWN
    bins = np.digitize(p[known], BIN_EDGES)
    weights: tuple[FloatArray | None, ...] = (None, p[known].astype(float), occupied[known].astype(float))
    return np.array([np.bincount(bins, weights=w, minlength=len(BIN_EDGES) + 1) for w in weights])


def calibration_errors(sums: FloatArray) -> tuple[float, float]:
    """Expected calibration error (Guo et al. 2017) over all known cells and over unsure ones, 0.01 < p < 0.99; nan without any.

    `sums` (3, bins) are those of a map, or of several maps of one zone together: an edge that is off by as much as it is said
    to be off is a gap in one map, and none over many.
    """
    count, sum_p, sum_occupied = sums
    gap = np.abs(sum_p - sum_occupied)
    unsure = slice(1, -1)
    return _ratio(gap.sum(), count.sum()), _ratio(gap[unsure].sum(), count[unsure].sum())


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole else float("nan")


def _window(grid: OccupancyGrid, area: BaseGeometry) -> OccupancyGrid:
    """The part of a map around an area."""
    x_min, y_min, x_max, y_max = area.bounds
    row, col = grid.cell_of([[x_min, y_min], [x_max, y_max]])
    rows, cols = (np.clip([index[0], index[1] + 1], 0, size) for index, size in zip((row, col), grid.shape, strict=True))
    if rows[0] == rows[1] or cols[0] == cols[1]:
        raise ValueError("the map does not cover any of the scored area")
    origin = (grid.origin[0] + cols[0] * grid.resolution, grid.origin[1] + rows[0] * grid.resolution)
    part = grid.p_occupied[rows[0] : rows[1], cols[0] : cols[1]]
    return OccupancyGrid(p_occupied=part, resolution=grid.resolution, origin=origin)
