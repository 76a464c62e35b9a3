from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces
from case.finished_plans import SAFE_Y, coarse_paper, coarse_site, plan_of, run_along, straight_path

from wzsumo.case import evaluation
from wzsumo.case.assessment import assess
from wzsumo.case.evaluation import MethodResult, drive_plan, evaluate, new_maps, plan_to_open_lane, table_row
from wzsumo.case.map_method import ArrivingMap, CrowdMethod, MadeMap, MapBeforeMethod, MapMethod
from wzsumo.case.methods import METHODS, map_of_before
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Watch
from wzsumo.case.zone import SimulatedZone
from wzsumo.ego import EgoRun
from wzsumo.path import ReferencePath
from wzsumo.planning.plan import Plan, PlanStatus
from wzsumo.scenario.scenario import Scenario
from wzsumo.simulation.files import SumoFiles

PAPER = coarse_paper()


def zone() -> SimulatedZone:
    def sumo_files() -> AbstractContextManager[SumoFiles]:
        return nullcontext(cast("SumoFiles", SimpleNamespace()))

    over_zone = straight_traces([1.83, 5.49, 5.5], length_m=1100.0)

    def fleet() -> pd.DataFrame:
        return over_zone

    return SimulatedZone(over_zone=over_zone, whole_fleet=fleet, sumo_files=sumo_files, fleet_before=fleet)


def sources(scenario: Scenario) -> Sources:
    return Sources(zone=zone(), scenario=scenario, site=coarse_site(), watch=Watch())


