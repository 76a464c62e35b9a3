"""The ego in SUMO traffic on a road where a lane is closed ahead that its map shows open."""

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest

from wzsumo.case.closed_loop import Drive, drive_path
from wzsumo.case.map_method import MadeMap
from wzsumo.case.methods import METHODS, map_of_before
from wzsumo.case.plans import plan_for
from wzsumo.case.replanning import NewMap
from wzsumo.control.plant import PlantSpec
from wzsumo.ego import EgoRun, Outcome
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.path_check import free_until
from wzsumo.planning.plan import Plan
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.scenario.scenario import Pose, Scenario
from wzsumo.scenario.sections import ControlSection
from wzsumo.scenario.site import Site, prepare_site
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.files import SimulationSpec, SumoFiles, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.session import LaneBody, Session
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
SPEED = 15.0
TOLD_S = 43.5  # s of the simulation, when maps come; the ego asks to enter at 40 s
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
def site() -> Site:
    return prepare_site(SCENARIO)


@pytest.fixture(scope="module")
def files(site: Site, tmp_path_factory: pytest.TempPathFactory) -> SumoFiles:
    spec = SimulationSpec(demand=DemandSpec(flow_vph=600, duration_s=200, truck_share=0.1))
    return write_sumo_files(site.layout, tmp_path_factory.mktemp("closing"), spec=spec, seed=5)


def plan_on(grid: OccupancyGrid, site: Site, start: Pose) -> Plan:
    scenario = SCENARIO.model_copy(update={"planner": PlannerSpec(planned_speed_mps=SPEED)})
    return plan_for(METHODS["hd_map"], MadeMap(grid, {}), scenario=scenario, site=replace(site, start=start))


def new_map(grid: OccupancyGrid, site: Site) -> NewMap:
    free = partial(free_until, vehicle=CAR, spec=PlannerSpec(planned_speed_mps=SPEED))
    return NewMap(
        time_s=TOLD_S, plan=partial(plan_on, grid, site), free_until=lambda path, start: free(path, grid, start_m=start)
    )


def drive(
    site: Site, files: SumoFiles, *, new_maps: list[NewMap], doubtful_speed_mps: float = np.inf, time_limit_s: float = 200.0
) -> EgoRun:
    path = plan_on(map_of_before(site), site, site.start).path
    assert path is not None
    control = ControlSection(target_speed_mps=SPEED)
    how = Drive(vehicle=CAR, control=control, plant=PlantSpec(steering_lag_s=0.2), depart_s=40.0, time_limit_s=time_limit_s,
                doubtful_speed_mps=doubtful_speed_mps)  # fmt: skip
    return drive_path(path, layout=site.layout, files=files, drive=how, on_step=lambda _: None, new_maps=new_maps)


class Watched(NamedTuple):
    """A run without new maps, and what SUMO was told in it."""

    run: EgoRun
    bodies: list[tuple[LaneBody, ...]]  # at each step
    emergency_braking: list[set[str]]  # ids of the vehicles that may brake so, at each look around


@pytest.fixture(scope="module")
def watched(site: Site, files: SumoFiles) -> Watched:
    bodies: list[tuple[LaneBody, ...]] = []
    emergency_braking: list[set[str]] = []
    place_ego, allow = Session.place_ego, Session.allow_emergency_braking

    def spy_place(session: Session, shown: tuple[LaneBody, ...], *, speed: float) -> None:
        bodies.append(shown)
        place_ego(session, shown, speed=speed)

    def spy_allow(session: Session, names: Any) -> None:
        emergency_braking.append(set(names))
        allow(session, names)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Session, "place_ego", spy_place)
        patch.setattr(Session, "allow_emergency_braking", spy_allow)
        run = drive(site, files, new_maps=[])
    return Watched(run=run, bodies=bodies, emergency_braking=emergency_braking)


def test_ego_that_is_told_nothing_of_the_closed_lane_runs_into_its_devices(watched: Watched) -> None:
    assert watched.run.outcome in {Outcome.STRUCK_DEVICE, Outcome.ENTERED_CLOSED_AREA}
    assert watched.run.replans == ()


