from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces

from wzsumo.case import plans
from wzsumo.case.crowd import Crowd
from wzsumo.case.methods import METHODS
from wzsumo.case.plans import guides_for, nominal_guide, traces_ending_in_lane_of
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec
from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.crowd_mapping.mixture.selection import MixtureSweep
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.plan import Plan, plan_path
from wzsumo.road import Road
from wzsumo.scenario.scenario import load_scenario
from wzsumo.scenario.site import Site, prepare_site

RIGHT, MIDDLE = 1.83, 5.49  # m, centres of the two right lanes
PAPER_ROAD = load_scenario("scenarios/paper.toml").layout().road


@pytest.fixture(scope="module")
def site() -> Site:
    return prepare_site(load_scenario("scenarios/paper.toml"))  # its goal lies in the middle lane


def crowd_of(traces: pd.DataFrame, stretches: Sequence[tuple[float, float, float]], *, road: Road = PAPER_ROAD) -> Crowd:
    """A crowd whose mixture has one component a stretch (from station, to station, offset)."""
    first, last, y = np.array(stretches).T
    variances = [np.diag([length**2 / 12, 0.01]) for length in last - first]
    mixture = Mixture(
        weights=np.full(len(y), 1 / len(y)), means=np.column_stack([(first + last) / 2, y]), covariances=np.array(variances),
        log_likelihood=0.0, n_points=100, converged=True,
    )  # fmt: skip
    return Crowd(
        traces=traces,
        road=road,
        spec=MixtureSpec(),
        sweep=MixtureSweep(mixtures=(mixture,)),
        mixture=mixture,
        samples=np.empty((0, 2)),
    )


def inner_lines(crowd: Crowd, site: Site) -> list[tuple[float, float, float]]:
    """What the crowd adds to the nominal guide: x of both ends and y of each line."""
    found = guides_for(crowd, site=site)[0]
    nominal = len(nominal_guide(site))
    return sorted(
        (round(line[:, 0].min()), round(line[:, 0].max()), round(float(line[:, 1].mean()), 2)) for line in found[nominal:]
    )


STRETCHES = [(460, 660, RIGHT), (660, 900, RIGHT), (460, 660, MIDDLE), (660, 900, MIDDLE)]


def changing(x_change: float, *, start: float, end: float) -> pd.DataFrame:
    traces = straight_traces([start], length_m=1100.0)
    traces.loc[traces["x_m"] > x_change, "y_m"] = end
    return traces.assign(vehicle_id="changer")


def test_lines_of_vehicles_that_leave_the_zone_in_another_lane_are_no_guide(site: Site) -> None:
    crowd = crowd_of(straight_traces([RIGHT, MIDDLE], length_m=1100.0), STRETCHES)
    assert inner_lines(crowd, site) == [(460, 660, MIDDLE), (660, 900, MIDDLE)]


def test_guide_leads_over_to_the_goals_lane_where_a_vehicle_changed_to_it(site: Site) -> None:
    traces = pd.concat([straight_traces([RIGHT], length_m=1100.0), changing(660, start=RIGHT, end=MIDDLE)])
    assert inner_lines(crowd_of(traces, STRETCHES), site) == [(460, 660, RIGHT), (660, 900, MIDDLE)]


def test_all_lines_are_a_guide_where_no_vehicle_went_to_the_goals_lane(site: Site) -> None:
    crowd = crowd_of(straight_traces([RIGHT], length_m=1100.0), STRETCHES)
    assert len(inner_lines(crowd, site)) == len(STRETCHES)


def test_trace_that_changed_lanes_ends_in_its_last_lane(site: Site) -> None:
    traces = pd.concat([straight_traces([RIGHT, MIDDLE]), changing(60, start=MIDDLE, end=RIGHT)])
    assert set(traces_ending_in_lane_of((100.0, RIGHT), traces, road=site.layout.road)["vehicle_id"]) == {"v000", "changer"}


@pytest.mark.parametrize(("before_its_end_m", "lane"), [(10, MIDDLE), (20, RIGHT)])
def test_lane_that_a_trace_ends_in_is_where_it_mostly_was_in_its_last_30_m(
    site: Site, before_its_end_m: float, lane: float
) -> None:
    trace = changing(1100.0 - before_its_end_m, start=MIDDLE, end=RIGHT)
    for other in (RIGHT, MIDDLE):
        found = traces_ending_in_lane_of((1000.0, other), trace, road=site.layout.road)
        assert len(found) == (len(trace) if other == lane else 0)


