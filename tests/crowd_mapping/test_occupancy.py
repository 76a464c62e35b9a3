import numpy as np
import pytest
from crowd_mapping.lane_values import lane_levels, lane_structure
from crowd_mapping.zone_traces import drive, zone_layout
from scipy.stats import norm

from wzsumo.crowd_mapping.closing.lane_ends import LaneEnds
from wzsumo.crowd_mapping.closing.taper_line import TaperLine
from wzsumo.crowd_mapping.lane_fit import fit_lane_structure
from wzsumo.crowd_mapping.lane_model import LaneStructure, LaneStructureSpec
from wzsumo.crowd_mapping.occupancy import occupancy_grid, p_occupied
from wzsumo.grid import UNKNOWN, blank_grid

NOTHING = np.zeros((2, 2))


def one_lane(n: int, *, noise_m: float = 0.0, covariance: np.ndarray = NOTHING, ends: LaneEnds | None = None) -> LaneStructure:
    """The model of n traces in one lane of 3.6 m, whose edges are at -1.8 and 1.8 m."""
    return lane_structure(lane_levels(np.zeros((n, 100)), n_lanes=1, covariance=covariance), noise_m=noise_m, ends=ends)


def p_at(model: LaneStructure, s: float, *offsets: float) -> np.ndarray:
    return p_occupied(model, np.full(len(offsets), s), np.array(offsets))


def test_edge_of_a_lane_that_is_known_exactly_is_a_normal_distribution_of_6_cm() -> None:
    beyond = np.array([-0.12, -0.06, 0.0, 0.06, 0.12])
    np.testing.assert_allclose(p_at(one_lane(60), 500.0, *(1.8 + beyond)), norm.cdf(beyond / 0.06), atol=1e-6)
    np.testing.assert_allclose(p_at(one_lane(60), 500.0, *(-1.8 - beyond)), norm.cdf(beyond / 0.06), atol=1e-6)


def test_edge_is_blurred_by_the_level_and_by_the_course_of_so_many_traces() -> None:
    model = one_lane(60, noise_m=0.4, covariance=np.diag([0.1**2, 0.0]))
    sd = np.sqrt(0.06**2 + 0.1**2 + 0.4**2 / 60)
    np.testing.assert_allclose(p_at(model, 500.0, 1.8 + sd), norm.cdf(1), atol=1e-6)


# One of two lanes used alike is missed by n traces with chance 1/2^n; with odds of 1/2 beforehand it is there with odds of
# 1/2 of that.
@pytest.mark.parametrize(("n", "p"), [(1, 1 - 0.25 / 1.25), (3, 1 - 0.0625 / 1.0625), (20, 1.0)])
def test_lane_beside_the_driven_one_may_be_open_where_few_traces_might_have_missed_it(n: int, p: float) -> None:
    np.testing.assert_allclose(p_at(one_lane(n), 500.0, 2.4, -2.4), p, atol=1e-5)


def test_places_more_than_1_2_m_from_the_driven_lanes_are_unknown() -> None:
    p = p_at(one_lane(20), 500.0, -3.05, -2.95, 2.95, 3.05)
    np.testing.assert_array_equal(p == UNKNOWN, [True, False, False, True])


def test_lane_that_ends_is_open_ahead_of_its_line_and_observed_as_far_as_it_is_open() -> None:
    line = TaperLine(stations=np.array([500.0]), probability=np.ones((3, 1)), lengths=np.array([100.0, 100.0, 100.0]))
    model = one_lane(60, ends=LaneEnds(closing={1: line}, opening={}))
    # The lane's middle is half-way across: the line passes it at 450 m.
    assert p_at(model, 440.0, 3.6)[0] == pytest.approx(0.0, abs=1e-6)
    assert p_at(model, 460.0, 3.6)[0] == pytest.approx(1.0, abs=1e-6)
    assert p_at(model, 600.0, 3.6)[0] == UNKNOWN
    # Its outer edge is at 5.4 m, and nothing is known more than 1.2 m beyond it.
    np.testing.assert_allclose(p_at(model, 300.0, 5.46), norm.cdf(1), atol=1e-6)
    assert p_at(model, 300.0, 6.7)[0] == UNKNOWN


def test_nowhere_driven_is_unknown_and_not_occupied() -> None:
    zone = drive(zone_layout(), 8, seed=2)
    model, s = fit_lane_structure(zone.traces, spec=LaneStructureSpec()), np.array([700.0, 900.0])
    left = np.interp(s, model.table.stations, model.path.course) + model.levels.right + model.levels.width / 2
    assert (p_occupied(model, s, left + 6.0) == UNKNOWN).all()
    assert (p_occupied(model, s, left + 1.0) > 0.9).all()
    assert (p_occupied(model, s, left - 1.8) < 0.05).all()


def test_map_of_cells_equals_the_probability_at_their_middles() -> None:
    zone = drive(zone_layout(bend=True), 12, seed=2)
    model = fit_lane_structure(zone.traces, spec=LaneStructureSpec())
    low_x, low_y, high_x, high_y = zone.drivable.bounds
    grid = occupancy_grid(model, blank_grid((low_x, low_y, high_x, high_y), resolution=0.8, p_occupied=1.0))
    rows, cols = np.nonzero(grid.p_occupied != UNKNOWN)
    exact = p_occupied(model, *model.axis.to_sd(grid.centre_of(rows, cols)))
    # At the border of what was observed a cell may lie on either side, by the table's step.
    both = exact != UNKNOWN
    assert both.mean() > 0.99
    assert np.abs(exact - grid.p_occupied[rows, cols])[both].max() < 0.05
    assert np.abs(exact - grid.p_occupied[rows, cols])[both].mean() < 0.002
