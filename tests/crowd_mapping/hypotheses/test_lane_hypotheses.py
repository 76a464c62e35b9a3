from dataclasses import replace

import numpy as np
import pytest
from crowd_mapping.lane_values import lane_evidence

from wzsumo.crowd_mapping.hypotheses.announcement import AnnouncedZone
from wzsumo.crowd_mapping.hypotheses.change_likelihood import LaneEvidence
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_hypotheses import LaneHypothesis, likely_hypotheses
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern
from wzsumo.frames import FloatArray

STATIONS = 100
CLOSES, OPENS = 40, 90
ANYWHERE = ClosurePrior(stations=np.arange(0.0, 1000.0, 10.0), announced=None, merging_length_m=200.0)


def hypotheses_of(evidence: LaneEvidence, *, n_open: int | None = None, prior: ClosurePrior = ANYWHERE) -> list[LaneHypothesis]:
    return likely_hypotheses(evidence, prior, n_open=n_open, min_closed=0)


def drivers(n: int, *, n_open: int, n_closed: int, spread: float, seed: int) -> LaneEvidence:
    """Traces that start in any lane; those in a closed one leave it 1 to 15 stations ahead; one in five changes at will."""
    random = np.random.default_rng(seed)
    first = np.arange(n) % (n_open + n_closed)
    lanes = np.repeat(first[:, None], STATIONS, axis=1)
    for row in lanes:
        for outer in range(n_open + n_closed - 1, n_open - 1, -1):
            end = CLOSES - 16 * (outer - n_open) - random.integers(1, 15)
            row[end:] = np.minimum(row[end:], outer - 1)
        if n_open > 1 and random.random() < 0.2:
            at = random.integers(CLOSES, STATIONS)
            row[at:] += 1 if row[at] == 0 else -1
    return lane_evidence(lanes, 1.0 + 3.6 * first + spread * random.standard_normal(n), spread=spread)


def keepers(n_right: int, n_left: int, *, weights: FloatArray | None = None) -> LaneEvidence:
    """Traces that keep to two lanes, 0.1 m to the right and to the left of the lanes' middles in turn."""
    first = np.repeat([0, 1], [n_right, n_left])
    levels = 3.6 * first + np.where(np.arange(len(first)) % 2, 0.1, -0.1)
    return lane_evidence(np.repeat(first[:, None], STATIONS, axis=1), levels, weights=weights)


def evidence_for(pattern: LanePattern, evidence: LaneEvidence) -> float:
    return next(fit.log_evidence for fit in hypotheses_of(evidence) if fit.pattern == pattern)


@pytest.mark.parametrize(("spread", "n"), [(0.2, 8), (1.0, 30)])
@pytest.mark.parametrize(("n_open", "n_closed"), [(1, 1), (2, 1), (1, 2)])
def test_open_and_closed_lanes_are_told_apart_up_to_an_error_of_1_m(n_open: int, n_closed: int, spread: float, n: int) -> None:
    best = hypotheses_of(drivers(n, n_open=n_open, n_closed=n_closed, spread=spread, seed=3))[0]
    assert best.pattern == LanePattern(n_open + n_closed, tuple(range(n_open, n_open + n_closed)))
    assert best.right == pytest.approx(1.0, abs=3 * spread / np.sqrt(n) + 0.1)
    assert best.spread == pytest.approx(spread, rel=0.35)
    # The closure begins where the last vehicle has left: candidates are 5 stations apart.
    assert best.closed_from == pytest.approx(CLOSES, abs=15)


def test_lanes_without_a_closure_are_open_all_along() -> None:
    # Traces that keep to two lanes say nothing of a third.
    assert hypotheses_of(drivers(10, n_open=2, n_closed=0, spread=0.2, seed=1))[0].pattern == LanePattern(2, ())


def test_first_lanes_follow_the_levels_where_they_are_exact() -> None:
    evidence = drivers(12, n_open=2, n_closed=1, spread=0.15, seed=5)
    best = hypotheses_of(evidence)[0]
    np.testing.assert_array_equal(best.first.argmax(axis=1), np.rint((evidence.levels - 1.0) / 3.6))


