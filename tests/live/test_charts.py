"""The pieces of the charts against closed forms and slow twins."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from live.streams_of_traces import merges_at, reading, two_lane_map
from scipy.stats import norm

from wzsumo.live.charts.evidence import bounded, likeness
from wzsumo.live.charts.findings import Family
from wzsumo.live.charts.passing_charts import add_passage, first_passing_charts, silence
from wzsumo.live.charts.shape_charts import _pair
from wzsumo.live.charts.thresholds import calibrated_thresholds
from wzsumo.live.ground import ground_of
from wzsumo.live.trace.decoding import draw_ways, error_levels, error_of, first_receivers, levels_of, with_errors
from wzsumo.live.trace.reading import read_trace, walk_of
from wzsumo.live.trace.shape import _filter, steps_of


@given(st.floats(-500, 500))
def test_one_trace_says_at_most_log_of_shares(ratio: float) -> None:
    assert np.log(0.05 / 0.98) - 1e-9 <= bounded(ratio, 0.02) <= np.log(0.95 / 0.02) + 1e-9


@pytest.mark.parametrize("mean", [0.5, 1.0, 2.0])
def test_bounded_evidence_of_a_normal_sample_falls_in_the_mean_without_a_change(mean: float) -> None:
    x, width = np.linspace(-8, 8, 4001), 16 / 4000
    says = np.array([bounded(mean * value - mean**2 / 2, 0.02) for value in x])
    assert np.sum(says * norm.pdf(x)) * width < 0 < np.sum(says * norm.pdf(x - mean)) * width


def test_level_filter_equals_least_squares_with_the_whole_covariance() -> None:
    random = np.random.default_rng(3)
    y, shown = random.standard_normal(12), random.random(12) > 0.3
    noise, walk = 0.4, 0.09
    level, variance = _filter(y, shown, np.zeros(12, dtype=np.int64), noise, walk)
    at = np.flatnonzero(shown[:10])
    # Cells up to number 9: the level at 9 is unknown, earlier ones differ from it by a walk backwards.
    steps = np.minimum.outer(9 - at, 9 - at) * walk + noise * np.eye(len(at))
    weights = np.linalg.solve(steps, np.ones(len(at)))
    assert level[9] == pytest.approx(weights @ y[at] / weights.sum(), rel=1e-4)
    assert variance[9] == pytest.approx(1 / weights.sum(), rel=1e-4)


def test_walk_of_a_random_walk_with_noise_is_the_variance_of_its_steps() -> None:
    random = np.random.default_rng(1)
    found = [
        walk_of(0.2 * random.standard_normal(200).cumsum() + 0.3 * random.standard_normal(200), np.ones(200, dtype=bool), 0.3)
        for _ in range(200)
    ]
    assert np.mean(found) == pytest.approx(0.04, rel=0.15)


def test_an_edge_of_a_trace_is_estimated_within_its_own_deviation() -> None:
    ground = ground_of(two_lane_map())
    z = []
    for number in range(60):
        own = merges_at(number)
        trace = reading(ground, number, lane=lambda s, own=own: own(s) + (s > 1150) / 3.6)  # type: ignore[misc]  # of a lambda with defaults
        ways = draw_ways(ground, trace, walk=0.002, receivers=first_receivers(), seed=number)
        steps = steps_of(ground, trace, ways, usual_walk=0.002, usual_scatter=1.0)
        z.append((steps.estimate[0, 45] - 1.0) / np.sqrt(steps.variance[0, 45]))
    assert abs(np.mean(z)) < 0.5
    assert np.std(z) < 1.2


def test_ways_of_a_clear_trace_change_lanes_where_it_does() -> None:
    ground = ground_of(two_lane_map())
    trace = reading(ground, 4, lane=lambda s: 1.0 - np.clip((s - 300) / 80, 0, 1))
    ways = draw_ways(ground, trace, walk=0.002, receivers=first_receivers(), seed=1)
    assert (ways.places[:, 5] == 3).all()
    assert (ways.places[:, 25] == 0).all()
    assert ways.weights.sum() == pytest.approx(1)
    again = draw_ways(ground, trace, walk=0.002, receivers=first_receivers(), seed=1)
    assert (again.places == ways.places).all()


@pytest.mark.parametrize(
    ("off_m", "closed", "weight"),
    [
        (0.6, [False, True], 1.0),  # less than half a lane: the receiver's
        (3.6, [False, True], 0.0),  # towards the closed lane: it may drive there
        (-3.6, [False, True], 2.0),  # away from it: counts for that too
        (3.6, [False, False], 1.0),
        (-3.6, [False, False], 1.0),
    ],
)
def test_an_error_by_a_lane_towards_closed_ground_says_nothing_of_receivers(
    off_m: float, closed: list[bool], weight: float
) -> None:
    ways = np.zeros((4, 30), dtype=np.int16)
    seen = np.ones(30, dtype=bool)
    levels = error_levels(np.full(30, off_m), seen, ways, np.full(4, 0.25), 3.6, np.array(closed))
    assert levels.sum() == pytest.approx(weight)
    assert levels == pytest.approx(levels[::-1])
    grid = 0.6 * np.arange(-11, 12)
    assert weight == 0 or levels @ np.abs(grid) / levels.sum() == pytest.approx(abs(off_m), abs=0.01)


def test_a_vehicle_does_as_the_one_before_with_a_chance_of_a_half_that_fades_with_the_gap() -> None:
    assert likeness(0.0) == pytest.approx(0.5)
    assert likeness(3.0) == pytest.approx(0.5 / np.e)
    assert likeness(12.0) < 1e-6
    assert likeness(float("nan")) == 0.0


def test_gaps_between_platoons_are_no_silence_but_one_that_is_many_times_longer_is() -> None:
    """Eight vehicles 1.2 s apart, then an exponential gap of 20 s more: of 1,000 gaps the longest is some 7 of them."""
    ground, random = ground_of(two_lane_map()), np.random.default_rng(5)
    trace, charts, now_s, silent = reading(ground, 0, lane=np.zeros_like), first_passing_charts(ground), 0.0, []
    for number in range(8_000):
        now_s += 1.2 if number % 8 else 1.2 + random.exponential(20.0)
        charts = add_passage(charts, replace(trace, end_s=now_s), ground, number=number)
        silent.append(charts.silent)
    assert max(silent) < 14.0
    assert np.mean([one for one in silent if one > 0]) == pytest.approx(1.0, abs=0.15)
    assert silence(charts, now_s + 20.0 * 40) > 20.0


def test_first_receivers_err_by_one_and_a_half_metres() -> None:
    assert error_of(first_receivers()) == pytest.approx(np.sqrt((0.4**2 + 1 + 2.2**2) / 3))
    levels = levels_of(first_receivers(), width=3.6)
    assert levels.sum() == pytest.approx(1)
    assert np.sqrt(levels @ np.square(0.6 * np.arange(-11, 12))) == pytest.approx(1.41, abs=0.05)


@pytest.mark.parametrize("error_m", [0.4, 1.0, 2.0])
def test_receivers_errors_are_learned_although_each_may_be_one_of_the_next_lane(error_m: float) -> None:
    random, receivers = np.random.default_rng(3), first_receivers()
    for number in range(400):
        chances = levels_of(receivers, width=3.6)
        error = random.normal(0.0, error_m)
        levels = [int(np.clip(round(e / 0.6), -11, 11)) + 11 for e in (error, error + 3.6 * random.choice([-1, 1]))]
        parts = chances[levels] / chances[levels].sum()  # that of its own lane, and that of the next one
        seen = np.zeros(23)
        np.add.at(seen, levels, parts)
        receivers = with_errors(receivers, (seen + seen[::-1]) / 2, width=3.6, rate=max(0.02, (number + 5) ** -0.6))
    assert receivers.sum() == pytest.approx(1)
    assert error_of(receivers) == pytest.approx(error_m, rel=0.3)


@pytest.mark.parametrize("off_m", [0.0, 0.25, 0.5, 0.75, 1.0, 1.25])
def test_lane_of_a_trace_is_as_sure_whatever_rest_its_error_leaves_on_the_grid(off_m: float) -> None:
    ground = ground_of(two_lane_map(closed=False))
    s = np.arange(10.0, 1500.0, 25.0)
    trace = read_trace(ground, s, np.full_like(s, 1.8 + off_m), s / 25.0)
    assert trace is not None
    shares = [
        float(np.sum(ways.weights * (ways.places[:, 30] == 0)))
        for ways in (draw_ways(ground, trace, walk=0.002, receivers=np.array([0.5, 0.5, 0.0]), seed=n) for n in range(10))
    ]
    # 0.9 of the receivers err by 0.4 or 1 m, the rest are as at first: odds by the normal densities of off_m and off_m - 3.6.
    sds, parts = np.array([0.4, 1.0, 2.2]), 0.9 * np.array([0.5, 0.5, 0.0]) + 0.1 / 3
    own, other = (float(parts @ (np.exp(-0.5 * (d / sds) ** 2) / sds)) for d in (off_m, off_m - 3.6))
    assert np.mean(shares) == pytest.approx(own / (own + other), abs=0.1)


def test_loudest_pair_equals_a_search_over_all_pairs() -> None:
    random = np.random.default_rng(2)
    evidence, gaps = random.random((2, 2, 6, 15)), np.array([0, 3])
    best = max(
        evidence[c, g, i, a] + evidence[c, g, 5 - i, b]
        for c in range(2) for g in range(2) for i in range(6) for a in range(15) for b in range(a + gaps[g] + 1, 15)
    )  # fmt: skip
    assert _pair(evidence, gaps)[0] == pytest.approx(best)


def test_thresholds_meet_the_budget_of_one_false_alarm_in_20_000_traces() -> None:
    thresholds = calibrated_thresholds()
    assert thresholds.rate_per_trace * len(Family) == pytest.approx(1 / 20_000)
    for family in Family:
        assert thresholds.at(family, 1.0) >= 8.0
        assert (thresholds.sd[family] >= 0).all()
    assert thresholds.false_alarms_per_trace(Family.STEP, 1.0, thresholds.at(Family.STEP, 1.0) + 5) < 1e-6
