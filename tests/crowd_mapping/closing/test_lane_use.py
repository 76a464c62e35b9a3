import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import beta

from wzsumo.crowd_mapping.closing.lane_use import LaneUse, fit_lane_use
from wzsumo.crowd_mapping.course.station_table import StationTable
from wzsumo.crowd_mapping.hypotheses.change_costs import Evidence
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_hypotheses import LaneHypothesis, likely_hypotheses
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern

STATIONS = np.arange(0.0, 1000.0, 10.0)
LEAVES, RETURNS = 40, 80  # indices of stations
WIDTH = 3.6


def use_of(lanes, *, interior=(), spread=0.2) -> LaneUse:
    """The use of three lanes by traces (n, stations) in known ones."""
    lanes = np.asarray(lanes, dtype=float)
    hypothesis = LaneHypothesis(
        pattern=LanePattern(3, interior), right=0.0, width=WIDTH, covariance=0.01 * np.eye(2), spread=spread, closes=LEAVES,
        opens=RETURNS, first=np.zeros((len(lanes), 3)), log_evidence=0.0,
    )  # fmt: skip
    levels = LaneLevels(
        n_lanes=3, closed=(), interior=interior, closes=LEAVES, opens=RETURNS, right=0.0, width=WIDTH,
        covariance=0.01 * np.eye(2), outer_width=WIDTH, outer_width_sd=0.1, spread=spread, lanes=lanes, hypothesis=hypothesis,
    )  # fmt: skip
    table = StationTable(stations=STATIONS, offsets=WIDTH * lanes, vehicle_ids=tuple(map(str, range(len(lanes)))), dropped=None)
    return fit_lane_use(table, np.ones(len(lanes)), levels, half_vehicle_m=0.93)


def keeper(lane):
    return np.full(len(STATIONS), float(lane))


def leaver(*, at=LEAVES, change=8, returns=RETURNS):
    """Leaves the middle lane for the left one within `change` stations up to `at`, and comes back."""
    index = np.arange(len(STATIONS))
    return 1 + np.clip((index - at + change) / change, 0, 1) - np.clip((index - returns) / change, 0, 1)


def test_lane_that_somebody_drove_all_along_is_open() -> None:
    assert (use_of([keeper(0), keeper(1), keeper(2), leaver()]).open_chance == 1.0).all()


def test_lane_that_everybody_left_at_one_place_is_closed_there_and_open_before() -> None:
    use = use_of([keeper(0)] * 5 + [leaver()] * 5)
    assert use.open_chance[1, LEAVES + 2 : RETURNS].max() < 0.01
    assert (use.open_chance[1, : LEAVES - 8] == 1.0).all()


def test_few_stations_between_one_who_leaves_a_lane_and_one_who_takes_it_are_no_closure() -> None:
    index = np.arange(len(STATIONS))
    leaves, takes = np.where(index < 30, 1, 2), np.where(index < 34, 0, 1)
    use = use_of([keeper(0)] * 10 + [keeper(2)] * 10 + [leaves, takes])
    assert (use.open_chance == 1.0).all()


def test_lane_that_three_traces_happen_not_to_use_is_neither_free_nor_certainly_closed() -> None:
    use = use_of([keeper(0), keeper(0), keeper(2)])
    assert 0.2 < use.open_chance[1, 50] < 0.9


def test_doubt_in_an_idle_lane_is_the_chance_that_nobody_happened_to_use_it() -> None:
    idle = use_of([keeper(0)] * 6 + [keeper(2)] * 6).open_chance[1, 50]
    more = use_of([keeper(0)] * 12 + [keeper(2)] * 12).open_chance[1, 50]
    # Both have the same prior: the ratio of their odds is that of two integrals over the lane's unknown share.
    integral = [quad(lambda q, n=n: beta.pdf(q, 3, 6) * (1 - q) ** n, 0, 1)[0] for n in (12, 24)]
    assert (1 / more - 1) / (1 / idle - 1) == pytest.approx(integral[0] / integral[1], rel=1e-6)


def test_interior_closure_of_the_hypothesis_is_closed_whatever_else_is_said() -> None:
    use = use_of([keeper(0), leaver()], interior=(1,))
    assert use.open_chance[1, LEAVES : RETURNS + 1].max() == 0.0


def test_way_of_a_vehicle_between_two_lanes_is_open_as_far_as_it_reaches() -> None:
    use = use_of([keeper(0)] * 6 + [leaver()] * 6, interior=(1,))
    middle = STATIONS[LEAVES - 4]  # half-way from lane 1 to lane 2: on the line between them, at 2 widths from the right edge
    chance = use.open_at(np.full(3, middle), np.array([2.0, 2.0 - 0.9 / WIDTH, 1.02]))
    assert chance[:2] == pytest.approx([1.0, 1.0], abs=0.01)
    assert chance[2] < 0.05


def test_nose_of_the_work_begins_where_those_who_leave_the_lane_begin_to() -> None:
    use = use_of([keeper(0)] * 6 + [leaver()] * 6, interior=(1,))
    begun = STATIONS[LEAVES - 7]  # an eighth of a lane from its middle
    # The vehicles' middles are at 1.625 widths from the right edge, 2.2 m from the lane's; they reach 1.5 m.
    assert use.open_at(np.array([begun]), np.array([1.02]))[0] < 0.05


def test_closure_between_open_lanes_is_told_from_one_beside_them() -> None:
    lanes = np.array([keeper(0)] * 4 + [leaver(returns=999)] * 4 + [leaver(at=LEAVES + 2)] * 2).round().astype(int)
    random = np.random.default_rng(2)
    levels = 1.0 + WIDTH * lanes[:, 0] + 0.2 * random.standard_normal(len(lanes))
    evidence = Evidence(
        levels=levels, lanes=lanes - lanes[:, :1], weights=np.ones(len(lanes)), spacing=10.0, width=(WIDTH, 0.12),
        usual_spread=0.2,
    )  # fmt: skip
    closure = ClosurePrior(stations=np.asarray(STATIONS, dtype=float), announced=None, merging_m=200.0)
    best = likely_hypotheses(evidence, closure, n_open=None, least_closed=0)[0]
    assert best.pattern == LanePattern(3, (1,))
    assert best.closes == pytest.approx(LEAVES, abs=6)
