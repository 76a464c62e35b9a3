"""How the ego minds others does not depend on where north is."""

import numpy as np
import pytest
from behaviour.outlooks import CAR, LAYOUT, MIDDLE, RIGHT, one_vehicle, outlook
from builders import paper_road, paper_work_zone, to_world
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.behaviour.ego_outlook import EgoOutlook, path_on_road
from wzsumo.behaviour.giving_way import yield_point_ahead
from wzsumo.behaviour.leaders import leader_ahead
from wzsumo.ego import EgoState
from wzsumo.frames import FloatArray
from wzsumo.mutcd.layout import lay_out
from wzsumo.path import ReferencePath
from wzsumo.traffic import Traffic

NORTH_EAST = np.deg2rad(50.0)
# The paper's road with its right edge line from the origin to the north-east, as a road of two points down its middle.
_MIDDLE_LINE = to_world((0.0, 0.0, NORTH_EAST), np.array([[0.0, MIDDLE], [5000 * 0.3048, MIDDLE]]))
TURNED_LAYOUT = lay_out(paper_work_zone(), paper_road(length_ft=None, reference_points_m=tuple(map(tuple, _MIDDLE_LINE))))


def turned_poses(poses: FloatArray) -> FloatArray:
    return np.column_stack([to_world((0.0, 0.0, NORTH_EAST), poses[:, :2]), poses[:, 2] + NORTH_EAST])


def turned_traffic(traffic: Traffic) -> Traffic:
    return Traffic(
        ids=traffic.ids, poses=turned_poses(traffic.poses), speeds=traffic.speeds, accelerations=traffic.accelerations,
        lengths=traffic.lengths, widths=traffic.widths,
    )  # fmt: skip


def turned_outlook(ego: EgoOutlook) -> EgoOutlook:
    path = ReferencePath(poses=turned_poses(ego.path.poses))
    ((x, y, heading),) = turned_poses(ego.state.pose[None])
    return EgoOutlook(
        path=path_on_road(path, layout=TURNED_LAYOUT, vehicle=CAR), station=ego.station, vehicle=CAR,
        state=EgoState(x=float(x), y=float(y), heading=float(heading), speed=ego.state.speed),
        desired_speeds=ego.desired_speeds, acceleration=ego.acceleration,
    )  # fmt: skip


@given(
    behind=st.floats(5, 60), speed=st.floats(0, 30), heading=st.floats(-0.2, 0.2), oncoming=st.booleans(),
    slope=st.sampled_from([0.05, 0.1]),
)  # fmt: skip
def test_yield_point_is_the_same_on_a_road_that_runs_elsewhere(
    behind: float, speed: float, heading: float, oncoming: bool, slope: float
) -> None:
    ego = outlook(RIGHT, slope=slope)
    place, turned = (behind + 40.0, heading + np.pi) if oncoming else (-behind, heading)
    other = one_vehicle(place, MIDDLE, speed=speed, heading=turned)
    here = yield_point_ahead(ego, other, layout=LAYOUT)
    there = yield_point_ahead(turned_outlook(ego), turned_traffic(other), layout=TURNED_LAYOUT)
    assert there == (None if here is None else pytest.approx(here, abs=1e-5))


@given(ahead=st.floats(8, 60), aside=st.floats(-4, 4), speed=st.floats(0, 30), heading=st.floats(-1.0, 1.0))
def test_leader_is_the_same_on_a_road_that_runs_elsewhere(ahead: float, aside: float, speed: float, heading: float) -> None:
    ego = outlook(RIGHT)
    other = one_vehicle(ahead, RIGHT + aside, speed=speed, heading=heading)
    here = leader_ahead(ego, other, layout=LAYOUT)
    there = leader_ahead(turned_outlook(ego), turned_traffic(other), layout=TURNED_LAYOUT)
    assert (here is None) == (there is None)
    if here is not None and there is not None:
        assert there.gap_m == pytest.approx(here.gap_m, abs=1e-5)


def test_oncoming_vehicle_is_yielded_to_where_the_road_runs_elsewhere() -> None:
    ego, other = outlook(RIGHT, slope=0.1), one_vehicle(60.0, MIDDLE, speed=15.0, heading=np.pi)
    assert yield_point_ahead(ego, other, layout=LAYOUT) is not None
    assert yield_point_ahead(turned_outlook(ego), turned_traffic(other), layout=TURNED_LAYOUT) is not None
