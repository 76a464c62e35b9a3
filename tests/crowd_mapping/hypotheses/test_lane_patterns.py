import numpy as np
import pytest

from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern, candidate_patterns

ALL_OPEN, LEFT_CLOSED, MIDDLE_CLOSED = LanePattern(3, ()), LanePattern(3, (2,)), LanePattern(3, (1,))


# A further lane: exp(-1). None, one and two closed lanes: 0.3, 0.5 and 0.2. Closed lanes between open ones: 0.1 of others.
@pytest.mark.parametrize(
    ("pattern", "other", "ratio"),
    [
        (ALL_OPEN, LanePattern(2, ()), 0.36788),
        (LEFT_CLOSED, ALL_OPEN, 0.5 / 0.3),
        (LanePattern(3, (1, 2)), ALL_OPEN, 0.2 / 0.3),
        (MIDDLE_CLOSED, LEFT_CLOSED, 0.1),
    ],
)
def test_patterns_differ_in_prior_by_their_lanes_and_by_those_that_are_closed(
    pattern: LanePattern, other: LanePattern, ratio: float
) -> None:
    assert np.exp(pattern.log_prior - other.log_prior) == pytest.approx(ratio, rel=1e-4)


def test_open_lanes_count_three_vehicles_beforehand_and_closed_ones_half_a_vehicle() -> None:
    np.testing.assert_array_equal(LanePattern(4, (1, 2)).pseudocounts, [3.0, 0.5, 0.5, 3.0])


def test_candidates_for_two_open_lanes_close_none_one_or_two_lanes_beside_or_between_them() -> None:
    expected = [LanePattern(2, ()), LEFT_CLOSED, MIDDLE_CLOSED, LanePattern(4, (2, 3)), LanePattern(4, (1, 2))]
    assert candidate_patterns(2, min_closed=0) == expected


def test_candidates_for_the_mirror_image_are_those_that_look_different_in_it() -> None:
    assert candidate_patterns(2, min_closed=1) == [LEFT_CLOSED, LanePattern(4, (2, 3))]


def test_candidates_have_one_to_four_open_lanes_where_their_number_is_not_known() -> None:
    assert {pattern.n_open for pattern in candidate_patterns(None, min_closed=0)} == {1, 2, 3, 4}