@pytest.mark.parametrize(("change_m", "is_guide"), [(564, False), (556, True)])
def test_line_guides_where_vehicles_to_the_goal_drove_along_half_of_it(site: Site, change_m: float, is_guide: bool) -> None:
    """The line reaches from 460 m to 660 m; the vehicle comes over to its lane after 48 % or 52 % of it, and stays there."""
    crowd = crowd_of(changing(change_m, start=RIGHT, end=MIDDLE), [(460, 660, MIDDLE)])
    assert inner_lines(crowd, site) == [(460, 660, MIDDLE)] * is_guide


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(("distance_m", "is_guide"), [(0.90, True), (0.92, False)])
def test_line_guides_where_vehicles_to_the_goal_drove_within_a_quarter_of_a_lane(
    site: Site, side: int, distance_m: float, is_guide: bool
) -> None:
    crowd = crowd_of(straight_traces([MIDDLE], length_m=1100.0), [(460, 660, MIDDLE + side * distance_m)])
    assert len(inner_lines(crowd, site)) == is_guide


def slanted_line() -> Mixture:
    """One component along the line from the right lane at 460 m to the middle lane at 660 m."""
    vector = np.array([200.0, MIDDLE - RIGHT])
    across = np.array([-vector[1], vector[0]]) / np.hypot(*vector)
    covariance = np.outer(vector, vector) / 12 + 0.01 * np.outer(across, across)
    return Mixture(
        weights=np.ones(1), means=np.array([[560.0, (RIGHT + MIDDLE) / 2]]), covariances=covariance[None],
        log_likelihood=0.0, n_points=100, converged=True,
    )  # fmt: skip


@pytest.mark.parametrize("slants", [True, False])
def test_line_from_lane_to_lane_guides_where_a_vehicle_changed_along_it_and_not_where_one_kept_its_lane(
    site: Site, slants: bool
) -> None:
    traces = straight_traces([MIDDLE], length_m=1100.0)
    if slants:
        traces["y_m"] = np.interp(traces["x_m"], [460, 660], [RIGHT, MIDDLE])
    crowd = replace(crowd_of(traces, [(460, 660, MIDDLE)]), mixture=slanted_line())
    assert len(inner_lines(crowd, site)) == slants


def test_nominal_guide_runs_along_every_lane_centre_outside_the_announced_zone_in_lines_of_20_m(site: Site) -> None:
    guide, layout = nominal_guide(site), site.layout
    lengths = guide[:, 1, 0] - guide[:, 0, 0]
    assert lengths.max() <= 20.0
    assert lengths.min() > 15.0
    assert set(np.unique(guide[..., 1].round(2))) == {1.83, 5.49, 9.14}
    assert not ((guide[:, 1, 0] > layout.start + 1e-6) & (guide[:, 0, 0] < layout.end - 1e-6)).any()
    assert lengths.sum() == pytest.approx(3 * (layout.road.length - (layout.end - layout.start)))


def test_map_of_another_source_has_the_nominal_guide_alone(site: Site) -> None:
    (guide,) = guides_for(None, site=site)
    np.testing.assert_array_equal(guide, nominal_guide(site))


def test_lines_of_all_come_second(site: Site) -> None:
    crowd = crowd_of(straight_traces([RIGHT, MIDDLE], length_m=1100.0), STRETCHES)
    guides = guides_for(crowd, site=site)
    assert len(guides) == 2
    assert len(guides[1]) == len(nominal_guide(site)) + len(STRETCHES)


def test_line_on_a_bend_follows_it() -> None:
    site = prepare_site(load_scenario("scenarios/paper_bend_300m.toml"))
    road = site.layout.road
    s = np.arange(0.0, road.length)
    trace = pd.DataFrame(road.to_xy(s, np.full_like(s, MIDDLE)), columns=["x_m", "y_m"]).assign(vehicle_id="v", time_s=s / 20)
    guide = guides_for(crowd_of(trace, [(600, 700, MIDDLE)], road=road), site=site)[0]
    points = guide[len(nominal_guide(site)) :].mean(axis=1)  # the middles of its lines, where chords leave an arc the farthest
    stations, offsets = road.to_sd(points)
    assert stations.min() < 610
    assert stations.max() > 690
    assert offsets == pytest.approx(MIDDLE, abs=0.021)


def test_plan_is_that_of_the_first_guide_that_has_one_and_takes_the_time_of_all(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []

    def plan_without_the_first(grid: OccupancyGrid, **given: Any) -> Plan:
        plan = plan_path(grid, **given)
        found.append(plan)
        return replace(plan, path=None) if len(found) == 1 else plan

    monkeypatch.setattr(plans, "plan_path", plan_without_the_first)
    free = site.cells.with_p_occupied(np.zeros(site.cells.shape))
    crowd = crowd_of(straight_traces([MIDDLE], length_m=1100.0), [(460, 1100, MIDDLE)])
    plan = plans.plan_for(METHODS["lanes"], free, scenario=load_scenario("scenarios/paper.toml"), site=site, crowd=crowd)
    assert len(found) == 2
    assert plan.path is found[1].path
    assert plan.timings_ms["total"] == pytest.approx(sum(each.timings_ms["total"] for each in found))
