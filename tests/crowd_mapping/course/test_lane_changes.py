import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wzsumo.crowd_mapping.course.lane_changes import relative_lanes
from wzsumo.frames import FloatArray

LENGTHS = (1, 4, 8, 12)  # of a change, in stations


def ramp(t: FloatArray) -> FloatArray:
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def trace(
    stations: int, *, changes: Sequence[tuple[int, int]], bias: float, drift: float, noise: float, seed: int
) -> tuple[FloatArray, FloatArray]:
    """(offsets [m], lanes) of a trace in lanes of 3.5 m that changes by +-1 at stations; its error begins at `bias`."""
    random = np.random.default_rng(seed)
    lanes = sum((side * ramp((np.arange(stations) - at) / 6) for at, side in changes), np.zeros(stations))
    error = bias + np.cumsum(drift * random.standard_normal(stations)) + noise * random.standard_normal(stations)
    return 3.5 * lanes + error, lanes


def lanes_of(
    offsets: FloatArray, *, drift: float, noise: float, bias_effect: FloatArray | None = None, bias: float = 0.0
) -> tuple[FloatArray, float]:
    """(lanes, cost) of one trace; `drift`, `noise` and `bias` are standard deviations [m]."""
    lanes, cost = relative_lanes(
        offsets[None],
        np.full(len(offsets), 3.5),
        drift_variance=drift**2,
        white_variance=noise**2,
        bias_effect=bias_effect,
        bias_variance=bias**2,
    )
    return lanes[0], cost


def path_cost(
    v: FloatArray,
    lanes: FloatArray,
    changes: int,
    drift_variance: float,
    white_variance: float,
    *,
    bias_effect: FloatArray | None = None,
    bias_variance: float = 0.0,
) -> float:
    """Cost of one given sequence of lanes: 8 a change, and the Kalman filter of a drifting offset and a bias, in matrices."""
    seen = np.column_stack([np.ones(len(v)), np.zeros((len(v), 2)) if bias_effect is None else bias_effect])
    bias = bias_variance * np.eye(2)
    mean, cost = np.array([v[0], 0.0, 0.0]), 8.0 * changes
    own = white_variance + seen[0, 1:] @ bias @ seen[0, 1:]
    covariance = np.block([[np.array([[own]]), -(seen[0, 1:] @ bias)[None]], [-(bias @ seen[0, 1:])[:, None], bias]])
    for h, value, lane in zip(seen[1:], v[1:], lanes[1:], strict=True):
        covariance[0, 0] += drift_variance
        spread = h @ covariance @ h + white_variance
        miss = value - 3.5 * lane - h @ mean
        square = miss**2 / spread
        cost += 0.5 * (min(square, 16) + np.log(spread / white_variance))
        gain = covariance @ h / spread * min(1.0, 16 / square)
        mean, covariance = mean + gain * miss, covariance - np.outer(gain, h @ covariance)
    return float(cost)


def changes_in(lanes: FloatArray) -> int:
    """How many changes begin in lanes (stations,), or before the first of them."""
    whole = np.abs(lanes - np.rint(lanes)) < 1e-12
    return int((whole[:-1] & (np.abs(np.diff(lanes)) > 0)).sum() + (not whole[0]))


@pytest.mark.parametrize("bias", [-3.0, 0.0, 2.0])
@pytest.mark.parametrize("changes", [[], [(40, -1)], [(40, 1)], [(20, 1), (90, -1)], [(30, -1), (60, -1)]])
def test_changes_are_found_whatever_the_bias(changes: list[tuple[int, int]], bias: float) -> None:
    v, lanes = trace(140, changes=changes, bias=bias, drift=0.08, noise=0.2, seed=3)
    found, _ = lanes_of(v, drift=0.08, noise=0.2)
    assert np.abs(found - lanes).max() < 0.6
    np.testing.assert_array_equal(np.rint(found[[0, -1]]), np.rint(lanes[[0, -1]]))


