import numpy as np
import pytest
from lidar_mapping.posed_scans import CELLS, cell, posed_scan

from wzsumo.lidar_mapping.slam_map import SlamMapSpec, build_maps
from wzsumo.lidar_mapping.votes import Votes, VoteSpec


@pytest.mark.parametrize(("scans", "log_odds"), [(1, 0.85), (3, 2.55), (9, 3.5)])
def test_hits_add_up_to_their_clamped_log_odds(scans: int, log_odds: float) -> None:
    one = posed_scan([[20.05, 3.05, 0.8]], [True])
    maps = build_maps([one] * scans, SlamMapSpec(), cells=CELLS)
    assert cell(maps.log_odds, 20.05, 3.05) == pytest.approx(1 / (1 + np.exp(-log_odds)), rel=1e-5)


def test_ground_ray_frees_its_low_end_and_nothing_before_or_behind() -> None:
    # From 1.9 m high at x = 1.4 to the ground at x = 39.5: below 0.4 m on its last 4 / 19, from x = 31.48 on.
    maps = build_maps([posed_scan([[39.5, 0.1, 0.0]], [False])], SlamMapSpec(), cells=CELLS)
    row = maps.log_odds.cell_of([[10.0, 0.1]])[0][0]
    seen = np.flatnonzero(maps.log_odds.p_occupied[row] != 0.5)
    x = maps.log_odds.centre_of(row, seen)[:, 0]
    np.testing.assert_allclose([x.min(), x.max()], [31.5, 39.5], atol=0.11)
    assert (np.diff(seen) == 1).all()
    np.testing.assert_allclose(maps.log_odds.p_occupied[row, seen], 1 / (1 + np.exp(0.4)), rtol=1e-5)
    assert (np.delete(maps.log_odds.p_occupied, row, axis=0) == 0.5).all()


def test_hit_overrules_rays_that_pass_its_cell_in_the_same_scan() -> None:
    scan = posed_scan([[20.05, 3.05, 0.5], [20.08, 3.02, 0.0], [22.0, 3.3, 0.0]], [True, False, False])
    assert cell(build_maps([scan], SlamMapSpec(), cells=CELLS).log_odds, 20.05, 3.05) > 0.65


def test_rays_free_a_cell_down_to_the_lower_limit_of_its_log_odds() -> None:
    votes = Votes(CELLS, VoteSpec())
    for scans, log_odds in ((1, -0.4), (2, -0.8), (3, -1.2), (4, -1.6), (5, -2.0), (6, -2.0)):
        votes.add(posed_scan([[20.05, 3.05, 0.0]], [False]))
        assert cell(CELLS.with_p_occupied(votes.p_occupied), 20.05, 3.05) == pytest.approx(1 / (1 + np.exp(-log_odds))), scans


@pytest.mark.parametrize(("range_m", "seen"), [(49.9, True), (50.1, False)])
@pytest.mark.parametrize("standing", [False, True])
def test_returns_beyond_the_range_do_not_vote(range_m: float, seen: bool, standing: bool) -> None:
    votes = Votes(CELLS, VoteSpec(max_range_m=50.0))
    votes.add(posed_scan([[1.4 + range_m, 0.05, 0.0]], [standing]))
    assert np.isfinite(votes.log_odds).any() == seen


@pytest.mark.parametrize(("height_m", "freed"), [(0.39, True), (0.41, False)])
def test_ray_frees_cells_only_below_40_cm(height_m: float, freed: bool) -> None:
    votes = Votes(CELLS, VoteSpec())
    votes.add(posed_scan([[39.5, 0.1, height_m]], [True]))
    assert (votes.log_odds < 0).any() == freed


def test_every_ray_of_a_column_frees_all_cells_on_its_low_end() -> None:
    cloud = np.column_stack([np.arange(12.0, 50.0, 1.7), np.zeros(23) + 0.1, np.zeros(23)])  # from the lowest layer up
    together, one_by_one = Votes(CELLS, VoteSpec()), Votes(CELLS, VoteSpec())
    together.add(posed_scan(cloud, np.zeros(23)))
    for point in cloud:
        one_by_one.add(posed_scan([point], [False]))
    np.testing.assert_array_equal(np.isfinite(together.log_odds), np.isfinite(one_by_one.log_odds))


def test_scans_and_points_of_a_cell_are_counted_and_its_highest_point_kept() -> None:
    votes = Votes(CELLS, VoteSpec())
    for heights in ((0.5, 0.9), (0.7,)):
        votes.add(posed_scan([[20.05, 3.05, z] for z in heights], [True] * len(heights)))
    (row,), (col,) = CELLS.cell_of([[20.05, 3.05]])
    assert (votes.count[row, col], votes.scans[row, col], votes.height[row, col]) == (3, 2, 0.9)
    assert votes.count.sum() == 3


def test_default_votes_are_those_of_octomap() -> None:
    assert VoteSpec().model_dump() == {
        "max_range_m": 60.0, "hit_log_odds": 0.85, "miss_log_odds": -0.4, "log_odds_limits": (-2.0, 3.5), "carve_height_m": 0.4,
    }  # fmt: skip
