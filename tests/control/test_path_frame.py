import numpy as np
import pytest
from control.drives import circle_path, straight_path, work_zone_path
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString, Point

from wzsumo.control.path_frame import PathFrame
from wzsumo.errors import InputError
from wzsumo.path import ReferencePath

ZONE = work_zone_path()
ZONE_LINE = LineString(ZONE.poses[:, :2])


@given(x=st.floats(1, 899), y=st.floats(-12, 5), start=st.integers(0, 1799))
def test_place_beside_a_work_zone_path_is_that_of_shapely_from_wherever_the_search_starts(
    x: float, y: float, start: int
) -> None:
    frame = PathFrame.of(ZONE)
    for near in (None, start):
        position = frame.locate(x, y, near=near)
        assert position.station_m == pytest.approx(ZONE_LINE.project(Point(x, y)), abs=1e-6)
        assert abs(position.cross_track_m) == pytest.approx(ZONE_LINE.distance(Point(x, y)), abs=1e-6)


@pytest.mark.parametrize("offset", [-2.0, 0.5, 3.0])
def test_cross_track_is_positive_to_the_left_of_a_circle(offset: float) -> None:
    frame = PathFrame.of(circle_path(50.0, turns=0.5, step=0.05))
    inside = 50.0 - offset  # the centre of a left-hand circle is on its left
    position = frame.locate(inside * np.sin(1.0), 50.0 - inside * np.cos(1.0), near=None)
    assert position.cross_track_m == pytest.approx(offset, abs=1e-4)
    assert position.station_m == pytest.approx(50.0, abs=0.01)  # the polyline's chords are 0.05 m long


@given(station=st.floats(0, 900))
def test_point_at_a_station_is_that_of_shapely(station: float) -> None:
    expected = ZONE_LINE.interpolate(station)
    assert PathFrame.of(ZONE).point_at(station) == pytest.approx((expected.x, expected.y), abs=1e-9)


@pytest.mark.parametrize(("station", "point"), [(-3.0, (-3.0, 0.0)), (14.0, (14.0, 0.0))])
def test_a_path_goes_on_straight_before_its_start_and_past_its_end(station: float, point: tuple[float, float]) -> None:
    frame = PathFrame.of(straight_path(10.0))
    assert frame.point_at(station) == pytest.approx(point)
    assert frame.locate(point[0], 0.7, near=None).station_m == pytest.approx(station)
    assert frame.locate(point[0], 0.7, near=None).cross_track_m == pytest.approx(0.7)


@pytest.mark.parametrize("near", [0, 1])
def test_outside_a_corner_the_corner_itself_is_nearest(near: int) -> None:
    bent = ReferencePath(poses=np.array([[0, 0, 0], [10, 0, 0], [10, 10, np.pi / 2]], dtype=float))
    position = PathFrame.of(bent).locate(13.0, -4.0, near=near)
    assert (position.station_m, position.cross_track_m) == pytest.approx((10.0, -5.0))


def test_on_a_loop_the_search_stays_on_its_branch() -> None:
    frame = PathFrame.of(circle_path(20.0, turns=1.02))
    end = frame.locate(0.3, 0.0, near=len(frame.directions) - 1)
    start = frame.locate(0.3, 0.0, near=0)
    assert end.station_m - start.station_m == pytest.approx(2 * np.pi * 20.0, abs=0.05)


@given(radius=st.floats(1, 30), x=st.floats(0, 880), y=st.floats(-8, 1))
def test_first_point_beyond_is_the_first_in_a_plain_search_of_all_poses(radius: float, x: float, y: float) -> None:
    frame = PathFrame.of(ZONE)
    segment = frame.locate(x, y, near=None).segment
    far = [point for point in ZONE.poses[segment + 1 :, :2] if np.hypot(*(point - (x, y))) >= radius]
    found = frame.first_point_beyond(radius, x=x, y=y, segment=segment)
    if far:
        assert found == pytest.approx(tuple(far[0]))
    else:
        assert np.hypot(found[0] - x, found[1] - y) == pytest.approx(radius)
        assert found[0] > 900.0


def test_curvature_of_a_circle_is_its_inverse_radius() -> None:
    frame = PathFrame.of(circle_path(-80.0))
    assert frame.curvature_at(100.3) == pytest.approx(-1 / 80, rel=1e-5)  # chord for arc
    assert frame.curvature_at(-1.0) == frame.curvature_at(1e4) == 0.0


def test_poses_that_repeat_change_nothing() -> None:
    repeated = ReferencePath(poses=np.repeat(ZONE.poses, 2, axis=0))
    assert PathFrame.of(repeated) == PathFrame.of(ZONE)


def test_a_path_in_one_place_is_refused() -> None:
    with pytest.raises(InputError, match="3 poses in one place has no direction"):
        PathFrame.of(ReferencePath(poses=np.zeros((3, 3))))
