import numpy as np
import numpy.typing as npt
import pytest
from crowd_mapping.lane_values import STATIONS, WIDTH_M, lane_evidence, lane_levels, station_table
from scipy.integrate import quad
from scipy.stats import beta, norm

from wzsumo.crowd_mapping.closing.lane_use import LaneUse, fit_lane_use
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_hypotheses import likely_hypotheses
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern
from wzsumo.frames import FloatArray

LEAVES, RETURNS = 40, 80  # indices of stations


def use_of(lanes: npt.ArrayLike, *, interior: tuple[int, ...] = (), spread: float = 0.2) -> LaneUse:
    """The use of three lanes by traces (n, stations) in known ones."""
    levels = lane_levels(lanes, n_lanes=3, interior=interior, closed_from=LEAVES, open_from=RETURNS, spread=spread)
    return fit_lane_use(station_table(WIDTH_M * levels.lanes), np.ones(len(levels.lanes)), levels, half_vehicle_m=0.93)


def keeper(lane: int) -> FloatArray:
    return np.full(len(STATIONS), float(lane))


def leaver(*, at: int = LEAVES, change: int = 8, returns: int = RETURNS) -> FloatArray:
    """Leaves the middle lane for the left one within `change` stations up to `at`, and comes back."""
    index = np.arange(len(STATIONS))
    return np.asarray(1 + np.clip((index - at + change) / change, 0, 1) - np.clip((index - returns) / change, 0, 1))


def chance_that_nobody_uses_an_open_lane(n: int) -> float:
    """Its share of the traffic is unknown: three vehicles in each of three lanes are counted beforehand."""
    return float(quad(lambda q: beta.pdf(q, 3, 6) * (1 - q) ** n, 0, 1)[0])


def test_lane_that_somebody_drove_all_along_is_open() -> None:
    assert (use_of([keeper(0), keeper(1), keeper(2), leaver()]).open_chance == 1.0).all()


def test_lane_that_everybody_left_at_one_place_is_closed_there_and_open_before() -> None:
    use = use_of([keeper(0)] * 5 + [leaver()] * 5)
    assert use.open_chance[1, LEAVES + 2 : RETURNS].max() < 0.01
    assert (use.open_chance[1, : LEAVES - 8] == 1.0).all()


# Lanes idle for less than 60 m are open: a gap between two vehicles' lane changes.
@pytest.mark.parametrize(("n_stations", "is_open"), [(5, True), (6, False)])
def test_lane_between_one_trace_that_leaves_it_and_one_that_takes_it_is_open_where_the_gap_is_short(
    n_stations: int, is_open: bool
) -> None:
    index = np.arange(len(STATIONS))
    leaves, takes = np.where(index < 30, 1, 2), np.where(index < 30 + n_stations, 0, 1)
    use = use_of([keeper(0)] * 10 + [keeper(2)] * 10 + [leaves, takes])
    assert (use.open_chance == 1.0).all() == is_open


@pytest.mark.parametrize(("n_right", "n_left"), [(2, 1), (6, 6)])
def test_doubt_in_an_idle_lane_is_a_tenth_against_the_chance_that_nobody_happened_to_use_it(n_right: int, n_left: int) -> None:
    open_chance = use_of([keeper(0)] * n_right + [keeper(2)] * n_left).open_chance[1, 50]
    # 1000 m are as long as a closed stretch of 300 m and a factor of exp(0.8) with this chance.
    prior_odds = 0.1 * norm.cdf(np.log(1000 / 300) / 0.8)
    odds = prior_odds / chance_that_nobody_uses_an_open_lane(n_right + n_left)
    assert open_chance == pytest.approx(1 / (1 + odds), rel=1e-6)


# Vehicles leave a lane at discretion every 2000 m, one that closes 150 m ahead on average. The last one says only that the
# closure is one of those that could begin anywhere along 1000 m.
def test_each_trace_that_left_the_lane_shortly_ahead_makes_its_closure_likelier() -> None:
    index = np.arange(len(STATIONS))
    left_m = np.array([0.0, 50.0, 100.0])  # ahead of the first idle station
    lanes = [np.where(index < 40 - ahead / 10, 1, 2) for ahead in left_m] + [keeper(0)] * 3
    odds = 0.1 * norm.cdf(np.log(600 / 300) / 0.8) / chance_that_nobody_uses_an_open_lane(6)
    odds *= 2000 / 1000 * np.prod(2000 / 150 * np.exp(-left_m[1:] / 150))
    assert use_of(lanes).open_chance[1, 60] == pytest.approx(1 / (1 + odds), rel=1e-6)