@pytest.fixture
def planned_on(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What each plan is asked for; every plan finds the same safe path."""
    asked: list[dict[str, Any]] = []

    def plan_for(method: MapMethod, made: MadeMap, **given: Any) -> Plan:
        asked.append({"method": method, "made": made} | given)
        return plan_of(straight_path(SAFE_Y))

    monkeypatch.setattr(evaluation, "plan_for", plan_for)
    return asked


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What each drive is asked for; every drive follows its path exactly."""
    asked: list[dict[str, Any]] = []

    def drive_path(path: ReferencePath, **given: Any) -> EgoRun:
        asked.append(given)
        return run_along(path)

    monkeypatch.setattr(evaluation, "drive_path", drive_path)
    return asked


class Arriving(MapBeforeMethod):
    """A method whose second map reaches the ego on its way, and whose doubts before that."""

    def arriving(self, sources: Sources) -> tuple[ArrivingMap, ...]:
        free = MadeMap(sources.site.cells.with_p_occupied(np.zeros(sources.site.cells.shape)), {})
        return (ArrivingMap(time_s=200.0, made=None, doubtful=((100.0, 200.0),)), ArrivingMap(time_s=209.0, made=free))


def test_maps_that_arrive_are_planned_on_from_where_the_ego_is(planned_on: list[dict[str, Any]]) -> None:
    method, own = Arriving(name="arriving", title="", make=map_of_before), sources(PAPER)
    doubt, new = new_maps(method, method.map_of_zone(own), own, scenario=PAPER, site=coarse_site())
    assert (doubt.time_s, doubt.plan, doubt.doubtful) == (200.0, None, ((100.0, 200.0),))
    assert new.time_s == 209.0
    assert new.plan is not None
    new.plan((450.0, 5.0, 0.1))
    (asked,) = planned_on
    assert asked["site"].start == (450.0, 5.0, 0.1)
    assert asked["site"].goal == coarse_site().goal
    assert asked["made"].grid.free.all()


def test_ego_whose_goal_is_closed_on_a_new_map_goes_to_the_one_in_the_open_lane(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def plan_for(_method: MapMethod, _made: MadeMap, *, site: Any, **_given: Any) -> Plan:
        asked.append(site.goal)
        return plan_of(straight_path(SAFE_Y) if site.goal == (1000.0, 1.83, 0.0) else None)

    monkeypatch.setattr(evaluation, "plan_for", plan_for)
    method, own = Arriving(name="arriving", title="", make=map_of_before), sources(PAPER)
    for open_goal, found in (((1000.0, 1.83, 0.0), True), (None, False)):
        site = replace(coarse_site(), open_goal=open_goal)
        _, new = new_maps(method, MadeMap(coarse_site().cells, {}), own, scenario=PAPER, site=site)
        assert new.plan is not None
        assert (new.plan((450.0, 5.0, 0.1)).path is not None) is found
    assert asked[0] == coarse_site().goal


def test_path_is_free_on_a_doubted_map_as_far_as_on_the_one_before_and_on_a_new_map_as_far_as_that_is() -> None:
    method, own = Arriving(name="arriving", title="", make=map_of_before), sources(PAPER)
    walled = coarse_site().cells.with_p_occupied(np.ones(coarse_site().cells.shape))
    doubt, new = new_maps(method, MadeMap(walled, {}), own, scenario=PAPER, site=coarse_site())
    path = straight_path(SAFE_Y)
    assert doubt.free_until(path, 20.0) == pytest.approx(20.0, abs=1.0)
    assert new.free_until(path, 20.0) == pytest.approx(100.0)


@pytest.mark.parametrize("method", ["hd_map", "lanes"])
def test_no_map_arrives_where_the_zone_stays_as_it_is(method: str) -> None:
    made = MadeMap(coarse_site().cells, {})
    assert new_maps(METHODS[method], made, sources(PAPER), scenario=PAPER, site=coarse_site()) == ()


def test_drive_begins_after_the_warm_up_and_ends_at_the_latest_400_s_later(driven: list[dict[str, Any]]) -> None:
    plan = plan_of(straight_path(SAFE_Y))  # three vehicles passed, and none of them waits in the way of the ego's start
    drive_plan(plan, zone(), name="lanes", scenario=PAPER, site=coarse_site(), watch=Watch(in_window=True))
    drive = driven[0]["drive"]
    assert (drive.depart_s, drive.time_limit_s) == (PAPER.simulation.demand.warm_up_s, 400.0)
    assert drive.in_window


def test_plan_without_a_path_is_not_driven(driven: list[dict[str, Any]]) -> None:
    assert drive_plan(plan_of(None), zone(), name="lanes", scenario=PAPER, site=coarse_site(), watch=Watch()) is None
    assert driven == []


@pytest.mark.parametrize("drives", [True, False])
def test_method_is_driven_only_where_the_ego_drives(
    planned_on: list[dict[str, Any]], driven: list[dict[str, Any]], drives: bool
) -> None:
    watch = Watch()
    result = evaluate(METHODS["hd_map"], sources(PAPER), scenario=PAPER, site=coarse_site(), drives=drives, watch=watch)
    assert (result.run is not None) == bool(driven) == drives
    assert result.figures["outcome"] == ("REACHED_GOAL" if drives else "NO_PATH")
    assert planned_on[0]["made"] is result.made
    assert list(watch.seconds) == ["map hd_map", "drive hd_map"]


def test_map_that_is_known_already_is_not_made_again(planned_on: list[dict[str, Any]]) -> None:
    known = MadeMap(coarse_site().cells, {})
    result = evaluate(
        METHODS["hd_map"], sources(PAPER), scenario=PAPER, site=coarse_site(), made=known, drives=False, watch=Watch()
    )
    assert result.made is planned_on[0]["made"] is known


def result_of(plan: Plan, run: EgoRun | None = None) -> MethodResult:
    grid, site = coarse_site().cells, coarse_site()
    figures = assess(MadeMap(grid, {}), plan, run, crowd=None, over_zone=zone().over_zone, scenario=PAPER, site=site)
    return MethodResult(made=MadeMap(grid, {}), plan=plan, run=run, figures=figures)


def test_plan_to_the_open_lane_has_the_goal_there(planned_on: list[dict[str, Any]]) -> None:
    route = PAPER.route.model_copy(update={"open_goal_lane": 0})
    scenario = PAPER.model_copy(update={"route": route})
    site = replace(coarse_site(), open_goal=(1000.0, 1.83, 0.0))
    result = result_of(plan_of(straight_path(SAFE_Y)))
    plan, goals = plan_to_open_lane(METHODS["hd_map"], result, scenario=scenario, site=site)
    assert plan is not None
    assert planned_on[0]["site"].goal == (1000.0, 1.83, 0.0)
    assert (goals["own_lane"]["lane"], goals["open_lane"]["lane"]) == (PAPER.route.goal_lane, 0)


def test_scenario_without_an_open_lane_has_figures_of_its_own_goal_alone() -> None:
    route = PAPER.route.model_copy(update={"open_goal_lane": None})
    scenario, site = PAPER.model_copy(update={"route": route}), replace(coarse_site(), open_goal=None)
    result = result_of(plan_of(straight_path(SAFE_Y)))
    plan, goals = plan_to_open_lane(METHODS["hd_map"], result, scenario=scenario, site=site)
    assert plan is None
    assert list(goals) == ["own_lane"]


def row_of(plan: Plan, run: EgoRun | None = None, *, drives: bool = False) -> dict[str, Any]:
    return table_row(result_of(plan, run), lidar=None, drives=drives)


@pytest.mark.parametrize(
    ("y", "safe"),
    [(SAFE_Y, True), (6.9, False), (9.14, False), (-3.0, False)],
    ids=["between the lanes", "against the devices", "in the closed lane", "over the edge of the shoulder"],
)
def test_plan_is_safe_where_its_outline_touches_no_device_no_edge_and_not_the_closed_area(y: float, safe: bool) -> None:
    assert row_of(plan_of(straight_path(y)))["safe_plan"] is safe


@pytest.mark.parametrize(
    ("figure", "value", "safe"),
    [
        ("min_clearance_devices_m", 0.0, False), ("min_clearance_devices_m", 0.01, True),
        ("min_clearance_road_edge_m", 0.0, False), ("min_clearance_road_edge_m", -0.1, False),
        ("closed_area_share", 0.01, False),
    ],
)  # fmt: skip
def test_contact_of_any_kind_makes_a_plan_unsafe(figure: str, value: float, safe: bool) -> None:
    result = result_of(plan_of(straight_path(SAFE_Y)))
    planned = result.figures["planned"] | {figure: value}
    row = table_row(replace(result, figures=result.figures | {"planned": planned}), lidar=None, drives=False)
    assert row["safe_plan"] is safe
    assert row[f"planned_{figure}"] == value


def test_row_without_a_path_is_no_safe_plan_and_keeps_the_reason() -> None:
    row = row_of(plan_of(None, status=PlanStatus.NO_PATH))
    assert (row["safe_plan"], row["path_length_m"], row["outcome"]) == (False, None, "NO_PATH")
    assert row["reason"] == "NO_PATH: no free corridor"


def test_row_of_a_case_without_a_drive_has_no_outcome() -> None:
    row = row_of(plan_of(straight_path(SAFE_Y)))
    assert (row["outcome"], row["reason"]) == (None, "")
    assert row["path_length_m"] == pytest.approx(100.0)


def test_row_of_a_drive_has_its_outcome_its_measures_and_the_number_of_its_replans() -> None:
    path = straight_path(SAFE_Y)
    row = row_of(plan_of(path), run_along(path), drives=True)
    assert (row["outcome"], row["n_replans"]) == ("REACHED_GOAL", 0)
    assert "replans" not in row
    assert row["driven_min_clearance_devices_m"] == row["planned_min_clearance_devices_m"]
    assert row["driven_mean_speed_mps"] == pytest.approx(10.0)


def test_method_of_before_has_no_crowd_and_one_of_the_crowd_has_that_of_the_sources() -> None:
    own = sources(PAPER.model_copy(update={"crowd": PAPER.crowd.model_copy(update={"penetration": 1.0, "used": 1})}))
    assert isinstance(METHODS["hd_map"], MapBeforeMethod)
    assert METHODS["hd_map"].crowd_of(own) is None
    assert isinstance(METHODS["lanes"], CrowdMethod)
    assert METHODS["lanes"].crowd_of(own) is own.crowd
