"""How the ego minds others does not depend on where north is."""

import numpy as np
from behaviour.outlooks import CAR, LAYOUT, MIDDLE, RIGHT, one_vehicle, outlook, together
from builders import paper_road, paper_work_zone, to_world

from wzsumo.behaviour.ego_outlook import EgoOutlook, path_on_road
from wzsumo.behaviour.speed_plan_spec import SpeedPlanSpec
from wzsumo.behaviour.ways_of_others import ways_of_others
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
        desired_speeds=ego.desired_speeds,
    )  # fmt: skip


def test_ways_are_the_same_on_a_road_that_runs_elsewhere() -> None:
    times = np.arange(0.0, 8.0, 0.5)
    traffic = together(one_vehicle(30.0, RIGHT, speed=7), one_vehicle(-25.0, MIDDLE, speed=20.0, heading=0.02))
    ego = outlook(slope=0.05)
    here = ways_of_others(ego, traffic, layout=LAYOUT, times=times, spec=SpeedPlanSpec())
    there = ways_of_others(
        turned_outlook(ego), turned_traffic(traffic), layout=TURNED_LAYOUT, times=times, spec=SpeedPlanSpec()
    )
    assert len(here.enters) == 2
    for name in here._fields:
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), atol=1e-4)
