import numpy as np
import pytest
from behaviour.outlooks import CAR, LAYOUT, outlook
from builders import bent_road

from wzsumo.behaviour.ego_outlook import half_extents, path_on_road
from wzsumo.mutcd.layout import lay_out
from wzsumo.path import ReferencePath


@pytest.mark.parametrize(
    ("turned_deg", "along", "across"),
    [
        (0, 2.4, 0.9),
        (90, 0.9, 2.4),
        (-90, 0.9, 2.4),
        (180, 2.4, 0.9),
        (30, 2.4 * 0.75**0.5 + 0.45, 0.9 * 0.75**0.5 + 1.2),
        (-30, 2.4 * 0.75**0.5 + 0.45, 0.9 * 0.75**0.5 + 1.2),
    ],
)
def test_body_that_is_turned_takes_up_what_its_corners_reach(turned_deg: float, along: float, across: float) -> None:
    half_along, half_across = half_extents(np.deg2rad([turned_deg]), 4.8, 1.8)
    assert (half_along[0], half_across[0]) == pytest.approx((along, across))


def test_path_on_a_straight_road_has_the_centres_of_the_vehicle_in_front_of_its_rear_axles() -> None:
    path = outlook(1.0, slope=0.1).path
    heading = np.arctan(0.1)
    assert path.stations[10] == pytest.approx(10 * np.hypot(1, 0.1))
    expected = (
        60 + 1.4 * np.cos(heading),
        1.0 + 1.0 + 1.4 * np.sin(heading),
        heading,
    )  # the road runs along +x from its origin
    assert tuple(path.centres_on_road[10]) == pytest.approx(expected)


def test_path_along_a_bend_keeps_its_offset_and_is_not_turned_from_the_road() -> None:
    road = bent_road(1500.0)
    layout = lay_out(LAYOUT.work_zone, road)
    stations = np.arange(300.0, 400.0)
    poses = np.column_stack([road.to_xy(stations, np.full_like(stations, 2.0)), road.heading_at(stations)])
    on_road = path_on_road(ReferencePath(poses=poses), layout=layout, vehicle=CAR).centres_on_road
    assert on_road[:, 0] == pytest.approx(stations + CAR.axle_to_centre_m, abs=0.02)
    assert on_road[:, 1] == pytest.approx(2.0, abs=0.01)
    assert on_road[:, 2] == pytest.approx(0.0, abs=0.01)  # 1.4 m of a bend of 457 m
