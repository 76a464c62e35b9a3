import numpy as np

from wzsumo.ego import EgoState
from wzsumo.path import ReferencePath
from wzsumo.simulation.session import Traffic
from wzsumo.study.closed_loop import _passing
from wzsumo.vehicle import VehicleGeometry

EGO = EgoState(x=0.0, y=0.0, heading=0.0, speed=10.0)


def one_vehicle(x, y, *, speed):
    return Traffic(
        ids=("other",),
        poses=np.array([[x, y, 0.0]]),
        speeds=np.array([speed]),
        lengths=np.array([4.8]),
        widths=np.array([1.85]),
    )


def path_to_the_left(*, slope):
    s = np.arange(0.0, 100.0)
    return ReferencePath(poses=np.column_stack([s, slope * s, np.full_like(s, np.arctan(slope))]))


def test_vehicle_that_passes_where_the_ego_drifts_to_is_given_way():
    # 3.6 m to the left and 20 m behind at 20 m/s: alongside after 2 s, when the ego has drifted 2 m towards it.
    leader = _passing(EGO, one_vehicle(-20, 3.6, speed=20), path_to_the_left(slope=0.1), 0.0, VehicleGeometry())
    assert leader is not None
    assert leader.speed_mps == 0
    assert 10 <= leader.gap_m <= 20


def test_vehicle_that_passes_in_its_own_lane_beside_a_straight_path_is_not():
    assert _passing(EGO, one_vehicle(-20, 3.6, speed=20), path_to_the_left(slope=0.0), 0.0, VehicleGeometry()) is None


def test_vehicle_that_follows_in_the_egos_own_way_is_not():
    assert _passing(EGO, one_vehicle(-20, 0.0, speed=20), path_to_the_left(slope=0.1), 0.0, VehicleGeometry()) is None
