import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lidar_mapping.posed_scans import CELLS

from wzsumo.lidar_mapping.devices import DeviceSpec, find_devices, join_devices, with_barrier
from wzsumo.lidar_mapping.votes import Votes, VoteSpec


def votes_with(cells: list[tuple[int, int]], *, top: float = 0.9, scans: int = 9) -> Votes:
    """Votes with hits in the given cells (row, col)."""
    votes = Votes(CELLS, VoteSpec())
    for row, col in cells:
        votes.count[row, col], votes.scans[row, col], votes.height[row, col] = 5, scans, top
    return votes


def test_clusters_of_a_devices_size_that_were_hit_often_are_devices() -> None:
    votes = Votes(CELLS, VoteSpec())
    for (row, col, rows, cols), top, scans in (
        ((20, 40, 2, 2), 0.9, 9),  # a cone
        ((20, 80, 2, 2), 2.1, 9),  # a pole
        ((20, 120, 2, 2), 0.1, 9),  # grass
        ((20, 160, 9, 23), 1.2, 9),  # a car
        ((20, 220, 2, 2), 0.9, 1),  # something that was there once
    ):
        part = np.s_[row : row + rows, col : col + cols]
        votes.count[part], votes.scans[part], votes.height[part] = 5, scans, top
    devices = find_devices(votes, DeviceSpec())
    np.testing.assert_allclose(devices, [[8.2, -5.8]])


@pytest.mark.parametrize(("top", "count"), [(0.34, 0), (0.36, 1), (1.29, 1), (1.31, 0)])
def test_device_is_between_35_cm_and_130_cm_high(top: float, count: int) -> None:
    assert len(find_devices(votes_with([(20, 40)], top=top), DeviceSpec())) == count


@pytest.mark.parametrize(("cells", "count"), [(5, 1), (7, 0)])
def test_device_is_at_most_120_cm_long(cells: int, count: int) -> None:
    run = [(20, 40 + k) for k in range(cells)]  # of 0.2 m
    assert len(find_devices(votes_with(run), DeviceSpec())) == count


@pytest.mark.parametrize(("scans", "count"), [(2, 0), (3, 1)])
def test_device_was_hit_in_three_scans(scans: int, count: int) -> None:
    assert len(find_devices(votes_with([(20, 40)], scans=scans), DeviceSpec())) == count


@pytest.mark.parametrize(("apart", "count"), [(2, 1), (3, 1), (4, 2)])
def test_hits_with_up_to_two_empty_cells_between_them_are_of_one_device(apart: int, count: int) -> None:
    assert len(find_devices(votes_with([(20, 40), (20, 40 + apart)]), DeviceSpec())) == count


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 40))
def test_devices_along_a_line_are_joined_in_their_order(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    along = np.cumsum(rng.uniform(6, 37, n))
    points = np.column_stack([along, 3 + 2 * np.sin(along / 60)])
    order = rng.permutation(n)
    links = join_devices(points[order], max_gap_m=45.0)
    assert {frozenset(order[pair]) for pair in links} == {frozenset((k, k + 1)) for k in range(n - 1)}


@pytest.mark.parametrize(("gap", "links"), [(44.9, 1), (45.1, 0)])
def test_devices_up_to_the_widest_spacing_are_joined(gap: float, links: int) -> None:
    assert len(join_devices(np.array([[0.0, 0.0], [gap, 0.0]]), max_gap_m=DeviceSpec().max_gap_m)) == links


@pytest.mark.parametrize(("half_width_m", "wide"), [(0.1, 0.3), (0.5, 1.0)])
def test_barrier_is_as_wide_as_given_but_wide_enough_to_have_no_diagonal_gaps(half_width_m: float, wide: float) -> None:
    devices = np.array([[10.0, 0.0], [40.0, 0.0]])
    barrier = with_barrier(CELLS, devices, np.array([[0, 1]]), half_width_m=half_width_m)
    assert barrier.p_occupied[:, 100].sum() * 0.2 == pytest.approx(wide, abs=0.11)
    assert barrier.p_occupied[:, 30].sum() == 0


def test_default_devices_are_those_of_the_manual() -> None:
    assert DeviceSpec().model_dump() == {
        "height_m": (0.35, 1.3), "extent_m": 1.2, "scans": 3, "max_gap_m": 45.0, "barrier_half_width_m": 0.2,
    }  # fmt: skip
