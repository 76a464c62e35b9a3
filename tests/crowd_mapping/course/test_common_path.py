import numpy as np
import pytest

from wzsumo.crowd_mapping.course.path_fit import fit_common_path
from wzsumo.crowd_mapping.course.trend_filter import LEAST_KINK_M, REWEIGHTINGS, SETTLED_M, trend_filter


def shifted_course(stations=120):
    return np.interp(np.arange(stations), [0, 50, 61, stations], [0.0, 0.0, -3.0, -3.0])


def family(n, *, seed, bias_sd, merging=0.4):
    """Traces of one course with levels of their own; some merge by a lane to the right somewhere between 10 and 40."""
    random = np.random.default_rng(seed)
    course, rows, merged = shifted_course(), [], []
    for _ in range(n):
        merges = random.random() < merging
        t = np.clip((np.arange(120) - random.uniform(10, 34)) / 7, 0, 1)
        lane = -merges * t * t * (3 - 2 * t)
        rows.append(course + 3.6 * lane + bias_sd * random.standard_normal() + 0.15 * random.standard_normal(120))
        merged.append(merges)
    return np.array(rows), np.array(merged)


@pytest.mark.parametrize("bias_sd", [0.2, 1.0, 2.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_course_and_changes_are_found_beside_biases_of_any_size(bias_sd: float, seed: int) -> None:
    offsets, merged = family(12, seed=seed, bias_sd=bias_sd)
    path = fit_common_path(offsets, width=3.6, weights=np.ones(12))
    error = path.course - shifted_course()
    assert np.std(error) < 0.12
    np.testing.assert_array_equal(np.rint(path.lanes[:, -1]), -merged.astype(float))


def test_merges_are_found_beside_errors_of_2_m_that_turn_on_a_bend() -> None:
    offsets, merged = family(40, seed=2, bias_sd=2.0)
    random = np.random.default_rng(3)
    bearing = np.linspace(-1.25, 1.25, 120)
    bias_effect = np.column_stack([-np.sin(bearing), np.cos(bearing) - 1.0])
    offsets += 0.45 * random.standard_normal(offsets.shape) + 2.0 * random.standard_normal((40, 2)) @ bias_effect.T
    offsets[random.random(offsets.shape) < 0.67] = np.nan
    path = fit_common_path(offsets, width=3.6, weights=np.ones(40), bias_effect=bias_effect)
    np.testing.assert_array_equal(np.rint(path.lanes[:, -1]), -merged.astype(float))
    assert path.errors.bias_m == pytest.approx(2.0, rel=0.3)
    # Taken for drift, the same errors hide merges.
    straight = fit_common_path(offsets, width=3.6, weights=np.ones(40))
    assert (np.rint(straight.lanes[:, -1]) != -merged.astype(float)).any()


def test_change_of_the_first_guess_is_not_taken_for_the_course() -> None:
    # The trace that is tried first merges, all others keep their lane.
    offsets, _ = family(9, seed=4, bias_sd=0.5, merging=0.0)
    merging, _ = family(1, seed=5, bias_sd=0.5, merging=1.0)
    path = fit_common_path(np.vstack([merging, offsets]), width=3.6, weights=np.ones(10))
    np.testing.assert_array_equal(np.rint(path.lanes[:, -1]), [-1.0] + [0.0] * 9)


def test_single_trace_is_its_own_course() -> None:
    offsets, _ = family(1, seed=0, bias_sd=0.0, merging=0.0)
    path = fit_common_path(offsets, width=3.6, weights=np.ones(1))
    np.testing.assert_array_equal(path.lanes, 0.0)
    assert np.std(path.course - shifted_course()) < 0.15


def test_size_of_the_scatter_is_estimated() -> None:
    random = np.random.default_rng(0)
    offsets = random.standard_normal((30, 1)) + 0.4 * random.standard_normal((30, 120))
    path = fit_common_path(offsets, width=3.6, weights=np.ones(30))
    assert path.errors.noise_m == pytest.approx(0.4, rel=0.15)


def test_trend_filter_keeps_a_line_and_finds_its_kink() -> None:
    line = np.interp(np.arange(100), [0, 40, 99], [0.0, 0.0, 6.0])
    noisy = line + 0.1 * np.random.default_rng(0).standard_normal(100)
    smooth = trend_filter(noisy, np.full(100, 1 / 0.1**2), scale=0.02)
    assert np.std(smooth - line) < 0.04
    np.testing.assert_allclose(trend_filter(line, np.full(100, 1e6), scale=0.02), line, atol=1e-3)


def test_trend_filter_bridges_unknown_stations_with_a_line() -> None:
    values, precisions = np.arange(50) * 0.1, np.full(50, 1e4)
    precisions[10:30] = 0.0
    np.testing.assert_allclose(trend_filter(np.where(precisions > 0, values, -99), precisions, scale=0.02), values, atol=1e-3)


def test_trend_filter_equals_reweighted_least_squares_written_out() -> None:
    random = np.random.default_rng(1)
    values = np.abs(np.arange(60) - 30) * 0.3 + 0.1 * random.standard_normal(60)
    precisions = random.uniform(1, 50, 60)
    bends = np.diff(np.eye(60), 2, axis=0)
    stiffness, course = np.full(58, 1 / 0.05**2), values
    for _ in range(REWEIGHTINGS):
        before = course
        course = np.linalg.solve(np.diag(precisions) + bends.T * stiffness @ bends, precisions * values)
        if np.abs(course - before).max() < SETTLED_M:
            break
        stiffness = 1 / (0.05 * np.maximum(np.abs(bends @ course), LEAST_KINK_M))
    np.testing.assert_allclose(trend_filter(values, precisions, scale=0.05), course, atol=1e-6)
