import numpy as np
import pytest

from wzsumo.crowd_mapping.mixture.maps import (
    MixtureSpec,
    driven_lines,
    inside_region,
    samples_inside,
    squares_map,
    stands_for_a_stretch,
    swept_map,
)
from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.crowd_mapping.reference_line import axis_of
from wzsumo.frames import FloatArray
from wzsumo.grid import UNKNOWN, blank_grid
from wzsumo.road import Road

STRAIGHT = axis_of(np.array([[0.0, 0.0], [240.0, 0.0]]))


def mixture_of_normals(weights: FloatArray, means: FloatArray, covariances: FloatArray) -> Mixture:
    return Mixture(
        weights=weights, means=means, covariances=covariances, log_likelihood=0.0, n_points=1000, converged=True
    )  # fmt: skip


def one_normal(mean: tuple[float, float], covariance: FloatArray) -> Mixture:
    return mixture_of_normals(np.ones(1), np.array([mean]), covariance[None])


def arc(radius: float, length: float) -> Road:
    """An axis along a circle about (0, radius) that begins at the origin."""
    turn = np.linspace(0, length / radius, 400)
    return axis_of(np.column_stack([radius * np.sin(turn), radius * (1 - np.cos(turn))]))


def test_numbers_of_the_paper_are_the_defaults() -> None:
    spec = MixtureSpec()
    assert (spec.n_samples, spec.mass_share, spec.criterion) == (5000, 0.95, "bic")
    assert (spec.literal_square_m, spec.square_m) == (5 * 0.0254, 5 * 0.3048)
    assert (spec.k_max, spec.least_sd_m, spec.driver_sd_m, spec.copies) == (None, 0.05, 0.25, 0)


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_region_of_one_component_holds_its_share_of_the_samples(share: float) -> None:
    one = one_normal((3.0, -1.0), np.array([[4.0, 1.5], [1.5, 1.0]]))
    # The standard error of a share of 100,000 is 0.16 % at most.
    assert inside_region(one, one.sample(100_000, seed=1), mass_share=share).mean() == pytest.approx(share, abs=0.006)


def test_region_ends_2_45_standard_deviations_from_the_middle_of_any_component() -> None:
    two = mixture_of_normals(np.array([0.999, 0.001]), np.array([[0.0, 0.0], [50.0, 0.0]]), np.tile(np.eye(2), (2, 1, 1)))
    # sqrt(-2 log 0.05) = 2.4477
    points = [(2.44, 0), (2.46, 0), (0, -2.44), (50, 2.44), (50, 2.46), (25, 0)]
    assert inside_region(two, points, mass_share=0.95).tolist() == [True, False, True, True, False, False]


def test_samples_are_as_many_as_asked_for_and_inside_the_region() -> None:
    one = one_normal((0.0, 0.0), np.diag([100.0, 1.0]))
    samples = samples_inside(one, spec=MixtureSpec(n_samples=700), seed=3)
    assert samples.shape == (700, 2)
    assert inside_region(one, samples, mass_share=0.95).all()
    assert np.hypot(*(samples / (10.0, 1.0)).T).max() > 2.2


def test_square_covers_the_cells_whose_centre_it_holds() -> None:
    cells = blank_grid((0.0, 0.0, 5.0, 5.0), resolution=0.5, p_occupied=0.5)
    grid = squares_map(np.array([[2.3, 2.8]]), side_m=1.5, grid=cells)
    x, y = cells.centre_of(*np.indices(cells.shape)).transpose(2, 0, 1)
    inside = (np.abs(x - 2.3) < 0.75) & (np.abs(y - 2.8) < 0.75)
    np.testing.assert_array_equal(grid.p_occupied, np.where(inside, 0.0, 1.0))


def test_square_smaller_than_a_cell_covers_the_cell_of_its_sample() -> None:
    cells = blank_grid((0.0, 0.0, 5.0, 5.0), resolution=0.5, p_occupied=0.5)
    free = squares_map(np.array([[1.01, 2.49], [99.0, 99.0], [-3.0, 1.0]]), side_m=0.127, grid=cells).free
    assert free.sum() == 1
    assert free[cells.cell_of(np.array([[1.01, 2.49]]))].all()


def test_line_of_a_component_is_as_long_as_the_uniform_stretch_of_the_same_variance() -> None:
    # 60 m uniform along 30 degrees: variance 60^2 / 12 along, 0.2^2 across.
    turn = np.deg2rad(30)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    (line,), _ = driven_lines(one_normal((5.0, 7.0), axes @ np.diag([60**2 / 12, 0.04]) @ axes.T))
    assert np.hypot(*(line[1] - line[0])) == pytest.approx(60)
    assert line.mean(axis=0) == pytest.approx([5, 7])
    assert (line[1] - line[0]) @ axes[:, 1] == pytest.approx(0, abs=1e-9)


