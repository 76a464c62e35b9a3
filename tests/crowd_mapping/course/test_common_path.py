import numpy as np
import pytest

from wzsumo.crowd_mapping.course.common_path import CommonPath, TraceErrors, extend_path, lanes_along, without_bias_effect
from wzsumo.crowd_mapping.course.trend_filter import trend_filter

ERRORS = TraceErrors(drift_m=0.05, noise_m=0.2, bias_m=1.0)
STATIONS = np.arange(80)
COURSE = np.interp(STATIONS, [0, 40, 50, 80], [0.0, 0.0, -3.0, -3.0]) + 1.2


def known_path() -> CommonPath:
    return CommonPath(
        course=COURSE - COURSE.mean(), lanes=np.zeros((1, 80)), levels=np.zeros(1), errors=ERRORS, bias_effect=None, cost=7.0
    )


def test_lanes_along_a_course_are_those_that_traces_change_to() -> None:
    merge = -3.6 * np.clip((STATIONS - 20) / 6, 0, 1)
    lanes, _ = lanes_along(COURSE, np.array([COURSE + 1.0, COURSE + merge]), width=3.6, errors=ERRORS, bias_effect=None)
    np.testing.assert_array_equal(lanes[0], 0.0)
    assert lanes[1, [10, 40]].tolist() == [0.0, -1.0]


def test_rest_on_a_straight_road_stays_as_it_is() -> None:
    rest = np.random.default_rng(0).standard_normal((3, 80))
    assert without_bias_effect(rest, errors=ERRORS, bias_effect=None) is rest


def test_extended_path_is_one_round_of_levels_and_course_and_keeps_the_errors() -> None:
    random = np.random.default_rng(1)
    path, weights = known_path(), np.array([1.0, 0.5, 1.0])
    offsets = path.course + np.array([[0.3], [-0.4], [0.1]]) + 0.2 * random.standard_normal((3, 80))
    offsets[0, 50:] = np.nan
    offsets[1, 60] += 5.0
    after = extend_path(path, offsets, np.zeros((3, 80)), width=3.6, weights=weights)
    rest = offsets - path.course
    levels = np.nanmean(rest, axis=1)
    miss = rest - levels[:, None]
    # Values beyond three standard deviations of the noise weigh less; a kink of 0.02 m is one unit of the course's prior.
    w = weights[:, None] * np.minimum(1.0, 3 * 0.2 / np.abs(miss))
    total = np.nansum(w, axis=0)
    course = trend_filter(path.course + np.nansum(w * miss, axis=0) / total, total / 0.2**2, scale=0.02)
    np.testing.assert_allclose(after.course, course - course.mean(), atol=1e-9)
    np.testing.assert_allclose(after.levels, levels + course.mean(), atol=1e-9)
    assert (after.errors, after.cost) == (ERRORS, 7.0)
    assert after.course.mean() == pytest.approx(0, abs=1e-12)
