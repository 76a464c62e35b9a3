import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lidar_mapping.slow_membrane import slow_membrane

from wzsumo.lidar_mapping.membrane import fill_holes


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), share=st.floats(0.05, 0.97), rows=st.integers(1, 25), cols=st.integers(2, 25))
def test_filled_holes_equal_direct_solution_of_membrane(seed: int, share: float, rows: int, cols: int) -> None:
    rng = np.random.default_rng(seed)
    hole = rng.random((rows, cols)) < share
    hole[rng.integers(rows), rng.integers(cols)] = False
    surface = np.where(hole, np.nan, rng.normal(100, 3, hole.shape))
    np.testing.assert_allclose(fill_holes(surface, hole), slow_membrane(surface, hole), atol=2e-4)


def test_long_hole_to_a_stray_point_is_filled_with_the_slope_between() -> None:
    """A solver that starts from nothing needs as many steps as the hole is long, and would stop before it is there."""
    surface = np.full((5, 6000), np.nan)
    surface[:, :40], surface[2, -1] = 0.0, 100.0
    filled = fill_holes(surface, np.isnan(surface))
    np.testing.assert_allclose(filled, slow_membrane(surface, np.isnan(surface)), atol=0.02)


def test_wide_hole_in_a_plane_is_filled_with_the_plane() -> None:
    y, x = np.mgrid[:90, :120]
    plane = 500 + 0.1 * x - 0.05 * y
    hole = (x > 10) & (x < 100) & (y > 5) & (y < 80)
    np.testing.assert_allclose(fill_holes(np.where(hole, np.nan, plane), hole), plane, atol=5e-4)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5])
def test_hole_cell_differs_from_the_mean_of_its_neighbours_by_a_hundredth_of_the_tolerance(tolerance: float) -> None:
    rng = np.random.default_rng(1)
    hole = rng.random((60, 70)) < 0.6
    filled = fill_holes(np.where(hole, np.nan, rng.normal(100, 3, hole.shape)), hole, tolerance=tolerance)
    inner = hole[1:-1, 1:-1]
    mean = (filled[:-2, 1:-1] + filled[2:, 1:-1] + filled[1:-1, :-2] + filled[1:-1, 2:]) / 4
    assert np.abs(filled[1:-1, 1:-1] - mean)[inner].max() < 0.01 * tolerance


def test_surface_without_a_hole_comes_back() -> None:
    surface = np.arange(12.0).reshape(3, 4)
    np.testing.assert_array_equal(fill_holes(surface, np.zeros((3, 4), dtype=bool)), surface)
