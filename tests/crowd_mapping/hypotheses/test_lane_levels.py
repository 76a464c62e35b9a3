import numpy as np
import pytest
from crowd_mapping.lane_values import STATIONS, common_path

from wzsumo.crowd_mapping.course.common_path import CommonPath
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels, fit_lane_levels

ANYWHERE = ClosurePrior(stations=STATIONS, announced=None, merging_length_m=200.0)


def likeliest(path: CommonPath, *, width: tuple[float, float] = (3.6, 0.12), n_lanes: int | None = None) -> LaneLevels:
    n = len(path.levels)
    return fit_lane_levels(path, width=width, weights=np.ones(n), closure_prior=ANYWHERE, n_lanes=n_lanes)[0][1]


@pytest.mark.parametrize("outer_sd", [0.03, 0.12])
def test_width_of_a_single_lane_is_known_as_before_the_zone_but_for_a_narrowing_of_8_cm(outer_sd: float) -> None:
    levels = likeliest(common_path(np.zeros((6, 100)), np.zeros(6)), width=(3.6, outer_sd), n_lanes=1)
    assert levels.n_lanes == 1
    assert levels.width == pytest.approx(3.6)
    assert levels.width_sd == pytest.approx(np.hypot(outer_sd, 0.08), rel=1e-6)


# Drivers differ by 0.25 m; 1 cm of drift beyond their own 3 cm lets 20 cm of bias expect, which is averaged with the bias seen
# on bends.
@pytest.mark.parametrize(
    ("drift_m", "bias_m", "spread_m"), [(0.03, 0.0, 0.25), (0.05, 0.0, 0.6185), (0.02, 1.0, 0.75), (0.05, 0.5, 0.7124)]
)
def test_spread_of_a_single_trace_is_what_its_drift_and_its_bias_let_expect(
    drift_m: float, bias_m: float, spread_m: float
) -> None:
    path = common_path(np.zeros((1, 100)), [0.0], drift_m=drift_m, bias_m=bias_m)
    # One of 120 spreads a ratio of 1.037 apart.
    assert likeliest(path).spread == pytest.approx(spread_m, rel=0.04)


# Three traces leave seven hypotheses likely in the first case; in the second six, of which two have 3.2 % and 1.8 %.
@pytest.mark.parametrize(("levels_m", "drift_m", "n_kept"), [([0.0, 3.0, 7.0], 0.08, 5), ([0.0, 3.6, 7.2], 0.05, 4)])
def test_at_most_five_hypotheses_are_kept_and_each_has_more_than_2_percent(
    levels_m: list[float], drift_m: float, n_kept: int
) -> None:
    path = common_path(np.zeros((3, 100)), levels_m, drift_m=drift_m)
    kept = fit_lane_levels(path, width=(3.6, 0.12), weights=np.ones(3), closure_prior=ANYWHERE, n_lanes=None)
    assert len(kept) == n_kept
    assert [chance for chance, _ in kept] == sorted((chance for chance, _ in kept), reverse=True)


def leaving_a_closed_lane(side: int) -> CommonPath:
    """Eight traces of one lane and of one beside it, left (1) or right (-1), which they leave 50 m or more ahead of 400 m."""
    lanes = np.zeros((8, 100))
    lanes[::2, :] = np.where(np.arange(100) < np.array([[20], [25], [30], [35]]), 0, -side)
    return common_path(lanes, np.where(np.arange(8) % 2, 0.0, side * 3.6) + np.tile([0.1, 0.1, -0.1, -0.1], 2))


@pytest.mark.parametrize(("side", "closed"), [(1, (1,)), (-1, (-1,))])
def test_closed_lane_is_found_on_either_side(side: int, closed: tuple[int, ...]) -> None:
    levels = likeliest(leaving_a_closed_lane(side))
    assert (levels.n_lanes, levels.closed, levels.interior) == (1, closed, ())
    assert levels.right == pytest.approx(0.0, abs=0.1)
    np.testing.assert_array_equal(levels.lanes[0, [0, -1]], [side, 0])
    assert levels.closed_from == pytest.approx(40, abs=6)


def test_closure_on_the_right_is_the_mirror_image_of_one_on_the_left() -> None:
    left, right = (likeliest(leaving_a_closed_lane(side)) for side in (1, -1))
    assert right.right == pytest.approx(-left.right)
    assert (right.closed_from, right.open_from) == (left.closed_from, left.open_from)
    np.testing.assert_allclose(right.lanes, -left.lanes)
    assert right.level_sd(0.0) == pytest.approx(left.level_sd(0.0))


def test_core_is_the_middle_of_the_closed_stretch_or_of_all_stations() -> None:
    closed = likeliest(leaving_a_closed_lane(1))
    assert closed.core_station == (closed.closed_from + closed.open_from) // 2
    assert likeliest(common_path(np.zeros((6, 100)), np.zeros(6))).core_station == 50
