import numpy as np
import pytest
import shapely
from builders import paper_layout, to_world

from wzsumo.metrics.clearance import clearance_along
from wzsumo.path import swept_pieces
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
CORNERS = [(-0.92, -0.93), (3.72, -0.93), (3.72, 0.93), (-0.92, 0.93)]  # 4.64 x 1.86 m, rear axle 0.92 m from the rear


def weaving_poses(layout, *, n=60):
    """Rear-axle poses through the zone that cross its lanes and its line of devices."""
    s = np.linspace(layout.start, layout.end, n)
    d = 4.0 + 3.0 * np.sin(s / 40)
    x, y = layout.road.to_xy(s, d).T
    return np.column_stack([x, y, np.arctan2(np.gradient(y), np.gradient(x))])


def test_outlines_of_many_poses_are_those_of_each() -> None:
    poses = np.random.default_rng(1).uniform(-3, 3, (20, 3))
    expected = np.array([to_world(pose, CORNERS) for pose in poses])
    assert CAR.outline(poses) == pytest.approx(expected, abs=1e-12)
    assert CAR.outline(poses[0]) == pytest.approx(expected[0], abs=1e-12)


@pytest.mark.parametrize("shift_m", [0.0, 40.0])
def test_clearance_to_devices_is_the_distance_to_the_union_of_all_that_is_swept(shift_m: float) -> None:
    layout = paper_layout()
    poses = weaving_poses(layout) - (0.0, shift_m, 0.0)  # far below the road no device is touched
    swept = shapely.union_all(swept_pieces(poses, CAR))
    nearest = shapely.distance(layout.device_outlines, swept).min()
    found = clearance_along(poses, vehicle=CAR, layout=layout)
    assert found.min_clearance_devices_m == pytest.approx(nearest, abs=1e-9)
    assert (found.min_clearance_devices_m > 0) == (shift_m > 0)


def test_clearance_beside_the_edge_of_the_pavement_is_what_is_left_beside_the_car() -> None:
    layout = paper_layout()
    edge = -layout.road.right_shoulder
    poses = [(x, edge + 0.93 + 0.5, 0.0) for x in (100.0, 110.0)]  # half a metre between the outline and the edge
    assert clearance_along(poses, vehicle=CAR, layout=layout).min_clearance_road_edge_m == pytest.approx(0.5, abs=1e-9)