def test_traffic_that_the_ego_comes_into_is_that_of_the_fleets_own_run(watched: Watched, site: Site, files: SumoFiles) -> None:
    first = watched.run.followers["time_s"].min()
    met = watched.run.followers[watched.run.followers["time_s"] == first].set_index("vehicle_id")
    fleet = simulate_fleet(files, on_second=lambda _: None)
    then = fleet[np.isclose(fleet["time_s"], first - 0.1)].set_index("vehicle_id")  # SUMO logs a step by the time of its begin
    assert len(met) >= 5
    assert set(met.index) == set(then.index)
    assert np.hypot(met["x_m"] - then["x_m"], met["y_m"] - then["y_m"]).max() < 0.002  # the log is rounded to a millimetre


@pytest.mark.parametrize(("ahead_m", "stands_until_s", "waits_s"), [(25.0, 46.0, 6.0), (200.0, 46.0, 0.0), (25.0, 90.0, 12.0)])
def test_ego_waits_to_enter_while_it_would_have_to_brake_hard_for_one_ahead_and_its_time_to_drive_counts_from_the_entry(
    site: Site, files: SumoFiles, monkeypatch: pytest.MonkeyPatch, ahead_m: float, stands_until_s: float, waits_s: float
) -> None:
    own = Session.traffic

    def with_one_that_stands(session: Session) -> Traffic:
        if session.time >= stands_until_s:
            return own(session)
        return Traffic(
            ids=("stands",), poses=np.array([[site.start[0] + ahead_m, site.start[1], 0.0]]), speeds=np.zeros(1),
            accelerations=np.zeros(1), lengths=np.array([4.8]), widths=np.array([1.85]),
        )  # fmt: skip

    monkeypatch.setattr(Session, "traffic", with_one_that_stands)
    run = drive(site, files, new_maps=[], time_limit_s=12.0)
    assert run.outcome is Outcome.TIMED_OUT
    assert run.waited_s == pytest.approx(waits_s, abs=0.3)
    if stands_until_s > 40.0 + 12.0:
        assert run.log.empty
        assert run.reason == "no gap to enter the road within 12 s"
    else:
        assert run.log["time_s"].iloc[[0, -1]].tolist() == pytest.approx([40.0 + waits_s, 52.0 + waits_s], abs=0.4)


def test_drivers_are_shown_the_ego_as_wide_as_it_is_with_its_clearance_at_every_step_of_theirs(watched: Watched) -> None:
    assert len(watched.bodies) == pytest.approx(len(watched.run.log) / 2, abs=1)
    for (body,) in watched.bodies[:100]:  # in the middle of its lane
        assert body.width == pytest.approx(1.86 + 2 * 0.5, abs=0.01)


def test_ego_gets_twenty_commands_a_second_and_looks_around_ten_times(watched: Watched) -> None:
    run = watched.run
    np.testing.assert_allclose(run.log["time_s"].diff().iloc[1:], 0.05, atol=1e-6)
    looks = np.unique(run.traffic["time_s"])
    np.testing.assert_allclose(np.diff(looks).min(), 0.1, atol=1e-6)
    assert len(watched.emergency_braking) == pytest.approx(len(run.log) / 2, abs=1)


def test_vehicles_within_100_m_are_logged_at_each_look_and_all_once_a_second(watched: Watched) -> None:
    run = watched.run
    ego = run.log.set_index(run.log["time_s"].round(2))
    near = run.traffic.assign(time_s=run.traffic["time_s"].round(2))
    everybody = run.followers.assign(time_s=run.followers["time_s"].round(2))
    np.testing.assert_allclose(np.diff(np.unique(everybody["time_s"])), 1.0, atol=1e-6)
    apart = np.hypot(
        everybody["x_m"] - ego["x_m"].reindex(everybody["time_s"]).to_numpy(),
        everybody["y_m"] - ego["y_m"].reindex(everybody["time_s"]).to_numpy(),
    )
    assert (apart > 100).any()
    expected = everybody[apart <= 100]
    found = near[near["time_s"].isin(np.unique(everybody["time_s"]))]
    assert set(zip(found["time_s"], found["vehicle_id"], strict=True)) == set(
        zip(expected["time_s"], expected["vehicle_id"], strict=True)
    )


