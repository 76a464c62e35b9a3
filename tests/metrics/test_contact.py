import numpy as np
import pytest
import shapely
from builders import paper_layout

from wzsumo.ego import EgoState, Outcome
from wzsumo.frames import FloatArray
from wzsumo.metrics.contact import ContactChecker, PathContact
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

LAYOUT = paper_layout()
CAR = VehicleGeometry()
CHECKER = ContactChecker(LAYOUT, CAR)
FOOT_M = 0.3048


def straight(y: float, *, start: float = 250.0, end: float = 1400.0) -> FloatArray:
    x = np.arange(start, end, 0.5)
    return np.column_stack([x, np.full_like(x, y), np.zeros_like(x)])


def contact(poses: FloatArray, layout: WorkZoneLayout = LAYOUT) -> PathContact:
    return ContactChecker(layout, CAR).contact_along(poses)


def at(x: float, y: float, heading: float = 0.0) -> EgoState:
    return EgoState(x=x, y=y, heading=heading, speed=10.0)


def one_vehicle(x: float, y: float, *, length: float = 4.8, width: float = 1.8) -> Traffic:
    """Traffic of one vehicle, called v1, with its centre at (x, y) and headed along +x."""
    still = np.zeros(1)
    return Traffic(
        ids=("v1",), poses=np.array([[x, y, 0.0]]), speeds=still, accelerations=still,
        lengths=np.array([length]), widths=np.array([width]),
    )  # fmt: skip


NO_TRAFFIC = one_vehicle(-1000.0, 0.0)


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
    y, activity = float(LAYOUT.drivable_left(1000.0)), LAYOUT.area("activity area")
    poses = straight(y, start=activity.start, end=activity.end - CAR.axle_to_bumper_m)
    rear, front = poses[0, 0] - CAR.rear_overhang_m, poses[-1, 0] + CAR.axle_to_bumper_m
    swept = shapely.box(rear, y - CAR.width_m / 2, front, y + CAR.width_m / 2)
    devices = LAYOUT.devices[["x_m", "y_m", "radius_m"]].to_numpy()
    n_near = (shapely.distance(shapely.points(devices[:, :2]), swept) <= devices[:, 2]).sum()
    assert contact(poses).n_devices_struck == n_near >= 5


def test_path_across_a_barrier_strikes_the_piece_that_it_meets_first() -> None:
    layout = paper_layout(work_space_device="barrier")
    activity = layout.area("activity area")
    pieces = layout.devices[layout.devices["kind"] == "barrier"]
    # The face of the wall is at 12 ft. A piece is 12.5 ft long: half way between the middles of two, no disc of 1 ft is near.
    joint = float(pieces["x_m"].iloc[5] + pieces["x_m"].iloc[6]) / 2
    assert activity.start < joint < activity.end
    y = np.arange(-1.0, 3.0, 0.25)
    poses = np.column_stack([np.full_like(y, joint), y, np.full_like(y, np.pi / 2)])  # square to the wall, 1.86 m wide
    result = contact(poses, layout)
    assert result.outcome is Outcome.STRUCK_DEVICE
    assert result.n_devices_struck == 2
    assert result.first_contact_m == pytest.approx(1.0)  # the front, 3.72 m ahead, is beyond 12 ft = 3.66 m from y = 0 on


def test_path_along_the_inside_of_a_barrier_strikes_every_piece_of_it() -> None:
    layout = paper_layout(work_space_device="barrier")
    activity = layout.area("activity area")
    wall_m = 12 * FOOT_M
    poses = straight(wall_m - 0.92, start=activity.start + 10, end=activity.end - 10)  # the left side 1 cm inside the face
    front, rear = poses[-1, 0] + CAR.axle_to_bumper_m, poses[0, 0] - CAR.rear_overhang_m
    pieces = layout.devices[layout.devices["kind"] == "barrier"]
    half = pieces["length_m"] / 2
    n_beside = int(((pieces["x_m"] - half <= front) & (pieces["x_m"] + half >= rear)).sum())
    result = contact(poses, layout)
    assert (result.outcome, result.first_contact_m) == (Outcome.STRUCK_DEVICE, 0.0)
    assert result.n_devices_struck == n_beside > 40
    assert contact(poses - (0.0, 0.02, 0.0), layout).outcome is Outcome.REACHED_GOAL  # 1 cm beside the face


def test_path_beyond_the_edge_has_left_the_pavement() -> None:
    result = contact(straight(-LAYOUT.road.right_shoulder + 0.5, end=300.0))
    assert result.outcome is Outcome.LEFT_PAVEMENT
    assert result.first_contact_m == 0


