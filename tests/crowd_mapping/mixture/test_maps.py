import numpy as np
import pytest

from wzsumo.crowd_mapping.course.reference_line import axis_of
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec, driven_lines, stands_for_a_stretch, swept_map
from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.grid import blank_grid

STRAIGHT = axis_of(np.array([[0.0, 0.0], [240.0, 0.0]]))


def test_line_of_a_component_is_as_long_as_the_uniform_stretch_of_the_same_variance() -> None:
    # 60 m uniform along 30 degrees: variance 60^2 / 12 along, 0.2^2 across.
    turn = np.deg2rad(30)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    covariance = axes @ np.diag([60**2 / 12, 0.04]) @ axes.T
    mixture = Mixture(weights=np.ones(1), means=np.array([[5.0, 7.0]]), covariances=covariance[None],
                      log_likelihood=0.0, n_points=1, converged=True)  # fmt: skip
    (line,) = driven_lines(mixture)
    assert np.hypot(*(line[1] - line[0])) == pytest.approx(60)
    assert line.mean(axis=0) == pytest.approx([5, 7])
    assert (line[1] - line[0]) @ axes[:, 1] == pytest.approx(0, abs=1e-9)


def test_broad_component_of_a_few_strays_is_neither_swept_nor_a_guide() -> None:
    # Two stretches of lane of 120 m with half of the fixes each, and 0.3 % of them scattered over 880 x 8 m.
    stretch = np.diag([120**2 / 12, 0.01])
    mixture = Mixture(
        weights=np.array([0.4985, 0.4985, 0.003]), means=np.array([[60.0, 2.0], [180.0, 2.0], [120.0, 2.0]]),
        covariances=np.array([stretch, stretch, np.diag([880**2 / 12, 1.6**2])]),
        log_likelihood=0.0, n_points=1000, converged=True,
    )  # fmt: skip
    assert stands_for_a_stretch(mixture).tolist() == [True, True, False]
    assert len(driven_lines(mixture)) == 2
    cells = blank_grid((0.0, -5.0, 240.0, 9.0), resolution=0.25, p_occupied=1.0)
    free = swept_map(mixture, road=STRAIGHT, half_width_m=0.93, spec=MixtureSpec(), grid=cells).free
    y = cells.centre_of(np.arange(cells.shape[0]), np.zeros(cells.shape[0], dtype=int))[:, 1]
    # Half a vehicle and 2.45 standard deviations of the drivers, 0.25 m at least.
    reach = 0.93 + 2.4477 * 0.25
    assert reach - 0.25 < np.abs(y[free.any(axis=1)] - 2.0).max() <= reach


def test_queue_at_a_stop_line_does_not_make_strays_of_the_lanes_beyond() -> None:
    # Twelve components gather 90 % of the fixes on 10 m before a stop line, two the moving vehicles on 300 m.
    queue = np.diag([(10 / 12) ** 2 / 12, 0.01])
    mixture = Mixture(
        weights=np.array([0.9 / 12] * 12 + [0.05, 0.05]),
        means=np.array([(i, 2.0) for i in range(12)] + [(85.0, 2.0), (235.0, 2.0)]),
        covariances=np.array([queue] * 12 + [np.diag([150**2 / 12, 0.01])] * 2),
        log_likelihood=0.0, n_points=1000, converged=True,
    )  # fmt: skip
    assert stands_for_a_stretch(mixture).all()


def test_stretch_of_a_bend_is_swept_along_its_arc() -> None:
    # 120 m of a bend of 300 m radius about (0, 300), driven 2 m to the left of its axis: a chord would leave the arc by 6 m.
    radius, turn = 300.0, np.linspace(0, 0.6, 200)
    bend = axis_of(np.column_stack([radius * np.sin(turn), radius * (1 - np.cos(turn))]))
    mixture = Mixture(weights=np.ones(1), means=np.array([[90.0, 2.0]]), covariances=np.diag([120**2 / 12, 0.01])[None],
                      log_likelihood=0.0, n_points=1, converged=True)  # fmt: skip
    cells = blank_grid((-10.0, -10.0, 180.0, 60.0), resolution=0.25, p_occupied=1.0)
    free = swept_map(mixture, road=bend, half_width_m=0.93, spec=MixtureSpec(), grid=cells).free
    x, y = cells.centre_of(*np.indices(cells.shape)).transpose(2, 0, 1)
    aside = np.abs(np.hypot(x, y - radius) - (radius - 2.0))
    along = radius * np.arctan2(x, radius - y)
    reach = 0.93 + 2.4477 * 0.25
    assert free[(aside < reach - 0.02) & (np.abs(along - 90) < 60)].all()
    assert aside[free].max() < reach + 0.02
