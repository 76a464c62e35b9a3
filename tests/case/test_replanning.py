from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from builders import paper_layout

from wzsumo.case.replanning import NewMap, PathFollower
from wzsumo.ego import EgoState
from wzsumo.path import ReferencePath
from wzsumo.planning.plan import Plan, PlanStatus
from wzsumo.scenario.scenario import Pose
from wzsumo.scenario.sections import ControlSection
from wzsumo.vehicle import VehicleGeometry

Y = 5.5  # the middle lane of a road along +x
NEW_Y = 6.5


def straight_path(start_m: float, y: float, *, length_m: float) -> ReferencePath:
    """A pose a metre from (start_m, y) on."""
    x = np.arange(start_m, start_m + length_m + 0.5)
    return ReferencePath(poses=np.column_stack([x, np.full_like(x, y), np.zeros_like(x)]))


def plan_with(path: ReferencePath | None) -> Plan:
    found = path is not None
    return Plan(
        status=PlanStatus.FOUND if found else PlanStatus.NO_PATH, reason="" if found else "no free corridor", path=path,
        min_clearance_m=1.0, max_p_occupied=0.0, risk_m=0.0, speed_mps=15.0, n_expansions=1, timings_ms={"total": 7.0},
    )  # fmt: skip


def new_map(plan: Callable[[Pose], Plan] | None, *, free_m: float = 1e6, **doubts: Any) -> NewMap:
    return NewMap(time_s=2.0, plan=plan, free_until=lambda _path, _from: free_m, **doubts)


def at(x: float) -> EgoState:
    return EgoState(x=x, y=Y, heading=0.0, speed=15.0)


@pytest.fixture
def follower() -> PathFollower:
    """A follower of a path from x = 100 m to 300 m, whose ego is at x = 150 m."""
    control = ControlSection(target_speed_mps=15.0)
    made = PathFollower(
        straight_path(100.0, Y, length_m=200.0), layout=paper_layout(), vehicle=VehicleGeometry(), control=control
    )
    made.controller.command(at(150.0), dt=0.05)
    return made


def test_new_plan_begins_where_the_ego_will_be_in_one_second(follower: PathFollower) -> None:
    starts: list[Pose] = []

    def plan(start: Pose) -> Plan:
        starts.append(start)
        return plan_with(straight_path(165.0, NEW_Y, length_m=50.0))

    replan = follower.replan(new_map(plan), at(150.0), time=42.0)
    assert replan is not None
    assert starts == [(165.0, Y, 0.0)]
    assert (replan.time_s, replan.station_m, replan.reason, replan.plan_ms) == (42.0, 65.0, "", 7.0)


def test_stations_go_on_counting_from_where_the_ego_set_out(follower: PathFollower) -> None:
    new = straight_path(165.0, NEW_Y, length_m=50.0)
    follower.replan(new_map(lambda _: plan_with(new)), at(150.0), time=42.0)
    follower.controller.command(at(150.0), dt=0.05)
    outlook = follower.outlook(at(150.0))
    assert outlook.station == pytest.approx(50.0)
    assert outlook.path.poses[:65, 1] == pytest.approx(Y)
    assert outlook.path.poses[65:, 1] == pytest.approx(NEW_Y)
    assert len(outlook.path.poses) == 65 + 51
    assert len(outlook.desired_speeds) == 65 + 51


def test_plan_without_a_path_leaves_the_ego_on_its_own(follower: PathFollower) -> None:
    before = follower.outlook(at(150.0)).path
    replan = follower.replan(new_map(lambda _: plan_with(None)), at(150.0), time=42.0)
    assert replan is not None
    assert replan.reason == "no free corridor"
    assert follower.outlook(at(150.0)).path is before


def test_new_plan_near_the_end_begins_before_the_last_pose(follower: PathFollower) -> None:
    starts: list[Pose] = []

    def plan(start: Pose) -> Plan:
        starts.append(start)
        return plan_with(None)

    follower.controller.command(at(299.0), dt=0.05)
    follower.replan(new_map(plan), at(299.0), time=42.0)
    assert starts == [(299.0, Y, 0.0)]


def test_outlook_wants_the_target_speed(follower: PathFollower) -> None:
    outlook = follower.outlook(at(150.0))
    assert outlook.station == pytest.approx(50.0)
    assert outlook.desired_speeds == pytest.approx(np.full(201, 15.0))


def test_ego_without_a_way_on_brakes_to_stop_five_metres_ahead_of_where_its_path_is_free(follower: PathFollower) -> None:
    follower.replan(new_map(lambda _: plan_with(None), free_m=120.0), at(150.0), time=42.0)
    assert follower.has_no_way_on
    follower.controller.command(at(150.0), dt=0.05)  # 50 m along its path
    assert follower.ceiling(at(150.0)) == pytest.approx(-(15.0**2) / (2 * (120.0 - 5.0 - 50.0)))


def test_ego_drives_on_when_a_later_map_shows_a_way(follower: PathFollower) -> None:
    follower.replan(new_map(lambda _: plan_with(None), free_m=120.0), at(150.0), time=42.0)
    path = straight_path(165.0, NEW_Y, length_m=50.0)
    follower.replan(new_map(lambda _: plan_with(path)), at(150.0), time=43.0)
    assert not follower.has_no_way_on
    assert follower.ceiling(at(150.0)) == np.inf


def test_ego_slows_down_where_its_map_is_doubtful_and_only_there() -> None:
    follower = PathFollower(
        straight_path(100.0, Y, length_m=200.0), layout=paper_layout(), vehicle=VehicleGeometry(),
        control=ControlSection(target_speed_mps=15.0), doubtful_speed_mps=10.0,
    )  # fmt: skip
    before = follower.outlook(at(150.0)).path
    assert follower.replan(new_map(None, doubtful=((200.0, 250.0),)), at(150.0), time=1.0) is None
    assert follower.outlook(at(150.0)).path is before
    ceilings = []
    for x in (110.0, 165.0, 205.0, 260.0):
        follower.controller.command(at(x), dt=0.05)
        ceilings.append(follower.ceiling(at(x)))
    assert ceilings[0] == ceilings[3] == np.inf
    assert -2.5 < ceilings[1] < -1.4  # it brakes ahead of it
    assert ceilings[2] == -2.0