# At a spread of 1.6 m a lane's half is 13 % off, of which 5 % are believed to be mistakes; at 0.9 m 2.3 % are.
@pytest.mark.parametrize(("spread", "n_users", "is_open"), [(1.6, 4, False), (1.6, 6, True), (0.9, 2, False), (0.9, 3, True)])
def test_lane_is_idle_though_as_many_seem_to_use_it_as_are_mistaken(spread: float, n_users: int, is_open: bool) -> None:
    use = use_of([keeper(0)] * (100 - n_users) + [keeper(1)] * n_users, spread=spread)
    assert (use.open_chance[1] == 1.0).all() == is_open


@pytest.mark.parametrize(("off", "is_open"), [(0.015, True), (0.03, False)])
def test_trace_is_in_a_lane_within_2_percent_of_its_width_from_its_middle(off: float, is_open: bool) -> None:
    use = use_of([keeper(0)] * 6 + [keeper(1) + off] * 6)
    assert (use.open_chance[1] == 1.0).all() == is_open


def test_interior_closure_of_the_hypothesis_is_closed_whatever_else_is_said() -> None:
    use = use_of([keeper(0), leaver()], interior=(1,))
    assert use.open_chance[1, LEAVES : RETURNS + 1].max() == 0.0


def test_trace_that_seems_to_drive_through_an_interior_closure_does_not_open_it() -> None:
    use = use_of([keeper(0)] * 3 + [keeper(1), leaver()], interior=(1,))
    assert use.open_chance[1, LEAVES : RETURNS + 1].max() == 0.0


def test_way_of_a_vehicle_between_two_lanes_is_open_as_far_as_it_reaches() -> None:
    use = use_of([keeper(0)] * 6 + [leaver()] * 6, interior=(1,))
    middle = STATIONS[LEAVES - 4]  # half-way from lane 1 to lane 2: on the line between them, at 2 widths from the right edge
    chance = use.open_at(np.full(3, middle), np.array([2.0, 2.0 - 0.9 / WIDTH_M, 1.02]))
    assert chance[:2] == pytest.approx([1.0, 1.0], abs=0.01)
    assert chance[2] < 0.05


def test_way_of_a_vehicle_ends_60_cm_beside_it_with_a_standard_deviation_of_20_cm() -> None:
    use = use_of([keeper(0)] * 6 + [leaver()] * 6, interior=(1,))
    beside = 0.93 + 0.6 + np.array([-0.2, 0.0, 0.2])  # half a vehicle and the margin, from the vehicles' middle
    chance = use.open_at(np.full(3, STATIONS[LEAVES - 4]), 2.0 - beside / WIDTH_M)
    np.testing.assert_allclose(chance, norm.cdf([1, 0, -1]), atol=0.02)


def test_nose_of_the_work_begins_where_those_who_leave_the_lane_begin_to() -> None:
    use = use_of([keeper(0)] * 6 + [leaver()] * 6, interior=(1,))
    begun = STATIONS[LEAVES - 7]  # an eighth of a lane from its middle
    # The vehicles' middles are at 1.625 widths from the right edge, 2.2 m from the lane's; they reach 1.5 m.
    assert use.open_at(np.array([begun]), np.array([1.02]))[0] < 0.05


def test_closure_between_open_lanes_is_told_from_one_beside_them() -> None:
    lanes = np.array([keeper(0)] * 4 + [leaver(returns=999)] * 4 + [leaver(at=LEAVES + 2)] * 2).round().astype(int)
    random = np.random.default_rng(2)
    levels = 1.0 + WIDTH_M * lanes[:, 0] + 0.2 * random.standard_normal(len(lanes))
    closure_prior = ClosurePrior(stations=STATIONS, announced=None, merging_length_m=200.0)
    best = likely_hypotheses(lane_evidence(lanes, levels), closure_prior, n_open=None, min_closed=0)[0]
    assert best.pattern == LanePattern(3, (1,))
    assert best.closed_from == pytest.approx(LEAVES, abs=6)
