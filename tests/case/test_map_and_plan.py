from dataclasses import replace

import numpy as np
import pytest
from builders import straight_traces

from wzsumo.case import map_and_plan
from wzsumo.case.crowd import Crowd
from wzsumo.case.map_and_plan import driven_ground
from wzsumo.case.methods import planner_for
from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.planning.plan import plan_path
from wzsumo.scenario.scenario import load_scenario
from wzsumo.scenario.site import prepare_site

PAPER = load_scenario("scenarios/paper.toml")
MIDDLE = 5.49  # m, centre of the lane of start and goal
REACH_M = 0.93 + 0.25  # half a vehicle and the scatter of drivers


@pytest.fixture(scope="module")
def site():
    return prepare_site(PAPER)


def crowd_of(traces):
    """A crowd that drove a lane from x = 457 to 1100 m."""
    mixture = Mixture(
        weights=np.ones(1), means=np.array([[780.0, MIDDLE]]), covariances=np.diag([640**2 / 12, 0.01])[None],
        log_likelihood=0.0, n_points=100, converged=True,
    )  # fmt: skip
    return Crowd(traces=traces, road=PAPER.layout().road, sweep=None, mixture=mixture, samples=np.empty((0, 2)))


def width_of(ground, site):
    """Width [m] of the cells beside x = 500 m."""
    (_,), (col,) = site.cells.cell_of((500.0, MIDDLE))
    return float(ground[:, col].sum() * site.cells.resolution)


def test_ground_that_two_vehicles_drove_over_is_as_wide_as_they_have_in_common(site) -> None:
    crowd = crowd_of(straight_traces([MIDDLE - 0.2, MIDDLE + 0.2], length_m=1100.0))
    ground = driven_ground(crowd, scenario=PAPER, cells=site.cells)
    assert width_of(ground, site) == pytest.approx(2 * REACH_M - 0.4, abs=site.cells.resolution)


def test_ground_that_one_vehicle_drove_over_or_two_with_unsure_positions_is_not_known_to_be_free(site) -> None:
    alone = crowd_of(straight_traces([MIDDLE], length_m=1100.0))
    assert not driven_ground(alone, scenario=PAPER, cells=site.cells).any()
    together = crowd_of(straight_traces([MIDDLE, MIDDLE], length_m=1100.0))
    unsure = PAPER.model_copy(update={"gnss": PAPER.gnss.model_copy(update={"error_m": 1.0})})
    assert not driven_ground(together, scenario=unsure, cells=site.cells).any()
    assert driven_ground(together, scenario=PAPER, cells=site.cells).any()


def doubtful_map(site):
    """Free but for the stretch from x = 600 to 700 m, where the lanes are occupied with p = 0.3."""
    p = np.zeros(site.cells.shape, dtype=np.float32)
    (_, _), (first, last) = site.cells.cell_of([(600.0, 0.0), (700.0, 0.0)])
    p[:, first:last] = 0.3
    return site.cells.with_p_occupied(p)


def test_plan_goes_where_the_crowd_drove_though_the_map_doubts_it(site) -> None:
    crowd = crowd_of(straight_traces([MIDDLE, MIDDLE], length_m=1100.0))
    plan = map_and_plan.plan_for("lanes", doubtful_map(site), scenario=PAPER, site=site, crowd=crowd)
    inside = (plan.path.poses[:, 0] > 600) & (plan.path.poses[:, 0] < 700)
    assert np.abs(plan.path.poses[inside, 1] - MIDDLE).max() < REACH_M - 0.93
    blocked = map_and_plan.plan_for("lanes", doubtful_map(site), scenario=PAPER, site=site, crowd=None)
    assert blocked.path is None


def test_plan_is_that_of_the_first_guide_that_has_one_and_takes_the_time_of_all(site, monkeypatch: pytest.MonkeyPatch):
    found = []

    def plan_without_the_first(grid, **given):
        plan = plan_path(grid, **given)
        found.append(plan)
        return replace(plan, path=None) if len(found) == 1 else plan

    monkeypatch.setattr(map_and_plan, "plan_path", plan_without_the_first)
    free = site.cells.with_p_occupied(np.zeros(site.cells.shape))
    crowd = crowd_of(straight_traces([MIDDLE], length_m=1100.0))
    plan = map_and_plan.plan_for("lanes", free, scenario=PAPER, site=site, crowd=crowd)
    assert len(found) == 2
    assert plan.path is found[1].path
    assert plan.timings_ms["total"] == pytest.approx(sum(each.timings_ms["total"] for each in found))


@pytest.mark.parametrize("method", ["lanes", "swept"])
def test_wish_for_clearance_on_a_map_of_the_crowd_is_raised_and_a_higher_one_kept(method: str) -> None:
    for own, wished in ((0.7, 1.2), (2.0, 2.0)):
        planner = PAPER.planner.model_copy(update={"preferred_clearance_m": own})
        assert planner_for(method, planner).preferred_clearance_m == wished
        assert planner_for("paper", planner).preferred_clearance_m == own
