import numpy as np
import pytest
from builders import bent_road, two_lane_road

from wzsumo.crowd_mapping.course.gnss_bias import bias_effect_along, estimate_bias_sd, offsets_from_bias, usual_bias_sd
from wzsumo.crowd_mapping.course.reference_line import axis_of
from wzsumo.frames import FloatArray

STATIONS = np.arange(350.0, 1350.0, 10.0)
ROAD = bent_road(1500)  # 457 m: 2.2 rad in the kilometre of the stations


def bend_effect() -> FloatArray:
    effect = bias_effect_along(ROAD, STATIONS)
    assert effect is not None
    return effect


def offsets_with(biases: FloatArray, *, noise_m: float, seed: int, missing: float = 0.5) -> FloatArray:
    """Offsets of traces that keep to one line of the road, reported with biases (n, 2) [m] along and across."""
    random = np.random.default_rng(seed)
    levels, noise = random.standard_normal((len(biases), 1)), noise_m * random.standard_normal((len(biases), 100))
    rest = biases @ bend_effect().T + levels + noise
    rest[random.random(rest.shape) < missing] = np.nan
    return rest


def test_straight_road_has_no_effect_of_biases() -> None:
    assert bias_effect_along(two_lane_road(), STATIONS) is None


@pytest.mark.parametrize(("turn_rad", "is_bend"), [(0.09, False), (0.12, True)])
def test_road_that_turns_by_a_tenth_of_a_radian_is_a_bend(turn_rad: float, is_bend: bool) -> None:
    angle = np.linspace(0, turn_rad, 100)
    axis = axis_of(5000 * np.column_stack([np.sin(angle), 1 - np.cos(angle)]))
    assert (bias_effect_along(axis, np.linspace(0, axis.length, 50)) is not None) == is_bend


@pytest.mark.parametrize("error_en", [(1.5, 0.0), (0.0, -1.0), (-0.8, 0.6)])
def test_effect_is_what_the_road_makes_of_points_that_are_all_moved_alike(error_en: tuple[float, float]) -> None:
    points = ROAD.to_xy(STATIONS, np.zeros(100))
    _, moved = ROAD.to_sd(points + error_en)
    bearing = np.unwrap(ROAD.heading_at(STATIONS))
    middle = (bearing.min() + bearing.max()) / 2
    along = np.dot(error_en, [np.cos(middle), np.sin(middle)])
    across = np.dot(error_en, [-np.sin(middle), np.cos(middle)])
    # Points moved along a bend of this radius leave it by less than error^2 / 2 R.
    np.testing.assert_allclose(across + bend_effect() @ [along, across], moved, atol=0.02)


def covariance_of(rest: FloatArray, *, noise_m: float) -> FloatArray:
    """Covariance of the known values of one trace: a free level, a random walk of 0.08 m from station to station, noise."""
    at = np.flatnonzero(np.isfinite(rest))
    return np.asarray(1e4 + 0.08**2 * np.minimum.outer(at - at[0], at - at[0]) + noise_m**2 * np.eye(len(at)))


def test_biases_taken_away_are_those_of_generalised_least_squares() -> None:
    rest = offsets_with(1.2 * np.random.default_rng(0).standard_normal((5, 2)), noise_m=0.3, seed=1)
    added = offsets_from_bias(rest, bend_effect(), noise_m=0.3, bias_m=1.2)
    for row, got in zip(rest, added, strict=True):
        known = np.isfinite(row)
        effect, inverse = bend_effect()[known], np.linalg.inv(covariance_of(row, noise_m=0.3))
        bias = np.linalg.solve(effect.T @ inverse @ effect + np.eye(2) / 1.2**2, effect.T @ inverse @ row[known])
        np.testing.assert_allclose(got, bend_effect() @ bias, atol=2e-3)


@pytest.mark.parametrize("bias_m", [0.9, 1.8])
def test_size_of_biases_is_found_and_little_of_them_is_left(bias_m: float) -> None:
    biases = bias_m * np.random.default_rng(2).standard_normal((40, 2))
    rest = offsets_with(biases, noise_m=bias_m / 4, seed=3)
    size = estimate_bias_sd(rest, bend_effect(), noise_m=bias_m / 4, usual_m=1.3, weights=np.ones(40))
    assert size == pytest.approx(bias_m, rel=0.3)
    left = biases @ bend_effect().T - offsets_from_bias(rest, bend_effect(), noise_m=bias_m / 4, bias_m=size)
    # A drift as is usual, which is allowed for, hides the rest.
    assert np.std(left - left.mean(axis=1, keepdims=True)) < 0.35 * np.std(biases @ bend_effect().T)


@pytest.mark.parametrize(("bias_m", "usual_m"), [(0.4, 1.6), (3.0, 1.5), (0.0, 0.5)])
def test_size_of_biases_is_the_likeliest_of_17_with_a_prior_about_the_usual_one(bias_m: float, usual_m: float) -> None:
    rest = offsets_with(bias_m * np.random.default_rng(5).standard_normal((3, 2)), noise_m=0.4, seed=6)
    weights = np.array([1.0, 0.5, 1.0])
    sizes = usual_m * 2.0 ** np.linspace(-2, 2, 17)
    log_posterior = -((np.log(sizes / usual_m) / 0.5) ** 2) / 2
    for row, weight in zip(rest, weights, strict=True):
        known = np.isfinite(row)
        effect, covariance = bend_effect()[known], covariance_of(row, noise_m=0.4)
        for i, size in enumerate(sizes):
            whole = covariance + size**2 * effect @ effect.T
            log_posterior[i] -= weight / 2 * (np.linalg.slogdet(whole)[1] + row[known] @ np.linalg.solve(whole, row[known]))
    size = estimate_bias_sd(rest, bend_effect(), noise_m=0.4, usual_m=usual_m, weights=weights)
    assert size == pytest.approx(sizes[np.argmax(log_posterior)])


def test_no_bias_is_usual_means_none() -> None:
    rest = offsets_with(np.ones((3, 2)), noise_m=0.1, seed=0)
    assert estimate_bias_sd(rest, bend_effect(), noise_m=0.1, usual_m=0.0, weights=np.ones(3)) == 0.0


def test_usual_size_follows_the_scatter_and_not_lanes_or_courses() -> None:
    random = np.random.default_rng(4)
    lanes = 3.6 * (np.arange(100) > random.integers(20, 80, (30, 1)))
    course = np.interp(np.arange(100), [0, 40, 52, 100], [0.0, 0.0, 3.0, 3.0])
    noise = random.standard_normal((30, 100))
    # Four times the white part; 0.12 m of it are the vehicles' own.
    for noise_m in (0.45, 0.2):
        usual = usual_bias_sd(lanes + course + noise_m * noise)
        assert usual == pytest.approx(4 * np.sqrt(noise_m**2 - 0.12**2), rel=0.1)
    assert usual_bias_sd(lanes + course + 0.1 * noise) == 0.0
    assert usual_bias_sd(lanes + course) == 0.0
    assert usual_bias_sd(np.full((2, 100), np.nan)) == 0.0
