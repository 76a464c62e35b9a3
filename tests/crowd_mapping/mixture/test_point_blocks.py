import numpy as np
import pytest

from wzsumo.crowd_mapping.mixture.point_blocks import block_points


def test_blocks_hold_every_point_once_and_their_boxes_contain_them() -> None:
    points = np.random.default_rng(0).normal(size=(1000, 2)) * (100.0, 3.0) + (5e5, 4e6)
    blocks = block_points(points)
    back = np.column_stack([blocks.x, blocks.y]) @ blocks.axes.T + blocks.centre
    np.testing.assert_allclose(back[np.lexsort(back.T)], points[np.lexsort(points.T)], atol=1e-6)
    block = np.arange(1000) // 128
    for values, axis in ((blocks.x, 0), (blocks.y, 1)):
        assert (np.abs(values - blocks.boxes[block, axis]) <= blocks.boxes[block, axis + 2] + 1e-9).all()


def test_blocks_lie_along_the_principal_axes() -> None:
    s = np.linspace(-100, 100, 500)
    blocks = block_points(np.column_stack([0.6 * s, 0.8 * s]))
    assert np.ptp(blocks.x) == pytest.approx(200)
    assert np.ptp(blocks.y) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("count", "left"), [(3000, 3500), (2000, 2334), (7000, 7000), (9000, 7000)])
def test_subset_takes_every_nth_point_so_that_at_least_the_count_is_left(count: int, left: int) -> None:
    blocks = block_points(np.random.default_rng(0).normal(size=(7000, 2)))
    assert len(blocks.subset(count).x) == left


def test_blocks_are_about_ten_times_as_long_as_wide() -> None:
    # Points that spread alike in both directions.
    blocks = block_points(np.random.default_rng(0).uniform(size=(50_000, 2)))
    length, width = np.median(blocks.boxes[:, 2:], axis=0)
    assert 5 < length / width < 20
