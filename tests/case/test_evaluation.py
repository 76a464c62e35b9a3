from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from builders import straight_traces
from case.finished_plans import SAFE_Y, coarse_paper, coarse_site, plan_of, run_along, straight_path

from wzsumo.case import evaluation
from wzsumo.case.assessment import assess
from wzsumo.case.evaluation import MethodResult, drive_plan, evaluate, first_plan, new_maps, plan_to_open_lane, table_row
from wzsumo.case.map_method import CrowdMethod, MadeMap, MapBeforeMethod, MapMethod, TracesMethod
from wzsumo.case.methods import METHODS
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Watch
from wzsumo.case.zone import SimulatedZone
from wzsumo.ego import EgoRun
from wzsumo.path import ReferencePath
from wzsumo.planning.lane_route import LaneLine
from wzsumo.planning.plan import Plan, PlanStatus
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.sections import MapUpdatesSpec
from wzsumo.simulation.files import SumoFiles

PAPER = coarse_paper()
ARRIVALS = {"arrivals": [{"after_s": 5.0, "used": 2}, {"after_s": 9.0, "used": 3}]}
ALL_FREE = TracesMethod(
    name="all_free",
    title="",
    make=lambda traces, task: MadeMap(
        task.cells.with_p_occupied(np.zeros(task.cells.shape)), {"n": traces["vehicle_id"].nunique()}
    ),
)


def with_updates(sets_out_with: str) -> Scenario:
    updates = MapUpdatesSpec.model_validate(ARRIVALS | {"sets_out_with": sets_out_with})
    crowd = PAPER.crowd.model_copy(update={"penetration": 1.0, "used": 1})
    mixture = PAPER.mixture.model_copy(update={"k_max": 1})
    return PAPER.model_copy(update={"map_updates": updates, "crowd": crowd, "mixture": mixture})


def zone() -> SimulatedZone:
    def sumo_files() -> AbstractContextManager[SumoFiles]:
        return nullcontext(cast("SumoFiles", SimpleNamespace()))

    over_zone = straight_traces([1.83, 5.49, 5.5], length_m=1100.0)
    return SimulatedZone(over_zone=over_zone, whole_fleet=lambda: over_zone, sumo_files=sumo_files)


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


def test_ego_sets_out_with_the_methods_own_map(planned_on: list[dict[str, Any]]) -> None:
    made = MadeMap(coarse_site().cells, {})
    for scenario in (PAPER, with_updates("crowd")):
        first_plan(METHODS["lanes"], made, scenario=scenario, site=coarse_site())
        assert planned_on[-1]["made"] is made


def test_ego_that_sets_out_with_the_map_of_before_takes_its_free_lanes_and_no_lane_of_the_crowd(
    planned_on: list[dict[str, Any]],
) -> None:
    made = MadeMap(coarse_site().cells, {}, lines=(LaneLine(stations=np.array([0.0, 9.0]), offsets=np.zeros(2)),))
    first_plan(METHODS["lanes"], made, scenario=with_updates("map_of_before"), site=coarse_site())
    np.testing.assert_array_equal(
        planned_on[0]["made"].grid.p_occupied, METHODS["hd_map"].map_of_zone(sources(PAPER)).grid.p_occupied
    )
    assert planned_on[0]["made"].lines == ()


def test_map_of_another_source_is_set_out_with_whatever_arrives(planned_on: list[dict[str, Any]]) -> None:
    made = MadeMap(coarse_site().cells, {})
    first_plan(METHODS["slam_raw"], made, scenario=with_updates("map_of_before"), site=coarse_site())
    assert planned_on[0]["made"] is made


def test_maps_of_the_first_two_and_three_traces_arrive_and_are_planned_on_from_where_the_ego_is(
    planned_on: list[dict[str, Any]],
) -> None:
    scenario = with_updates("crowd")
    maps = new_maps(ALL_FREE, sources(scenario), scenario=scenario, site=coarse_site())
    assert [new.after_s for new in maps] == [5.0, 9.0]
    maps[1].plan((450.0, 5.0, 0.1))
    (asked,) = planned_on
    assert asked["made"].figures == {"n": 3}
    assert asked["site"].start == (450.0, 5.0, 0.1)
    assert asked["site"].goal == coarse_site().goal
    assert asked["made"].grid.free.all()


@pytest.mark.parametrize(("method", "scenario"), [("hd_map", with_updates("crowd")), ("lanes", PAPER)])
def test_no_map_arrives_of_another_source_or_where_the_scenario_names_none(method: str, scenario: Scenario) -> None:
    assert new_maps(METHODS[method], sources(scenario), scenario=scenario, site=coarse_site()) == ()


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
    own = sources(with_updates("crowd"))
    assert isinstance(METHODS["hd_map"], MapBeforeMethod)
    assert METHODS["hd_map"].crowd_of(own) is None
    assert isinstance(METHODS["lanes"], CrowdMethod)
    assert METHODS["lanes"].crowd_of(own) is own.crowd
