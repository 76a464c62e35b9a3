import numpy as np
import pytest
import shapely
from builders import paper_layout

from wzsumo.frames import FloatArray
from wzsumo.metrics.clearance import clearance_along
from wzsumo.path import swept_pieces
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

CAR = VehicleGeometry()
CORNERS = np.array([-0.92 - 0.93j, 3.72 - 0.93j, 3.72 + 0.93j, -0.92 + 0.93j])  # 4.64 x 1.86 m, rear axle 0.92 m from the rear
LAYOUT = paper_layout()
FOOT_M = 0.3048


def weaving_poses(layout: WorkZoneLayout, *, n: int = 60) -> FloatArray:
    """Rear-axle poses through the zone that cross its lanes and its line of devices."""
    s = np.linspace(layout.start, layout.end, n)
    d = 4.0 + 3.0 * np.sin(s / 40)
    x, y = layout.road.to_xy(s, d).T
    return np.column_stack([x, y, np.arctan2(np.gradient(y), np.gradient(x))])


def straight(y: float, *, start: float, end: float, step: float = 0.5) -> FloatArray:
    x = np.arange(start, end + step / 2, step)
    return np.column_stack([x, np.full_like(x, y), np.zeros_like(x)])


def test_outlines_of_many_poses_are_those_of_each() -> None:
    poses = np.random.default_rng(1).uniform(-3, 3, (20, 3))
    corners = (poses[:, 0] + 1j * poses[:, 1])[:, None] + CORNERS * np.exp(1j * poses[:, 2])[:, None]
    expected = np.stack([corners.real, corners.imag], axis=-1)
    assert CAR.outline(poses) == pytest.approx(expected, abs=1e-12)
    assert CAR.outline(poses[0]) == pytest.approx(expected[0], abs=1e-12)


@pytest.mark.parametrize("shift_m", [0.0, 40.0])
def test_clearance_to_devices_is_the_distance_to_the_union_of_all_that_is_swept(shift_m: float) -> None:
    poses = weaving_poses(LAYOUT) - (0.0, shift_m, 0.0)  # far below the road no device is touched
    swept = shapely.union_all(swept_pieces(poses, CAR))
    nearest = shapely.distance(LAYOUT.device_outlines, swept).min()
    found = clearance_along(poses, vehicle=CAR, layout=LAYOUT)
    assert found.min_clearance_devices_m == pytest.approx(nearest, abs=1e-9)
    assert (found.min_clearance_devices_m > 0) == (shift_m > 0)


def test_clearance_to_a_barrier_is_that_to_its_face_all_along_the_wall() -> None:
    layout = paper_layout(work_space_device="barrier")
    area = layout.area("activity area")
    poses = straight(12 * FOOT_M - 0.93 - 0.4, start=area.start + 20, end=area.start + 22)  # 0.4 m beside the face at 12 ft
    assert clearance_along(poses, vehicle=CAR, layout=layout).min_clearance_devices_m == pytest.approx(0.4, abs=1e-4)


@pytest.mark.parametrize(
    ("y", "clearance_m"),
    [
        (-10 * FOOT_M + 0.93 + 0.5, 0.5),  # half a metre between the outline and the edge of the right shoulder of 10 ft
        (48 * FOOT_M - 0.93 - 0.3, 0.3),  # three lanes and the left shoulder, 12 ft each
        (-10 * FOOT_M + 0.93 - 0.2, -0.2),  # beyond the edge
    ],
)
def test_clearance_beside_the_edge_of_the_pavement_is_what_is_left_beside_the_car(y: float, clearance_m: float) -> None:
    poses = straight(y, start=100.0, end=110.0)
    found = clearance_along(poses, vehicle=CAR, layout=LAYOUT)
    assert found.min_clearance_road_edge_m == pytest.approx(clearance_m, abs=1e-9)


def test_closed_area_share_is_that_of_the_length_that_is_driven_in_it() -> None:
    # Along the left shoulder's middle, at 42 ft: the outline reaches up to 45.05 ft, where the shoulder taper (from 48 ft at
    # 243.84 m to 36 ft at 316.992 m) lies at 243.84 + (48 - 45.051) / 12 * 73.152 m.
    y = 42 * FOOT_M
    front_meets = 243.84 + (48 - (42 + 0.93 / FOOT_M)) / 12 * 73.152 - 3.72
    poses = straight(y, start=200.0, end=300.0, step=0.1)
    expected = (300.0 - front_meets) / 100.0
    found = clearance_along(poses, vehicle=CAR, layout=LAYOUT)
    assert found.closed_area_share == pytest.approx(expected, abs=0.002)


def test_path_that_stays_out_of_the_closed_area_has_no_share_and_one_inside_all() -> None:
    outside, inside = straight(1.0, start=300.0, end=320.0), straight(30 * FOOT_M, start=950.0, end=970.0)
    assert clearance_along(outside, vehicle=CAR, layout=LAYOUT).closed_area_share == 0
    assert clearance_along(inside, vehicle=CAR, layout=LAYOUT).closed_area_share == pytest.approx(1)


def test_step_with_one_end_in_the_closed_area_counts_half() -> None:
    poses = np.array([(900.0, 1.0, 0.0), (950.0, 30 * FOOT_M, 0.0)])
    assert clearance_along(poses, vehicle=CAR, layout=LAYOUT).closed_area_share == pytest.approx(0.5)


def test_path_that_stands_still_has_no_length_in_the_closed_area() -> None:
    poses = np.array([(950.0, 30 * FOOT_M, 0.0)] * 2)
    assert clearance_along(poses, vehicle=CAR, layout=LAYOUT).closed_area_share == 0
