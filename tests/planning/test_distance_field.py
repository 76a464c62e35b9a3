import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.planning.distance_field import distance_field


def slow_distance_field(blocked: BoolArray, resolution: float, limit_m: float) -> FloatArray:
    """Every cell against every blocked square, those around the map included."""
    rows, cols = blocked.shape
    around = int(limit_m / resolution) + 2
    row, col = np.nonzero(np.pad(blocked, around, constant_values=True))
    own_row, own_col = np.mgrid[:rows, :cols]
    d_row = np.maximum(np.abs(own_row[..., None] - (row - around)) - 0.5, 0)
    d_col = np.maximum(np.abs(own_col[..., None] - (col - around)) - 0.5, 0)
    return np.minimum(np.hypot(d_row, d_col).min(axis=-1) * resolution, limit_m)


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10_000), rows=st.integers(1, 25), cols=st.integers(1, 25), share=st.sampled_from([0.0, 0.02, 0.3, 1.0])
)
def test_distance_field_equals_the_search_over_all_blocked_squares(seed: int, rows: int, cols: int, share: float) -> None:
    blocked = np.random.default_rng(seed).random((rows, cols)) < share
    field = distance_field(blocked.astype(np.float32), max_p_occupied=0.196, resolution=0.3, limit_m=2.0)
    np.testing.assert_allclose(field, slow_distance_field(blocked, 0.3, 2.0), atol=1e-6)


def test_distance_field_lies_within_half_a_diagonal_of_scipys_between_centres() -> None:
    p = (np.random.default_rng(1).random((60, 80)) < 0.01).astype(np.float32)
    field = distance_field(p, max_p_occupied=0.5, resolution=0.25, limit_m=3.0)[15:-15, 15:-15]
    centres = 0.25 * distance_transform_edt(p == 0)[15:-15, 15:-15]
    unclipped = (field < 3.0) & (field > 0)
    short = (centres - field)[unclipped]
    assert short.min() >= 0.125 - 1e-6
    assert short.max() <= 0.125 * np.sqrt(2) + 1e-6


@pytest.mark.parametrize(("p", "blocked"), [(0.195, False), (0.196, True), (0.5, True)])
def test_cell_is_blocked_from_the_threshold_on(p: float, blocked: bool) -> None:
    p_occupied = np.zeros((21, 21), dtype=np.float32)
    p_occupied[10, 10] = p
    field = distance_field(p_occupied, max_p_occupied=0.196, resolution=0.5, limit_m=2.0)
    assert (field[10, 10] == 0) == blocked