def test_vehicles_near_the_ego_may_brake_as_in_an_emergency_if_they_are_less_than_ten_metres_ahead(watched: Watched) -> None:
    run = watched.run
    times = run.log["time_s"].round(2).to_numpy()
    times = times[np.round(100 * times).astype(int) % 10 == 0]  # it looks around every tenth of a second
    assert len(times) == len(watched.emergency_braking)
    ego = run.log.set_index(run.log["time_s"].round(2))
    near = run.traffic.assign(time_s=run.traffic["time_s"].round(2))
    ahead = near["x_m"] - ego["x_m"].reindex(near["time_s"]).to_numpy()  # the road runs along +x
    clear = near[np.abs(ahead - 10.0) > 0.2]
    for time, names in zip(times, watched.emergency_braking, strict=True):
        rows = clear[clear["time_s"] == time]
        not_ahead = rows["x_m"] - ego["x_m"][time] < 10.0
        assert set(rows["vehicle_id"][not_ahead]) <= names
        assert not set(rows["vehicle_id"][~not_ahead]) & names


def true_map(site: Site) -> OccupancyGrid:
    return site.cells.with_p_occupied(np.where(site.nominal | site.drivable, 0.0, 1.0))


def test_map_that_arrives_on_the_way_leads_the_ego_past_the_closed_lane_without_a_jump(
    site: Site, files: SumoFiles, capfd: pytest.CaptureFixture[str]
) -> None:
    run = drive(site, files, new_maps=[new_map(true_map(site), site)])
    assert run.outcome is Outcome.REACHED_GOAL, run.reason
    # SUMO would warn of an "emergency stop" of the ego, which it counts to a lane that ends.
    assert capfd.readouterr() == ("", "")
    (replan,) = run.replans
    assert replan.time_s == pytest.approx(TOLD_S, abs=0.06)
    place = run.log["s_m"][run.log["time_s"] >= replan.time_s].iloc[0]
    assert replan.station_m == pytest.approx(place + 1.0 * SPEED, abs=1.5)
    # Nothing jumps: neither place, heading, the station of the log, nor the wheel.
    log = run.log
    assert np.hypot(log["x_m"].diff(), log["y_m"].diff()).max() < 1.05 * log["speed_mps"].max() * 0.05
    assert log["s_m"].diff().min() >= 0
    assert log["heading_rad"].diff().abs().max() < 2.5 / SPEED * 0.05  # 2 m/s2 of lateral acceleration, and a quarter more
    assert log["steering_rad"].diff().abs().max() < np.deg2rad(0.5)
    assert log["cross_track_m"].abs().max() < 0.2


def test_ego_without_a_way_on_stops_ahead_of_ground_that_is_not_free_and_says_why(site: Site, files: SumoFiles) -> None:
    walled = site.cells.with_p_occupied(np.where(site.nominal, 0.0, 1.0))
    run = drive(site, files, new_maps=[new_map(walled, site)])
    assert run.outcome is Outcome.NO_PATH
    assert "no free corridor" in run.reason
    assert run.reason.endswith("it stopped")
    assert [replan.status for replan in run.replans] == ["NO_PATH"]
    last = run.log.iloc[-1]
    assert last["speed_mps"] < 0.2
    front = last["x_m"] + CAR.axle_to_bumper_m
    assert front == pytest.approx(site.layout.start - 5.0, abs=2.0)  # the nominal lanes end where the zone begins
    assert run.log["speed_mps"].diff().min() > -4.0 * 0.05


def test_ego_passes_a_doubtful_place_slowly_and_speeds_up_behind_it(site: Site, files: SumoFiles) -> None:
    doubt = NewMap(time_s=TOLD_S, plan=None, free_until=lambda _path, _from: np.inf, doubtful=((225.0, 260.0),))
    run = drive(site, files, new_maps=[doubt], doubtful_speed_mps=9.0)
    assert run.replans == ()
    log = run.log
    assert log["speed_mps"][(log["x_m"] > 230.0) & (log["x_m"] < 260.0)].max() < 9.5
    assert log["speed_mps"][log["x_m"] < 180.0].min() > 13.0
    assert log["speed_mps"].iloc[-1] > 9.5
