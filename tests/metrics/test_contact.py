import numpy as np
import pytest
import shapely
from builders import paper_layout

from wzsumo.ego import Outcome
from wzsumo.metrics.contact import contact_along
from wzsumo.vehicle import VehicleGeometry

LAYOUT = paper_layout()
CAR = VehicleGeometry()


def straight(y, *, start=250.0, end=1400.0):
    x = np.arange(start, end, 0.5)
    return np.column_stack([x, np.full_like(x, y), np.zeros_like(x)])


def contact(poses):
    return contact_along(poses, vehicle=CAR, layout=LAYOUT)


def test_path_along_the_open_lanes_touches_nothing() -> None:
    result = contact(straight(1.0))
    assert result.outcome is Outcome.REACHED_GOAL
    assert result.n_devices_struck == 0
    assert np.isnan(result.first_contact_m)


def test_path_straight_on_in_the_closed_lane_ends_where_its_front_meets_the_taper() -> None:
    y = LAYOUT.road.lane_centre(2)
    result = contact(straight(y))
    line = LAYOUT.drivable_left
    s = np.arange(250.0, 1400.0, 0.01)
    reaches = s[np.argmax(line(s) < y + CAR.width_m / 2)]  # the left front corner meets the falling line of devices
    assert result.outcome in {Outcome.ENTERED_CLOSED_AREA, Outcome.STRUCK_DEVICE}
    assert result.first_contact_m == pytest.approx(reaches - 250.0 - CAR.axle_to_bumper_m, abs=0.6)


def test_devices_along_the_line_are_all_struck_and_each_counts_once() -> None:
    y, activity = LAYOUT.drivable_left(1000.0), LAYOUT.area("activity area")
    poses = straight(float(y), start=activity.start, end=activity.end - CAR.axle_to_bumper_m)
    rear, front = poses[0, 0] - CAR.rear_overhang_m, poses[-1, 0] + CAR.axle_to_bumper_m
    swept = shapely.box(rear, y - CAR.width_m / 2, front, y + CAR.width_m / 2)
    x, y, radius = LAYOUT.devices[["x_m", "y_m", "radius_m"]].to_numpy().T
    assert contact(poses).n_devices_struck == (shapely.distance(shapely.points(x, y), swept) <= radius).sum() >= 5


def test_path_beyond_the_edge_has_left_the_pavement() -> None:
    result = contact(straight(-LAYOUT.road.right_shoulder + 0.5, end=300.0))
    assert result.outcome is Outcome.LEFT_PAVEMENT
    assert result.first_contact_m == 0
