import numpy as np
import pytest

from wzsumo.crowd_mapping.course.trend_filter import trend_filter
from wzsumo.frames import FloatArray


def reweighted_least_squares(values: FloatArray, precisions: FloatArray, *, scale: float) -> tuple[FloatArray, int]:
    """(course, rounds): at most 12 rounds, until nothing moves by 0.5 mm; second differences count as 0.1 mm at least."""
    n = len(values)
    differences = np.diff(np.eye(n), 2, axis=0)
    stiffness, course = np.full(n - 2, 1 / scale**2), values
    for done in range(12):
        before = course
        course = np.linalg.solve(np.diag(precisions) + differences.T * stiffness @ differences, precisions * values)
        if np.abs(course - before).max() < 5e-4:
            return course, done + 1
        stiffness = 1 / (scale * np.maximum(np.abs(differences @ course), 1e-4))
    return course, 12


def test_filter_keeps_a_line_and_finds_its_kink() -> None:
    line = np.interp(np.arange(100), [0, 40, 99], [0.0, 0.0, 6.0])
    noisy = line + 0.1 * np.random.default_rng(0).standard_normal(100)
    smooth = trend_filter(noisy, np.full(100, 1 / 0.1**2), scale=0.02)
    assert np.std(smooth - line) < 0.04
    np.testing.assert_allclose(trend_filter(line, np.full(100, 1e6), scale=0.02), line, atol=1e-3)


def test_filter_bridges_unknown_stations_with_a_line() -> None:
    values, precisions = np.arange(50) * 0.1, np.full(50, 1e4)
    precisions[10:30] = 0.0
    np.testing.assert_allclose(trend_filter(np.where(precisions > 0, values, -99), precisions, scale=0.02), values, atol=1e-3)


@pytest.mark.parametrize(("n", "precision", "all_rounds"), [(60, 30.0, 12), (30, 1e4, 5), (12, 1.0, 6)])
def test_filter_equals_reweighted_least_squares_written_out(n: int, precision: float, all_rounds: int) -> None:
    random = np.random.default_rng(1)
    values = np.abs(np.arange(n) - n // 2) * 0.3 + 0.1 * random.standard_normal(n)
    precisions = np.full(n, precision)
    expected, rounds = reweighted_least_squares(values, precisions, scale=0.05)
    assert abs(rounds - all_rounds) <= 1
    np.testing.assert_allclose(trend_filter(values, precisions, scale=0.05), expected, atol=1e-6)


def test_two_stations_and_stations_without_any_value_stay_as_they_are() -> None:
    assert trend_filter(np.array([1.0, 5.0]), np.ones(2), scale=0.02).tolist() == [1.0, 5.0]
    assert trend_filter(np.array([1.0, 5.0, 2.0]), np.zeros(3), scale=0.02).tolist() == [1.0, 5.0, 2.0]
