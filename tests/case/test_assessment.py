from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces
from case.finished_plans import SAFE_Y, coarse_paper, coarse_site, plan_of, run_along, straight_path

from wzsumo.case.assessment import assess, goal_figures
from wzsumo.case.crowd import Crowd
from wzsumo.case.map_method import MadeMap
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec
from wzsumo.ego import EgoRun, Outcome, Replan
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.plan import Plan, PlanStatus

OVER_ZONE = straight_traces([1.83, 5.49], length_m=1500.0)


def truth_map() -> OccupancyGrid:
    return coarse_site().cells.with_p_occupied(np.where(coarse_site().drivable, 0.0, 1.0))


def figures_of(plan: Plan, run: EgoRun | None = None, *, grid: OccupancyGrid | None = None, **given: Any) -> dict[str, Any]:
    given = {"crowd": None, "over_zone": OVER_ZONE, "scenario": coarse_paper(), "site": coarse_site()} | given
    return assess(MadeMap(grid or truth_map(), {"n_components": 1} if given["crowd"] else {}), plan, run, **given)


def test_clearance_of_a_method_is_that_of_its_drive() -> None:
    planned, driven = straight_path(SAFE_Y), straight_path(SAFE_Y - 0.5)
    figures = figures_of(plan_of(planned), run_along(driven))
    assert figures["min_clearance_devices_m"] == figures["driven"]["min_clearance_devices_m"]
    assert figures["min_clearance_road_edge_m"] == figures["driven"]["min_clearance_road_edge_m"]
    assert figures["closed_area_share"] == figures["driven"]["closed_area_share"] == 0.0
    # Half a metre nearer to the right edge of the pavement, and as much farther from the devices, which stand on the left.
    assert figures["driven"]["min_clearance_devices_m"] == pytest.approx(figures["planned"]["min_clearance_devices_m"] + 0.5)
    # From the right edge line to the outer edge of the shoulder are 10 ft, and the car is 1.86 m wide.
    assert figures["driven"]["min_clearance_road_edge_m"] == pytest.approx(SAFE_Y - 0.5 + 3.048 - 0.93)


def test_clearance_of_a_method_without_a_drive_is_that_of_its_plan() -> None:
    figures = figures_of(plan_of(straight_path(SAFE_Y)))
    assert figures["driven"] is figures["drive"] is figures["drive_time_s"] is figures["max_cross_track_m"] is None
    assert figures["min_clearance_road_edge_m"] == figures["planned"]["min_clearance_road_edge_m"]
    assert figures["min_clearance_devices_m"] == figures["planned"]["min_clearance_devices_m"]


def test_path_through_the_closed_lane_has_its_share_of_the_closed_area() -> None:
    figures = figures_of(plan_of(straight_path(9.14)))
    assert figures["closed_area_share"] == figures["planned"]["closed_area_share"] == 1.0


def test_method_without_a_path_has_no_clearance_and_says_how_planning_ended() -> None:
    figures = figures_of(plan_of(None, status=PlanStatus.LIMIT_REACHED, reason="gave up"))
    assert (figures["outcome"], figures["reason"]) == ("NO_PATH", "LIMIT_REACHED: gave up")
    assert figures["planned"] is figures["min_clearance_devices_m"] is figures["closed_area_share"] is None
    assert (figures["n_replans"], figures["replans"]) == (0, [])


def test_drive_is_measured_from_its_log() -> None:
    path = straight_path(SAFE_Y)
    run = run_along(path, outcome=Outcome.COLLIDED, cross_track_m=np.linspace(-0.4, 0.3, len(path.poses)))
    figures = figures_of(plan_of(path), run)
    assert (figures["outcome"], figures["reason"]) == ("COLLIDED", "it ended early")
    assert figures["drive_time_s"] == pytest.approx(10.0)  # 100 m at 10 m/s
    assert figures["max_cross_track_m"] == pytest.approx(0.4)
    assert figures["drive"]["mean_speed_mps"] == pytest.approx(10.0)
    assert figures["drive"]["n_behind"] == 0


@pytest.mark.parametrize(("n_rows", "measured"), [(0, False), (1, False), (2, True)])
def test_drive_is_measured_from_two_rows_of_its_log_on(n_rows: int, measured: bool) -> None:
    run = run_along(straight_path(SAFE_Y), outcome=Outcome.TIMED_OUT)
    figures = figures_of(plan_of(straight_path(SAFE_Y)), replace(run, log=run.log.head(n_rows)))
    assert figures["outcome"] == "TIMED_OUT"
    for name in ("driven", "drive", "drive_time_s", "max_cross_track_m"):
        assert (figures[name] is not None) == measured, name


def test_figures_of_planning_are_those_of_the_first_plan() -> None:
    run = run_along(straight_path(SAFE_Y))
    replan = Replan(time_s=201.0, station_m=5.0, status="FOUND", reason="", plan_ms=3.0)
    figures = figures_of(plan_of(straight_path(SAFE_Y)), replace(run, replans=(replan, replan)))
    planning = {name: figures[name] for name in ("plan_status", "plan_speed_mps", "plan_risk_m", "n_expansions", "plan_ms")}
    assert planning == {"plan_status": "FOUND", "plan_speed_mps": 15.0, "plan_risk_m": 2.0, "n_expansions": 11, "plan_ms": 7.0}
    assert figures["n_replans"] == 2
    assert figures["replans"][0]["station_m"] == 5.0


def test_map_is_counted_against_the_drivable_area_of_the_zone_alone() -> None:
    site = coarse_site()
    assert figures_of(plan_of(None))["iou"] == 1.0
    all_free = site.cells.with_p_occupied(np.zeros(site.cells.shape))
    figures = figures_of(plan_of(None), grid=all_free)
    assert figures["recall"] == 1.0
    assert figures["precision"] == pytest.approx(site.drivable.sum() / site.counted.sum())


def test_figures_name_the_traces_and_components_of_a_crowd_and_none_of_another_source() -> None:
    traces = pd.concat([OVER_ZONE, OVER_ZONE.assign(vehicle_id=OVER_ZONE["vehicle_id"] + "b")])
    crowd = Crowd(traces=traces, road=coarse_site().layout.road, spec=MixtureSpec(k_max=1), seed=1)
    figures = figures_of(plan_of(None), crowd=crowd)
    assert (figures["n_traces"], figures["n_components"]) == (4, 1)
    figures = figures_of(plan_of(None))
    assert figures["n_traces"] is figures["n_components"] is None


def test_goal_has_the_first_contact_of_the_path_to_it() -> None:
    struck, safe, none = (
        goal_figures(plan_of(path), lane=1, scenario=coarse_paper(), site=coarse_site())
        for path in (straight_path(9.14, first_m=540.0), straight_path(SAFE_Y), None)
    )
    assert (safe["planned_outcome"], safe["n_devices_struck"], safe["closed_area_share"]) == ("REACHED_GOAL", 0, 0.0)
    assert safe["length_m"] == pytest.approx(100.0)
    assert struck["planned_outcome"] in {"STRUCK_DEVICE", "ENTERED_CLOSED_AREA"}
    assert 20 < struck["first_contact_m"] < 60  # the taper comes over to the lane
    assert (none["planned_outcome"], none["lane"], none["reason"]) == ("NO_PATH", 1, "no free corridor")
    assert none["length_m"] is none["n_devices_struck"] is none["closed_area_share"] is None
