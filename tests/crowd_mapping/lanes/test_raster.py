from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from wzsumo.crowd_mapping.lanes.raster import occupancy_grid, p_occupied
from wzsumo.crowd_mapping.reference_line import axis_of
from wzsumo.grid import UNKNOWN, blank_grid
from wzsumo.lane_map import LaneMap, MappedBranch, MappedLane

SD = 0.2


def lane_map(
    *, angle: float = 0.0, p_open: tuple[float, float] = (1.0, 1.0), branches: tuple[MappedBranch, ...] = ()
) -> LaneMap:
    """Two lanes of 3.6 m from 0 to 7.2 m beside a line of 200 m from the origin."""
    line = np.array([[0.0, 0.0], [200 * np.cos(angle), 200 * np.sin(angle)]])
    n = 11
    sd = np.full(n, SD)
    lanes = tuple(
        MappedLane(
            right=np.full(n, 3.6 * k), left=np.full(n, 3.6 * (k + 1)), right_sd=sd, left_sd=sd, p_open=np.full((n, 8), p),
            n_traces=3,
        )
        for k, p in enumerate(p_open)
    )  # fmt: skip
    return LaneMap(
        axis=axis_of(line), stations=np.linspace(0.0, 200.0, n), lanes=lanes, branches=branches, n_traces=6, first_time_s=0.0,
        last_time_s=1.0,
    )  # fmt: skip


def p_at(d: list[float], **made: Any) -> np.ndarray:
    return p_occupied(lane_map(**made), np.full(len(d), 90.0), np.array(d))


def test_lanes_are_free_their_common_line_too_and_an_outer_line_is_a_half() -> None:
    assert p_at([1.8, 3.6, 5.4]) == pytest.approx([0, 0, 0], abs=1e-6)
    assert p_at([0.0, 7.2]) == pytest.approx([0.5, 0.5], abs=1e-6)


def test_outer_line_blurs_as_the_normal_distribution_of_its_place() -> None:
    d = [-0.4, -0.2, -0.1, 0.1, 0.3]
    assert p_at(d) == pytest.approx(1 - norm.cdf(np.array(d) / SD), abs=1e-6)


def test_line_between_an_open_lane_and_a_closed_one_is_a_half() -> None:
    assert p_at([1.8, 3.6, 5.4, 7.2], p_open=(1.0, 0.0)) == pytest.approx([0, 0.5, 1, 1], abs=1e-6)


def test_strips_of_a_taper_are_closed_one_by_one() -> None:
    """The left half of the left lane is closed: ground is free up to its middle at 5.4 m, and a half there."""
    made = lane_map()
    left = made.lanes[1]
    half = replace(left, p_open=np.where(np.arange(8) < 4, 1.0, 0.0) * np.ones_like(left.p_open))
    p = p_occupied(replace(made, lanes=(made.lanes[0], half)), np.full(5, 90.0), np.array([3.6, 4.7, 5.4, 6.1, 7.1]))
    assert p == pytest.approx([0, 0, 0.5, 1, 1], abs=1e-3)


def test_lane_of_which_nothing_is_known_is_a_half_on_all_its_ground() -> None:
    assert p_at([4.6, 5.4, 6.2], p_open=(1.0, 0.5)) == pytest.approx([0.5] * 3, abs=1e-4)


def test_ground_away_from_the_lanes_is_unknown_and_that_beside_them_occupied() -> None:
    assert p_at([-3.0, 10.0]) == pytest.approx([UNKNOWN] * 2)
    assert p_at([-0.9, 8.1]) == pytest.approx([1.0] * 2, abs=1e-4)
    beyond = p_occupied(lane_map(), np.array([-5.0, 205.0]), np.array([1.8, 1.8]))
    assert beyond == pytest.approx([UNKNOWN] * 2)


@pytest.mark.parametrize("angle", [0.0, 0.6, 2.5])
def test_cells_are_the_probabilities_at_their_centres_however_the_road_lies(angle: float) -> None:
    made = lane_map(angle=angle, p_open=(1.0, 0.3))
    end = 200 * np.array([np.cos(angle), np.sin(angle)])
    low, high = np.minimum(0, end) - 12, np.maximum(0, end) + 12
    grid = occupancy_grid(made, blank_grid((*low, *high), resolution=0.5, p_occupied=1.0))
    assert grid.p_occupied.shape[0] > 20
    rows, cols = np.indices(grid.shape)
    s, d = made.axis.to_sd(grid.centre_of(rows.ravel(), cols.ravel()).reshape(-1, 2))
    inside = (s > 5) & (s < 195) & (np.abs(d) < 30)
    expected = p_occupied(made, s[inside], d[inside])
    found = grid.p_occupied.ravel()[inside]
    same = np.abs(found - expected) < 0.02
    assert same.mean() > 0.99  # the table's ends across may be a step apart


def test_branch_is_free_on_its_strip_and_nowhere_else() -> None:
    branch = MappedBranch(line=np.array([[50.0, -8.0], [150.0, -8.0]]), width=np.full(2, 3.0), p_open=0.95, n_traces=3)
    grid = occupancy_grid(lane_map(branches=(branch,)), blank_grid((0, -15, 200, 10), resolution=0.5, p_occupied=1.0))
    p = grid.p_occupied[grid.cell_of(np.array([[100, -8], [100, -6.8], [100, -5.9], [100, -10.1], [40, -8], [100, 1.8]]))]
    assert p == pytest.approx([0.05, 0.05, UNKNOWN, UNKNOWN, UNKNOWN, 0.0], abs=1e-3)
