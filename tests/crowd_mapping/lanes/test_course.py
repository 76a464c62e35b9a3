import numpy as np
import pytest

from wzsumo.crowd_mapping.lanes.course import (
    Course,
    CoursePrior,
    _information,
    _shift_information,
    fit_course,
    log_shift_prior,
)
from wzsumo.frames import FloatArray

SPACING = 20.0


def gauss_markov(m: int, *, rho: float, sigma: float) -> FloatArray:
    at = np.arange(m)
    return np.asarray(sigma**2 * rho ** np.abs(at[:, None] - at[None, :]))


def test_information_is_that_of_the_explicit_covariance() -> None:
    """sum W and sum W y with W = (K + R)^-1 on the stations that a trace has, for gaps and traces that begin late."""
    random = np.random.default_rng(3)
    n, m = 4, 12
    weight = random.uniform(0.5, 8.0, (n, m))
    weight[0, 4:6] = 0.0
    weight[1, :5] = 0.0
    weight[2, 7:] = 0.0
    y, x = random.standard_normal((n, m)), random.uniform(0, 2, (n, m))
    rho, sigma = np.array([0.6, 0.9, 0.97, 0.99]), np.array([0.4, 1.0, 2.0, 3.0])
    h, g = np.zeros((m + 1, m + 1)), np.zeros(m + 1)
    for i in range(n):
        at = np.flatnonzero(weight[i])
        covariance = gauss_markov(m, rho=rho[i], sigma=sigma[i])[np.ix_(at, at)] + np.diag(1 / weight[i, at])
        design = np.column_stack([np.eye(m)[at], x[i, at]])
        inverse = np.linalg.inv(covariance)
        h += design.T @ inverse @ design
        g += design.T @ inverse @ y[i, at]
    found_h, found_g = _information(y, weight, x, rho, sigma**2)
    assert found_h == pytest.approx(h, abs=1e-9)
    assert found_g == pytest.approx(g, abs=1e-9)


def prior_of(m: int, *, free: slice = slice(0, 0), width_sd: float = 0.03) -> CoursePrior:
    """A road that is known to 0.1 m, a sixth of a statement a station, but on a free stretch."""
    known = np.full(m, 1 / 6 / 0.1**2)
    known[free] = 1e-6
    return CoursePrior(known=known, width=3.6, width_sd=width_sd, spacing=SPACING)


@pytest.mark.parametrize(("n", "sigma"), [(1, 1.0), (9, 1.5), (50, 2.0)])
def test_shift_of_constant_errors_has_the_sd_of_means_and_prior(n: int, sigma: float) -> None:
    """Errors that are constant along the road: each trace is one measurement of the shift, whose prior sd is 0.7 m."""
    m = 30
    y = np.full((n, m), 0.4)
    course = fit_course(
        y, np.full((n, m), 100.0), np.zeros((n, m)), rho=np.full(n, 0.9999), sigma=np.full(n, sigma), prior=prior_of(m),
        start=np.full(m, 0.4),
    )  # fmt: skip
    information = n / sigma**2
    assert course.shift == pytest.approx(0.4 * information / (information + 1 / 0.7**2), abs=0.04)
    assert course.shift_sd == pytest.approx((information + 1 / 0.7**2) ** -0.5, rel=0.1)
    assert course.width == pytest.approx(3.6, abs=1e-3)


def fitted(seed: int, *, n: int = 15, sigma: float = 0.6, shift: float = 1.2, width: float = 3.4) -> tuple[Course, FloatArray]:
    """(course of traces in two lanes that the work moves by 3 m between 600 and 700 m and back, that movement (60,))."""
    random = np.random.default_rng(seed)
    m = 60
    moved = 3.0 * np.clip((np.arange(m) - 20) / 5, 0, 1) * np.clip((45 - np.arange(m)) / 5, 0, 1)
    rho = 0.9
    root = np.linalg.cholesky(gauss_markov(m, rho=rho, sigma=sigma))
    lane = np.repeat((np.arange(n) % 2)[:, None], m, axis=1).astype(float)
    y = shift + moved + width * lane + random.standard_normal((n, m)) @ root.T + 0.3 * random.standard_normal((n, m))
    course = fit_course(
        y, np.full((n, m), 1 / 0.3**2), lane, rho=np.full(n, rho), sigma=np.full(n, sigma),
        prior=prior_of(m, free=slice(14, 52), width_sd=0.2), start=np.full(m, shift),
    )  # fmt: skip
    return course, moved


def test_course_finds_the_movement_the_shift_and_the_width_within_its_deviations() -> None:
    errors, shifts, widths = [], [], []
    for seed in range(30):
        course, moved = fitted(seed)
        errors.append((course.offset - course.shift - moved) / np.maximum(course.sd, 1e-6))
        shifts.append((course.shift - 1.2) / course.shift_sd)
        widths.append((course.width - 3.4) / course.width_sd)
        assert np.abs(course.offset - course.shift - moved).max() < 0.75
    assert np.mean(np.abs(errors) < 2) > 0.88
    assert np.sqrt(np.mean(np.square(errors))) < 1.5
    # The prior draws the shift and the width towards 0 and 3.6 m, by less than their deviations.
    assert np.mean(np.abs(shifts) < 2) > 0.8
    assert np.mean(np.abs(widths) < 2) > 0.8


def test_deviation_of_the_course_falls_with_more_traces() -> None:
    few, many = fitted(1, n=4)[0], fitted(1, n=64)[0]
    assert np.median(many.sd) < 0.45 * np.median(few.sd)


def test_straight_course_has_no_bends_of_noise() -> None:
    """Without a movement the lanes keep to the road: what bends 30 traces' mean by centimetres is their error."""
    random = np.random.default_rng(8)
    m, n = 60, 30
    root = np.linalg.cholesky(gauss_markov(m, rho=0.9, sigma=0.6))
    y = random.standard_normal((n, m)) @ root.T
    course = fit_course(
        y, np.full((n, m), 10.0), np.zeros((n, m)), rho=np.full(n, 0.9), sigma=np.full(n, 0.6),
        prior=prior_of(m, free=slice(14, 52)), start=np.zeros(m),
    )  # fmt: skip
    assert np.abs(course.offset).max() < 0.25
    assert np.abs(np.diff(course.offset, 2)).max() < 0.03


@pytest.mark.parametrize("shift", [0.3, 1.8, 6.0, 250.0])
def test_weight_of_the_shift_is_the_slope_of_its_prior_over_the_shift(shift: float) -> None:
    step = 1e-4
    slope = (log_shift_prior(shift + step) - log_shift_prior(shift - step)) / (2 * step)
    assert -slope / shift == pytest.approx(_shift_information(shift), rel=1e-4)