@settings(max_examples=15)
@given(seed=st.integers(0, 1000), at=st.integers(3, 20), side=st.sampled_from([-1, 0, 1]))
def test_cost_is_that_of_the_lanes_found_and_hardly_above_the_best_of_all_single_changes(seed: int, at: int, side: int) -> None:
    n = 30
    v, _ = trace(n, changes=[(at, side)] if side else [], bias=0.3, drift=0.05, noise=0.2, seed=seed)
    found, cost = lanes_of(v, drift=0.05, noise=0.2)
    assert cost == pytest.approx(path_cost(v, found, changes_in(found), 0.05**2, 0.2**2), abs=1e-6)
    sequences = [(np.zeros(n), 0)]
    for start, length, sign in itertools.product(range(1 - max(LENGTHS), n), LENGTHS, (-1, 1)):
        if 0 < start + length < n:
            sequences.append((sign * ramp((np.arange(n) - start) / length), 1))
    best = min(path_cost(v, lanes, k, 0.05**2, 0.2**2) for lanes, k in sequences)
    # Each survivor keeps one filter only: a path that would have won later may be dropped where it is behind by a little.
    assert cost <= best + 2.0


def test_cost_counts_an_outlier_as_four_standard_deviations() -> None:
    v, _ = trace(60, changes=[], bias=0.0, drift=0.05, noise=0.2, seed=1)
    v[30] += 1.6
    found, cost = lanes_of(v, drift=0.05, noise=0.2)
    np.testing.assert_array_equal(found, 0.0)
    assert cost == pytest.approx(path_cost(v, found, 0, 0.05**2, 0.2**2), abs=1e-6)


@pytest.mark.parametrize("length", LENGTHS)
def test_change_of_each_length_is_found_as_it_is(length: int) -> None:
    lanes = ramp((np.arange(60) - 25) / length)
    found, _ = lanes_of(3.5 * lanes, drift=0.02, noise=0.05)
    np.testing.assert_allclose(found, lanes, atol=1e-9)


@pytest.mark.parametrize("side", [-1, 1])
def test_three_changes_to_one_side_are_followed(side: int) -> None:
    lanes = side * sum((ramp((np.arange(120) - 15 - 25 * i) / 4) for i in range(3)), np.zeros(120))
    found, _ = lanes_of(3.5 * lanes, drift=0.02, noise=0.05)
    np.testing.assert_allclose(found, lanes, atol=1e-9)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("missed", [1, 2, 3, 4])
def test_trace_that_begins_in_a_change_counts_its_lanes_from_the_nearer_one(missed: int, side: int) -> None:
    v, lanes = trace(80 + missed, changes=[(0, side)], bias=1.0, drift=0.02, noise=0.05, seed=missed)
    found, _ = lanes_of(v[missed:], drift=0.02, noise=0.05)
    assert np.abs(found - (lanes[missed:] - np.rint(lanes[missed]))).max() < 0.15


@pytest.mark.parametrize("seed", range(8))
def test_merge_is_told_from_a_bias_that_turns_on_a_bend(seed: int) -> None:
    random = np.random.default_rng(seed)
    bearing = np.linspace(-1.0, 1.0, 100)
    effect = np.column_stack([-np.sin(bearing), np.cos(bearing) - 1.0])
    v, lanes = trace(100, changes=[(40, -1)] if seed % 2 else [], bias=0.0, drift=0.05, noise=0.4, seed=seed)
    v += effect @ (2.0 * random.standard_normal(2))
    found, cost = lanes_of(v, drift=0.05, noise=0.4, bias_effect=effect, bias=2.0)
    np.testing.assert_array_equal(np.rint(found[[0, -1]]), np.rint(lanes[[0, -1]]))
    twin = path_cost(v, found, changes_in(found), 0.05**2, 0.4**2, bias_effect=effect, bias_variance=2.0**2)
    assert cost == pytest.approx(twin, abs=1e-6)


def test_missing_stations_do_not_hide_a_change() -> None:
    v, _ = trace(140, changes=[(60, -1)], bias=1.0, drift=0.05, noise=0.2, seed=1)
    sparse = np.full(140, np.nan)
    sparse[4::8] = v[4::8]  # a fix every 80 m
    found, _ = lanes_of(sparse, drift=0.05, noise=0.2)
    assert found[30] == 0
    assert found[120] == -1


def test_slow_drift_of_a_whole_lane_is_no_change() -> None:
    found, _ = lanes_of(np.linspace(0, 3.5, 140), drift=0.1, noise=0.2)
    np.testing.assert_array_equal(found, 0.0)