def test_broad_component_of_a_few_strays_is_neither_swept_nor_a_guide() -> None:
    # Two stretches of lane of 120 m with half of the fixes each, and 0.3 % of them scattered over 880 x 8 m.
    stretch = np.diag([120**2 / 12, 0.01])
    mixture = mixture_of_normals(
        np.array([0.4985, 0.4985, 0.003]),
        np.array([[60.0, 2.0], [180.0, 2.0], [120.0, 2.0]]),
        np.array([stretch, stretch, np.diag([880**2 / 12, 1.6**2])]),
    )
    assert stands_for_a_stretch(mixture).tolist() == [True, True, False]
    lines, weights = driven_lines(mixture)
    assert (len(lines), weights.tolist()) == (2, [0.4985, 0.4985])
    cells = blank_grid((0.0, -5.0, 240.0, 9.0), resolution=0.25, p_occupied=1.0)
    grid = swept_map(mixture, road=STRAIGHT, half_width_m=0.93, spec=MixtureSpec(), grid=cells)
    y = cells.centre_of(np.arange(cells.shape[0]), np.zeros(cells.shape[0], dtype=int))[:, 1]
    # Half a vehicle and 2.45 standard deviations of the drivers, 0.25 m at least.
    reach = 0.93 + 2.4477 * 0.25
    assert reach - 0.25 < np.abs(y[grid.free.any(axis=1)] - 2.0).max() <= reach
    assert (grid.p_occupied[~grid.free] == UNKNOWN).all()


@pytest.mark.parametrize(("share_of_mean", "stands"), [(0.055, True), (0.045, False)])
def test_component_with_a_twentieth_of_the_mean_fixes_a_metre_stands_for_a_stretch(share_of_mean: float, stands: bool) -> None:
    # Two components of 100 m each: the mean is 1 / 200 of the fixes a metre.
    weight = share_of_mean * 100 / 200
    stretch = np.diag([100**2 / 12, 0.01])
    mixture = mixture_of_normals(
        np.array([1 - weight, weight]), np.array([[50.0, 2.0], [150.0, 2.0]]), np.array([stretch, stretch])
    )
    assert stands_for_a_stretch(mixture).tolist() == [True, stands]


def test_queue_at_a_stop_line_does_not_make_strays_of_the_lanes_beyond() -> None:
    # Twelve components gather 90 % of the fixes on 10 m before a stop line, two the moving vehicles on 300 m.
    queue = np.diag([(10 / 12) ** 2 / 12, 0.01])
    mixture = mixture_of_normals(
        np.array([0.9 / 12] * 12 + [0.05, 0.05]),
        np.array([(i, 2.0) for i in range(12)] + [(85.0, 2.0), (235.0, 2.0)]),
        np.array([queue] * 12 + [np.diag([150**2 / 12, 0.01])] * 2),
    )
    assert stands_for_a_stretch(mixture).all()


def test_stretch_wider_than_drivers_scatter_is_swept_as_wide_as_its_ellipse() -> None:
    cells = blank_grid((40.0, -5.0, 60.0, 5.0), resolution=0.05, p_occupied=1.0)
    wide = one_normal((50.0, 0.0), np.diag([100**2 / 12, 0.6**2]))
    free = swept_map(wide, road=STRAIGHT, half_width_m=0.9, spec=MixtureSpec(), grid=cells).free
    # 2.4477 standard deviations of 0.6 m and half a vehicle, on either side; cells of 5 cm.
    assert free.any(axis=1).sum() * 0.05 == pytest.approx(2 * (2.4477 * 0.6 + 0.9), abs=0.06)


def test_stretch_of_a_bend_is_swept_along_its_arc() -> None:
    # 120 m of a bend of 300 m radius about (0, 300), driven 2 m to the left of its axis: a chord would leave the arc by 6 m.
    radius = 300.0
    mixture = one_normal((90.0, 2.0), np.diag([120**2 / 12, 0.01]))
    cells = blank_grid((-10.0, -10.0, 180.0, 60.0), resolution=0.25, p_occupied=1.0)
    free = swept_map(mixture, road=arc(radius, 180.0), half_width_m=0.93, spec=MixtureSpec(), grid=cells).free
    x, y = cells.centre_of(*np.indices(cells.shape)).transpose(2, 0, 1)
    aside = np.abs(np.hypot(x, y - radius) - (radius - 2.0))
    along = radius * np.arctan2(x, radius - y)
    reach = 0.93 + 2.4477 * 0.25
    assert free[(aside < reach - 0.02) & (np.abs(along - 90) < 60)].all()
    assert aside[free].max() < reach + 0.02


def test_outline_of_a_stretch_follows_a_tight_bend_by_chords_of_5_m() -> None:
    # On a radius of 60 m chords of 5 m leave the arc by 5^2 / (8 * 60) = 0.05 m, such of 10 m by 0.21 m.
    radius = 60.0
    mixture = one_normal((30.0, 0.0), np.diag([40**2 / 12, 0.01]))
    cells = blank_grid((0.0, -3.0, 60.0, 35.0), resolution=0.05, p_occupied=1.0)
    free = swept_map(mixture, road=arc(radius, 90.0), half_width_m=0.93, spec=MixtureSpec(), grid=cells).free
    x, y = cells.centre_of(*np.indices(cells.shape)).transpose(2, 0, 1)
    inward = radius - np.hypot(x, y - radius)
    reach = 0.93 + 2.4477 * 0.25
    assert inward[free].max() == pytest.approx(reach + 0.03, abs=0.05)