@pytest.mark.parametrize(
    ("y", "outcome"),
    [
        (-10 * FOOT_M + 0.94, Outcome.REACHED_GOAL),  # the right side, 0.93 m beside the axle, 1 cm inside the shoulder's edge
        (-10 * FOOT_M + 0.92, Outcome.LEFT_PAVEMENT),
        (48 * FOOT_M - 0.94, Outcome.REACHED_GOAL),  # three lanes and a left shoulder of 12 ft each
        (48 * FOOT_M - 0.92, Outcome.LEFT_PAVEMENT),
    ],
)
def test_shoulders_are_pavement_up_to_their_outer_edge(y: float, outcome: Outcome) -> None:
    assert contact(straight(y, start=20.0, end=60.0)).outcome is outcome


def test_first_contact_is_the_length_of_the_path_up_to_it() -> None:
    # 45 degrees to the right from y = 1 m: the right front corner is beyond -3.048 m once the axle is below -1.0752 m.
    along = np.arange(0.0, 6.0, 0.25)
    heading = -np.pi / 4
    poses = np.column_stack([50 + along * np.cos(heading), 1 + along * np.sin(heading), np.full_like(along, heading)])
    corner = 3.72 * np.sin(np.pi / 4) + 0.93 * np.cos(np.pi / 4)
    expected = np.ceil((1 + 10 * FOOT_M - corner) / np.sin(np.pi / 4) / 0.25) * 0.25
    result = contact(poses)
    assert result.outcome is Outcome.LEFT_PAVEMENT
    assert result.first_contact_m == pytest.approx(expected)


def test_state_in_the_open_lanes_touches_nothing_and_one_beyond_the_edge_has_left_the_pavement() -> None:
    assert CHECKER.contact_now(at(260.0, 1.0), NO_TRAFFIC) is None
    assert CHECKER.contact_now(at(260.0, -10 * FOOT_M), NO_TRAFFIC) == (
        Outcome.LEFT_PAVEMENT,
        "part of the outline is off the pavement at (260.0, -3.0) m",
    )


def test_pavement_goes_on_beyond_the_ends_of_the_road() -> None:
    end = LAYOUT.road.length
    assert CHECKER.contact_now(at(end + 40.0, 1.0), NO_TRAFFIC) is None
    assert CHECKER.contact_now(at(-40.0, 1.0), NO_TRAFFIC) is None


@pytest.mark.parametrize(
    ("x", "y", "touches"),
    [
        (3.72 + 2.39, 0.0, True),  # its rear, 2.4 m behind its centre, 1 cm behind the ego's front
        (3.72 + 2.41, 0.0, False),
        (-0.92 - 2.39, 0.0, True),
        (-0.92 - 2.41, 0.0, False),
        (1.4, 0.93 + 0.89, True),  # half widths of 0.93 m and 0.9 m
        (1.4, 0.93 + 0.91, False),
    ],
)
def test_state_collides_with_a_vehicle_whose_outline_overlaps_its_own(x: float, y: float, touches: bool) -> None:
    found = CHECKER.contact_now(at(100.0, 5.0), one_vehicle(100 + x, 5 + y))
    assert found == ((Outcome.COLLIDED, "the outline overlaps vehicle v1 at (100.0, 5.0) m") if touches else None)


def test_state_collides_with_the_end_of_a_long_vehicle() -> None:
    # A road train of 53.5 m, the longest in Australia: its centre is 26.7 m ahead of the ego's front, its rear 5 cm inside.
    found = CHECKER.contact_now(at(100.0, 5.0), one_vehicle(100 + 3.72 + 26.7, 5.0, length=53.5))
    assert found is not None
    assert found[0] is Outcome.COLLIDED


def test_state_against_the_wall_in_the_closed_area_has_struck_the_wall_first_and_a_vehicle_before_it() -> None:
    layout = paper_layout(work_space_device="barrier")
    area = layout.area("activity area")
    checker, x = ContactChecker(layout, CAR), (area.start + area.end) / 2
    across = at(x, 12 * FOOT_M, np.pi / 2)
    found = checker.contact_now(across, NO_TRAFFIC)
    assert found is not None
    assert found[0] is Outcome.STRUCK_DEVICE
    hit = checker.contact_now(across, one_vehicle(x, 12 * FOOT_M))
    assert hit is not None
    assert hit[0] is Outcome.COLLIDED


def test_state_between_two_devices_has_entered_the_closed_area() -> None:
    area = LAYOUT.area("activity area")
    beside = LAYOUT.devices[LAYOUT.devices["s_m"].between(area.start, area.end)]
    between = float(beside["x_m"].iloc[2] + beside["x_m"].iloc[3]) / 2
    found = CHECKER.contact_now(at(between - 1.4, 12 * FOOT_M), NO_TRAFFIC)
    assert found is not None
    assert found[0] is Outcome.ENTERED_CLOSED_AREA


def test_state_and_path_agree_on_what_they_touch() -> None:
    rng = np.random.default_rng(1)
    for x, y, heading in rng.uniform([260, -4, -1], [1400, 16, 1], (200, 3)):
        now = CHECKER.contact_now(at(x, y, heading), NO_TRAFFIC)
        along = CHECKER.contact_along([(x, y, heading), (x, y, heading)])
        assert along.outcome is (now[0] if now else Outcome.REACHED_GOAL)
