import numpy as np
import pytest

from wzsumo.planning.footprint import POINT_BODY, outline_body
from wzsumo.planning.lattice import lattice_for, poses_along
from wzsumo.vehicle import VehicleGeometry

BODY = outline_body(VehicleGeometry())


def test_poses_along_arcs_equal_a_fine_integration_of_the_heading() -> None:
    start, segments = np.array([3.0, -2.0, 0.7]), np.array([(5.0, 0.1), (3.0, 0.0), (8.0, -0.2), (0.0, 0.3)])
    poses = poses_along(start, segments, max_step_m=0.5)
    s = np.linspace(0, 16, 160_001)
    ends, curvatures = np.array([5.0, 8.0, 16.0]), np.array([0.1, 0.0, -0.2])
    middle = (s[1:] + s[:-1]) / 2
    curvature = curvatures[np.searchsorted(ends, middle)]
    heading = start[2] + np.concatenate([[0], np.cumsum(curvature * np.diff(s))])
    x = start[0] + np.concatenate([[0], np.cumsum(np.cos((heading[1:] + heading[:-1]) / 2) * np.diff(s))])
    y = start[1] + np.concatenate([[0], np.cumsum(np.sin((heading[1:] + heading[:-1]) / 2) * np.diff(s))])
    at = np.linspace(0, 16, len(poses))
    for column, values in enumerate((x, y, heading)):
        np.testing.assert_allclose(poses[:, column], np.interp(at, s, values), atol=1e-6)


def test_poses_are_spaced_evenly_within_the_largest_step() -> None:
    poses = poses_along(np.zeros(3), np.array([(10.3, 0.0)]), max_step_m=0.48)
    np.testing.assert_allclose(np.diff(poses[:, 0]), 10.3 / 22, atol=1e-12)


def test_full_circle_ends_where_it_began() -> None:
    poses = poses_along(np.array([1.0, 2.0, 0.3]), np.array([(2 * np.pi * 7, 1 / 7)]), max_step_m=0.5)
    np.testing.assert_allclose(poses[-1], poses[0], atol=1e-9)


@pytest.mark.parametrize(("speed_curvature", "step_m"), [(0.02, 4.0), (0.2, 0.35 / 0.17)])
def test_lattice_turns_at_most_20_degrees_a_step_and_checks_to_7_cm(speed_curvature: float, step_m: float) -> None:
    lattice = lattice_for(BODY, max_curvature=speed_curvature, resolution=0.25, fineness=1)
    assert lattice.step_m == pytest.approx(step_m)
    assert lattice.sweep_margin * lattice.sharpest <= 0.07 + 1e-9
    assert np.abs(lattice.curvatures).max() < speed_curvature


def test_lattice_at_10_m_s_has_the_steps_bins_and_costs_that_paths_are_searched_with() -> None:
    lattice = lattice_for(BODY, max_curvature=0.02, resolution=0.25, fineness=1)
    sharpest = 0.017  # 85 % of the limit, for smoothing overshoots by about a tenth
    expected = [0, sharpest, sharpest / 4, sharpest / 16, -sharpest, -sharpest / 4, -sharpest / 16]
    assert lattice.curvatures.tolist() == pytest.approx(expected)
    assert (lattice.step_m, lattice.xy_bin_m) == (4.0, 0.5)
    assert np.rad2deg(lattice.heading_bin) == pytest.approx(0.487, abs=0.001)
    assert lattice.check_m == 1.0  # 3.72 m x 0.017 1/m x 1 m = 6.3 cm swept, below 7 cm
    assert lattice.sweep_margin == pytest.approx(3.72)
    assert (lattice.turn_cost, lattice.change_cost_m) == (0.3, 0.3)
    assert lattice.goal_range_m == pytest.approx(40 + 4 * np.sqrt(3.6 / sharpest))


def test_finer_lattice_halves_steps_checks_and_bins() -> None:
    once, twice = (lattice_for(BODY, max_curvature=0.02, resolution=0.25, fineness=n) for n in (1, 2))
    for name in ("step_m", "check_m", "xy_bin_m", "heading_bin"):
        assert getattr(twice, name) == pytest.approx(getattr(once, name) / 2), name


def test_heading_bins_are_a_tenth_of_a_degree_or_wider() -> None:
    assert lattice_for(BODY, max_curvature=0.0005, resolution=0.25, fineness=1).heading_bin == pytest.approx(np.deg2rad(0.1))


def test_point_is_checked_in_every_cell() -> None:
    assert lattice_for(POINT_BODY, max_curvature=0.02, resolution=0.25, fineness=1).check_m == 0.25
