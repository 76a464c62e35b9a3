"""The scores of maps in analysis/lane_map against hand counts and a slow twin."""

import numpy as np
import pandas as pd
import pytest
import shapely
from map_scores import calibration_errors, fix_shares, reliability, scores

from wzsumo.grid import OccupancyGrid


def grid_of(p: list[list[float]], *, resolution: float = 1.0) -> OccupancyGrid:
    return OccupancyGrid(p_occupied=np.array(p, dtype=np.float32), resolution=resolution, origin=(0.0, 0.0))


def test_counts_of_a_hand_made_map() -> None:
    grid = grid_of([[0.0, 0.0, 0.9, 0.5], [0.1, 0.3, 0.0, 0.0]])
    fixes = pd.DataFrame({"x_m": [0.5, 2.5, 3.5, 9.0], "y_m": [0.5, 0.5, 0.5, 0.5]})
    figures = scores(grid, shapely.box(0, 0, 4, 1), shapely.box(0, 0, 3, 2), fixes)
    # In the scored columns 0 to 2: free and right are 2 cells, free and wrong 2 (p = .1 and 0), the truth has 3 cells.
    assert figures["precision"] == pytest.approx(2 / 4)
    assert figures["recall"] == pytest.approx(2 / 3)
    assert figures["iou"] == pytest.approx(2 / 5)
    assert figures["fixes_on_free"] == pytest.approx(1 / 4)
    assert figures["fixes_on_occupied"] == pytest.approx(1 / 4)


def test_truth_beyond_the_map_counts_as_missed() -> None:
    figures = scores(
        grid_of([[0.0, 0.0]]), shapely.box(0, 0, 8, 1), shapely.box(0, 0, 8, 1), pd.DataFrame({"x_m": [0.5], "y_m": [0.5]})
    )
    assert figures["recall"] == pytest.approx(2 / 8)
    assert figures["iou"] == pytest.approx(2 / 8)


def test_map_without_free_ground_has_no_precision_and_no_overlap() -> None:
    figures = scores(
        grid_of([[0.9, 0.5]]), shapely.box(0, 0, 2, 1), shapely.box(0, 0, 2, 1), pd.DataFrame({"x_m": [0.5], "y_m": [0.5]})
    )
    assert np.isnan(figures["precision"])
    assert figures["iou"] == 0


def test_counts_equal_a_test_of_every_cell_on_slanting_areas() -> None:
    random = np.random.default_rng(1)
    grid = OccupancyGrid(p_occupied=random.random((90, 120)).astype(np.float32) ** 3, resolution=0.3, origin=(-7.0, 4.0))
    truth = shapely.affinity.rotate(shapely.box(0, 10, 25, 17), 11)
    scored = shapely.affinity.rotate(shapely.box(2, 6, 22, 24), 11)
    figures = scores(grid, truth, scored, pd.DataFrame({"x_m": [0.0], "y_m": [10.0]}))
    row, col = np.indices(grid.shape)
    x, y = grid.origin[0] + (col + 0.5) * 0.3, grid.origin[1] + (row + 0.5) * 0.3
    free = (grid.p_occupied < 0.196) & shapely.contains_xy(scored, x, y)
    hit = (free & shapely.contains_xy(truth, x, y)).sum()
    assert figures["precision"] == pytest.approx(hit / free.sum())
    assert figures["recall"] == pytest.approx(hit * 0.09 / truth.intersection(scored).area)


def test_fixes_beyond_the_map_lie_on_neither() -> None:
    shares = fix_shares(grid_of([[0.0, 0.9]]), pd.DataFrame({"x_m": [0.5, 1.5, -3.0, 0.7], "y_m": [0.5, 0.5, 0.5, 7.0]}))
    assert shares == (0.25, 0.25)


def test_calibration_error_is_the_gap_between_p_and_the_share_of_occupied_cells() -> None:
    p = np.repeat(np.array([0.005, 0.3, 0.72, 0.5], dtype=np.float32), (60, 20, 10, 99))  # 0.5 is unknown and not counted
    occupied = np.zeros(189, dtype=bool)
    occupied[60:70] = True  # half of those with 0.3
    occupied[80:90] = True  # all of those with 0.72
    everywhere, unsure = calibration_errors(reliability(p, occupied))
    assert unsure == pytest.approx((20 * 0.2 + 10 * 0.28) / 30, abs=1e-6)
    assert everywhere == pytest.approx((60 * 0.005 + 20 * 0.2 + 10 * 0.28) / 90, abs=1e-6)


def test_gaps_of_opposite_sign_in_different_bins_do_not_cancel() -> None:
    p = np.repeat(np.array([0.3, 0.7], dtype=np.float32), 10)
    occupied = np.r_[np.ones(10, dtype=bool), np.zeros(10, dtype=bool)]
    assert calibration_errors(reliability(p, occupied))[1] == pytest.approx(0.7, abs=1e-6)


def test_gaps_of_opposite_sign_in_one_bin_cancel_over_maps_of_a_zone_but_not_in_one_map() -> None:
    p = np.full(10, 0.5001, dtype=np.float32)
    wide, narrow = (reliability(p, np.full(10, occupied)) for occupied in (True, False))
    assert calibration_errors(wide)[1] == pytest.approx(0.4999, abs=1e-4)
    assert calibration_errors(wide + narrow)[1] == pytest.approx(0.0, abs=1e-3)
