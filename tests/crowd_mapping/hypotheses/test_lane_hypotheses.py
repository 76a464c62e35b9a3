from dataclasses import replace

import numpy as np
import pytest

from wzsumo.crowd_mapping.hypotheses.announcement import Announced
from wzsumo.crowd_mapping.hypotheses.change_costs import Evidence
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_hypotheses import likely_hypotheses
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern

STATIONS = 100
CLOSES, OPENS = 40, 90
ANYWHERE = ClosurePrior(stations=10.0 * np.arange(STATIONS), announced=None, merging_m=200.0)


def drivers(n, *, n_open, n_closed, spread, seed, closes=CLOSES):
    """Traces that start in any lane; those in a closed one leave it 1 to 15 stations ahead; one in five changes at will."""
    random = np.random.default_rng(seed)
    first = np.arange(n) % (n_open + n_closed)
    lanes = np.repeat(first[:, None], STATIONS, axis=1)
    for row in lanes:
        for outer in range(n_open + n_closed - 1, n_open - 1, -1):
            end = closes - 16 * (outer - n_open) - random.integers(1, 15)
            row[end:] = np.minimum(row[end:], outer - 1)
        if n_open > 1 and random.random() < 0.2:
            at = random.integers(closes, STATIONS)
            row[at:] += 1 if row[at] == 0 else -1
    levels = 1.0 + 3.6 * first + spread * random.standard_normal(n)
    return Evidence(
        levels=levels, lanes=lanes - first[:, None], weights=np.ones(n), spacing=10.0, width=(3.6, 0.12), usual_spread=spread
    )


@pytest.mark.parametrize(("spread", "n"), [(0.2, 8), (1.0, 30)])
@pytest.mark.parametrize(("n_open", "n_closed"), [(1, 1), (2, 1), (1, 2)])
def test_open_and_closed_lanes_are_told_apart_up_to_an_error_of_1_m(n_open: int, n_closed: int, spread: float, n: int) -> None:
    best = likely_hypotheses(
        drivers(n, n_open=n_open, n_closed=n_closed, spread=spread, seed=3), ANYWHERE, n_open=None, least_closed=0
    )[0]
    assert best.pattern == LanePattern(n_open + n_closed, tuple(range(n_open, n_open + n_closed)))
    assert best.right == pytest.approx(1.0, abs=3 * spread / np.sqrt(n) + 0.1)
    assert best.spread == pytest.approx(spread, rel=0.35)
    # The closure begins where the last vehicle has left: places are tried every 5 stations.
    assert best.closes == pytest.approx(CLOSES, abs=15)


def test_lanes_without_a_closure_are_open_all_along() -> None:
    # Who keeps to two lanes says nothing of a third.
    best = likely_hypotheses(drivers(10, n_open=2, n_closed=0, spread=0.2, seed=1), ANYWHERE, n_open=None, least_closed=0)[0]
    assert best.pattern == LanePattern(2, ())


def test_first_lanes_follow_the_levels_where_they_are_exact() -> None:
    evidence = drivers(12, n_open=2, n_closed=1, spread=0.15, seed=5)
    best = likely_hypotheses(evidence, ANYWHERE, n_open=None, least_closed=0)[0]
    np.testing.assert_array_equal(best.first.argmax(axis=1), np.rint((evidence.levels - 1.0) / 3.6))


def test_known_number_of_open_lanes_is_kept() -> None:
    evidence = drivers(10, n_open=2, n_closed=1, spread=0.2, seed=2)
    assert {fit.pattern.n_open for fit in likely_hypotheses(evidence, ANYWHERE, n_open=3, least_closed=0)} == {3}


def test_likely_hypotheses_differ_and_descend() -> None:
    fits = likely_hypotheses(drivers(5, n_open=2, n_closed=1, spread=1.5, seed=4), ANYWHERE, n_open=None, least_closed=0)
    evidence = [fit.log_evidence for fit in fits]
    assert evidence == sorted(evidence, reverse=True)
    for i, fit in enumerate(fits):
        for other in fits[:i]:
            assert fit.pattern != other.pattern or abs(fit.right - other.right) > 1.7


@pytest.mark.parametrize("n_open", [2, 3])
def test_lanes_are_counted_by_the_ways_that_changes_went_where_levels_overlap(n_open: int) -> None:
    # At 2 m the levels of two lanes and of three look alike; but nobody leaves an outermost lane outwards.
    right = 0
    for seed in range(6):
        random = np.random.default_rng(seed)
        first = random.integers(n_open, size=100)
        lanes = np.repeat(first[:, None], STATIONS, axis=1)
        for row in lanes[::2]:
            ways = [way for way in (-1, 1) if 0 <= row[0] + way < n_open]
            row[random.integers(10, 90) :] += random.choice(ways)
        levels = 3.6 * first + 1.8 * random.standard_normal(100)
        evidence = Evidence(
            levels=levels, lanes=lanes - first[:, None], weights=np.ones(100), spacing=10.0, width=(3.6, 0.12), usual_spread=1.8
        )
        right += likely_hypotheses(evidence, ANYWHERE, n_open=None, least_closed=0)[0].pattern.n_open == n_open
    assert right >= 5


def test_two_of_ten_who_drive_all_along_beside_the_others_have_a_lane_of_their_own() -> None:
    evidence = drivers(10, n_open=1, n_closed=0, spread=0.2, seed=6)
    levels = evidence.levels + np.where(np.arange(10) < 2, 3.6, 0.0)
    best = likely_hypotheses(replace(evidence, levels=levels), ANYWHERE, n_open=None, least_closed=0)[0]
    assert best.pattern == LanePattern(2, ())


def test_two_wide_lanes_are_not_lost_among_more_narrow_ones_where_levels_scatter_by_2_m() -> None:
    # A search that begins with a narrow spread never gets to wide lanes: they looked hopeless after its first rounds.
    fits = likely_hypotheses(drivers(100, n_open=2, n_closed=0, spread=2.0, seed=0), ANYWHERE, n_open=None, least_closed=0)
    assert LanePattern(2, ()) in {fit.pattern for fit in fits}
    assert fits[0].pattern.n_lanes == 2


def test_drivers_who_leave_a_lane_beside_the_work_do_not_move_a_closure_that_is_announced() -> None:
    evidence = drivers(12, n_open=1, n_closed=1, spread=0.2, seed=7)
    lanes = evidence.lanes.copy()
    lanes[[1, 3, 5], :70] = 0  # three of the six who came in the closing lane, 300 m longer than the others
    late = replace(evidence, lanes=lanes, usual_spread=1.0)  # at errors of 1 m, by which lanes are mistaken
    announced = Announced(start=200.0, end=930.0, shoulders=(0.0, 0.0))  # L = 200 m: wholly closed from 400 to 900 m
    fits = [
        likely_hypotheses(late, replace(ANYWHERE, announced=known), n_open=1, least_closed=0)[0] for known in (None, announced)
    ]
    assert fits[0].closes > CLOSES + 15
    assert (fits[1].closes, fits[1].opens) == (pytest.approx(CLOSES, abs=4), pytest.approx(OPENS, abs=4))
