"""A map that reaches the ego while it drives, in real SUMO traffic: a lane is closed ahead of which it did not know."""

from functools import partial

import numpy as np
import pytest

from wzsumo.case.closed_loop import STEP_S, Drive, drive_path
from wzsumo.case.methods import map_of_before
from wzsumo.case.plans import nominal_guide
from wzsumo.case.replanning import REPLAN_AHEAD_S, NewMap
from wzsumo.control.plant import PlantSpec
from wzsumo.ego import Outcome
from wzsumo.errors import SpecError
from wzsumo.planning.plan import plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.sections import ControlSection, MapUpdatesSpec
from wzsumo.scenario.site import prepare_site
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.files import SimulationSpec, write_sumo_files
from wzsumo.simulation.session import Session
from wzsumo.spec import parse_spec
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
SPEED = 15.0
SCENARIO = Scenario.model_validate({
    "name": "closing", "seed": 5,
    "road": {"lane_count": 2, "lane_width_ft": 12, "left_shoulder_ft": 10, "right_shoulder_ft": 10, "length_ft": 3500},
    "work_zone": {
        "posted_speed_mph": 45, "start_ft": 900, "closed_lanes": [1], "closed_shoulder": "left", "work_length_ft": 200,
        "device": "cone_36in",
    },
    "route": {"start_lane": 1, "goal_lane": 0},
    "map": {"resolution_m": 0.25},
    "planner": {"planned_speed_mps": SPEED},
})  # fmt: skip


@pytest.fixture(scope="module")
def site():
    return prepare_site(SCENARIO)


@pytest.fixture(scope="module")
def files(site, tmp_path_factory: pytest.TempPathFactory):
    spec = SimulationSpec(demand=DemandSpec(flow_vph=600, duration_s=200, truck_share=0.1))
    return write_sumo_files(site.layout, tmp_path_factory.mktemp("closing"), spec=spec, seed=5)


def plan_on(grid, site, start):
    spec = PlannerSpec(planned_speed_mps=SPEED)
    return plan_path(grid, start=start, goal=site.goal, vehicle=CAR, spec=spec, guide=nominal_guide(site))


def drive(site, files, *, new_maps):
    path = plan_on(map_of_before(site), site, site.start).path
    control = ControlSection(target_speed_mps=SPEED)
    how = Drive(vehicle=CAR, control=control, plant=PlantSpec(steering_lag_s=0.2), depart_s=40.0, time_limit_s=200.0)
    return drive_path(path, layout=site.layout, files=files, drive=how, on_step=lambda _: None, new_maps=new_maps)


def test_drivers_are_shown_the_ego_as_wide_as_it_is_with_its_clearance_at_every_step(
    site, files, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown, place_ego = [], Session.place_ego

    def spy(session, parts, *, speed) -> None:
        shown.append(parts)
        place_ego(session, parts, speed=speed)

    monkeypatch.setattr(Session, "place_ego", spy)
    run = drive(site, files, new_maps=())
    assert len(shown) == len(run.log)
    for (part,) in shown[:100]:  # in the middle of its lane
        assert part.width == pytest.approx(CAR.width_m + 2 * 0.3, abs=0.01)


def true_map(site):
    return site.cells.with_p_occupied(np.where(site.nominal | site.drivable, 0.0, 1.0))


def test_ego_that_is_told_nothing_of_the_closed_lane_runs_into_its_devices(site, files) -> None:
    run = drive(site, files, new_maps=())
    assert run.outcome in {Outcome.STRUCK_DEVICE, Outcome.ENTERED_CLOSED_AREA}
    assert run.replans == ()


def test_map_that_arrives_on_the_way_leads_the_ego_past_the_closed_lane_without_a_jump(
    site, files, capfd: pytest.CaptureFixture[str]
) -> None:
    run = drive(site, files, new_maps=[NewMap(after_s=3.0, plan=partial(plan_on, true_map(site), site))])
    assert run.outcome is Outcome.REACHED_GOAL, run.reason
    assert capfd.readouterr() == (
        "",
        "",
    )  # SUMO would warn of an "emergency stop" of the ego, which it counts to a lane that ends
    (replan,) = run.replans
    assert replan.time_s == pytest.approx(run.log["time_s"].iloc[0] + 3.0, abs=2 * STEP_S)
    place = run.log["s_m"][run.log["time_s"] >= replan.time_s].iloc[0]
    assert replan.station_m == pytest.approx(place + REPLAN_AHEAD_S * SPEED, abs=1.5)
    # Nothing jumps: neither place, heading, the station that the log counts on, nor the wheel.
    log = run.log
    assert np.hypot(log["x_m"].diff(), log["y_m"].diff()).max() < 1.05 * log["speed_mps"].max() * STEP_S
    assert log["s_m"].diff().min() >= 0
    assert log["heading_rad"].diff().abs().max() < 2.5 / SPEED * STEP_S  # 2 m/s2 of lateral acceleration, and a quarter more
    assert log["steering_rad"].diff().abs().max() < np.deg2rad(0.5)
    assert log["cross_track_m"].abs().max() < 0.2


def test_map_without_a_way_on_ends_the_run_and_says_when_and_why(site, files) -> None:
    walled = site.cells.with_p_occupied(np.where(site.nominal, 0.0, 1.0))
    run = drive(site, files, new_maps=[NewMap(after_s=2.0, plan=partial(plan_on, walled, site))])
    assert run.outcome is Outcome.NO_PATH
    assert run.reason.startswith("on the map that came after 2.0 s no free corridor")
    assert [replan.status for replan in run.replans] == ["NO_PATH"]


@pytest.mark.parametrize("times", [[5, 5], [10, 4]])
def test_maps_that_do_not_come_one_after_the_other_are_refused(times) -> None:
    arrivals = [{"after_s": time, "used": 5} for time in times]
    with pytest.raises(SpecError, match="must come one after the other"):
        parse_spec(MapUpdatesSpec, {"arrivals": arrivals}, source="map_updates")