def test_known_number_of_open_lanes_is_kept() -> None:
    fits = hypotheses_of(drivers(10, n_open=2, n_closed=1, spread=0.2, seed=2), n_open=3)
    assert {fit.pattern.n_open for fit in fits} == {3}


def test_likely_hypotheses_differ_and_descend() -> None:
    fits = hypotheses_of(drivers(5, n_open=2, n_closed=1, spread=1.5, seed=4))
    evidence = [fit.log_evidence for fit in fits]
    assert evidence == sorted(evidence, reverse=True)
    for i, fit in enumerate(fits):
        for other in fits[:i]:
            assert fit.pattern != other.pattern or abs(fit.right - other.right) > 1.7


@pytest.mark.parametrize(("weight", "is_lane"), [(0.5, False), (0.7, True)])
def test_lane_is_none_where_its_traces_add_up_to_less_than_six_tenths(weight: float, is_lane: bool) -> None:
    log_evidence = evidence_for(LanePattern(2, ()), keepers(9, 1, weights=np.append(np.ones(9), weight)))
    assert np.isfinite(log_evidence) == is_lane


def test_lane_of_a_single_faded_trace_remains_a_lane() -> None:
    fit = hypotheses_of(lane_evidence(np.zeros((1, STATIONS), dtype=int), [0.0], weights=np.array([0.3])))[0]
    assert fit.pattern == LanePattern(1, ())
    assert np.isfinite(fit.log_evidence)


def test_open_lanes_that_are_used_alike_are_likelier_than_others_as_three_vehicles_in_each_beforehand_say() -> None:
    two_lanes = LanePattern(2, ())
    alike, apart = (evidence_for(two_lanes, keepers(*counts)) for counts in ((6, 6), (10, 2)))
    # The shares are those of the vehicles and of three in each lane.
    share = np.array([10 + 3, 2 + 3]) / 18
    difference = 12 * np.log(0.5) - np.array([10, 2]) @ np.log(share) - 3 * np.log(2 * share).sum()
    assert alike - apart == pytest.approx(difference, abs=0.02)


def test_hypotheses_are_compared_by_a_hundred_traces_at_most() -> None:
    assert len(hypotheses_of(keepers(80, 70), n_open=2)[0].first) == 100


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
        right += hypotheses_of(lane_evidence(lanes, levels, spread=1.8))[0].pattern.n_open == n_open
    assert right >= 5


def test_two_of_ten_traces_that_drive_all_along_beside_the_others_have_a_lane_of_their_own() -> None:
    evidence = drivers(10, n_open=1, n_closed=0, spread=0.2, seed=6)
    levels = evidence.levels + np.where(np.arange(10) < 2, 3.6, 0.0)
    assert hypotheses_of(replace(evidence, levels=levels))[0].pattern == LanePattern(2, ())


def test_two_wide_lanes_are_not_lost_among_more_narrow_ones_where_levels_scatter_by_2_m() -> None:
    # A search that begins with a narrow spread never gets to wide lanes: they look hopeless after its first rounds.
    fits = hypotheses_of(drivers(100, n_open=2, n_closed=0, spread=2.0, seed=0))
    assert LanePattern(2, ()) in {fit.pattern for fit in fits}
    assert fits[0].pattern.n_lanes == 2


def test_drivers_who_leave_a_lane_beside_the_work_do_not_move_a_closure_that_is_announced() -> None:
    evidence = drivers(12, n_open=1, n_closed=1, spread=0.2, seed=7)
    lanes = evidence.lanes.copy()
    lanes[[1, 3, 5], :70] = 0  # three of the six traces that began in the closing lane stay in it for 300 m longer
    late = replace(evidence, lanes=lanes, usual_spread=1.0)  # at errors of 1 m, by which lanes are mistaken
    # L = 200 m: wholly closed from 400 to 900 m.
    announced = AnnouncedZone(first_device=200.0, last_device=930.0, shoulders_lanes=(0.0, 0.0))
    alone, told = (hypotheses_of(late, n_open=1, prior=replace(ANYWHERE, announced=known))[0] for known in (None, announced))
    assert alone.closed_from > CLOSES + 15
    assert (told.closed_from, told.open_from) == pytest.approx((CLOSES, OPENS), abs=4)
