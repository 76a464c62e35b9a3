import numpy as np
import pytest
from builders import bent_road, two_lane_road

from wzsumo.crowd_mapping.course.gnss_bias import (
    USUAL_DRIFT_M,
    bias_effect_along,
    estimate_bias_sd,
    offsets_from_bias,
    usual_bias_sd,
)

STATIONS = np.arange(350.0, 1350.0, 10.0)
ROAD = bent_road(1500)  # 457 m: 2.2 rad in the kilometre of the stations


def seen(errors, *, noise_m, seed, missing=0.5):
    """Offsets of traces that keep to one line of the road, reported with constant errors (n, 2) [m] along and across."""
    bias_effect = bias_effect_along(ROAD, STATIONS)
    random = np.random.default_rng(seed)
    rest = (
        errors @ bias_effect.T + random.standard_normal((len(errors), 1)) + noise_m * random.standard_normal((len(errors), 100))
    )
    rest[random.random(rest.shape) < missing] = np.nan
    return rest, bias_effect


def test_straight_road_turns_no_errors() -> None:
    assert bias_effect_along(two_lane_road(), STATIONS) is None


@pytest.mark.parametrize("error_en", [(1.5, 0.0), (0.0, -1.0), (-0.8, 0.6)])
def test_turning_is_what_the_road_makes_of_points_that_are_all_moved_alike(error_en) -> None:
    points = ROAD.to_xy(STATIONS, np.zeros(100))
    _, moved = ROAD.to_sd(points + error_en)
    bearing = np.unwrap(ROAD.heading_at(STATIONS))
    middle = (bearing.min() + bearing.max()) / 2
    along = np.dot(error_en, [np.cos(middle), np.sin(middle)])
    across = np.dot(error_en, [-np.sin(middle), np.cos(middle)])
    # Points moved along a bend of this radius leave it by less than error^2 / 2 R.
    np.testing.assert_allclose(across + bias_effect_along(ROAD, STATIONS) @ [along, across], moved, atol=0.02)


def test_errors_taken_away_are_those_of_generalised_least_squares() -> None:
    rest, bias_effect = seen(1.2 * np.random.default_rng(0).standard_normal((5, 2)), noise_m=0.3, seed=1)
    added = offsets_from_bias(rest, bias_effect, noise_m=0.3, bias_m=1.2)
    for row, got in zip(rest, added, strict=True):
        at = np.flatnonzero(np.isfinite(row))
        covariance = 1e4 + USUAL_DRIFT_M**2 * np.minimum.outer(at - at[0], at - at[0]) + 0.3**2 * np.eye(len(at))
        inverse = np.linalg.inv(covariance)
        errors = np.linalg.solve(
            bias_effect[at].T @ inverse @ bias_effect[at] + np.eye(2) / 1.2**2, bias_effect[at].T @ inverse @ row[at]
        )
        np.testing.assert_allclose(got, bias_effect @ errors, atol=2e-3)


@pytest.mark.parametrize("bias_m", [0.9, 1.8])
def test_size_of_errors_is_found_and_little_of_them_is_left(bias_m: float) -> None:
    errors = bias_m * np.random.default_rng(2).standard_normal((40, 2))
    rest, bias_effect = seen(errors, noise_m=bias_m / 4, seed=3)
    size = estimate_bias_sd(rest, bias_effect, noise_m=bias_m / 4, usual_m=1.3, weights=np.ones(40))
    assert size == pytest.approx(bias_m, rel=0.3)
    left = errors @ bias_effect.T - offsets_from_bias(rest, bias_effect, noise_m=bias_m / 4, bias_m=size)
    # A drift as is usual, which is allowed for, hides the rest.
    assert np.std(left - left.mean(axis=1, keepdims=True)) < 0.35 * np.std(errors @ bias_effect.T)


def test_usual_size_follows_the_scatter_and_not_lanes_or_courses() -> None:
    random = np.random.default_rng(4)
    lanes = 3.6 * (np.arange(100) > random.integers(20, 80, (30, 1)))
    course = np.interp(np.arange(100), [0, 40, 52, 100], [0.0, 0.0, 3.0, 3.0])
    offsets = lanes + course + 0.45 * random.standard_normal((30, 100))
    # Four times the white part; 0.12 m of it are the vehicles' own.
    assert usual_bias_sd(offsets) == pytest.approx(4 * np.sqrt(0.45**2 - 0.12**2), rel=0.1)
    assert usual_bias_sd(lanes + course) == 0.0
    assert usual_bias_sd(np.full((2, 100), np.nan)) == 0.0
