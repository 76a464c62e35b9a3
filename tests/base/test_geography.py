"""Frames against PROJ's own geodesics and published coordinates."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from wzsumo.errors import SpecError
from wzsumo.geography import LocalFrame, frame_of_crs, local_frame, lonlat_of_crs, utm_crs, wrap_longitude

EARTH = Geod(ellps="WGS84")
# A UTM zone border, southern hemisphere, both sides of the 180th meridian, Oslo.
PLACES = [(-84.0, 42.28), (151.2, -33.87), (179.999, -16.8), (-179.999, -16.8), (10.75, 59.91), (-60.0, 0.0)]


@pytest.mark.parametrize("place", PLACES)
def test_distances_of_a_local_frame_are_those_on_the_ground_and_degrees_come_back(place: tuple[float, float]) -> None:
    lon, lat = place
    azimuths = np.arange(0.0, 360.0, 30.0)
    far = EARTH.fwd(np.full(12, lon), np.full(12, lat), azimuths, np.full(12, 3000.0))
    lonlat = np.column_stack([np.r_[lon, far[0]], np.r_[lat, far[1]]])
    frame = local_frame(lonlat)
    xy = frame.from_lonlat(lonlat)
    assert np.hypot(*(xy[1:] - xy[0]).T) == pytest.approx(3000.0, abs=0.01)
    bearing = np.rad2deg(frame.north_at(xy[0]) - np.arctan2(*(xy[1:] - xy[0]).T[::-1])) % 360
    assert np.abs((bearing - azimuths + 180) % 360 - 180).max() < 0.01
    back = frame.to_lonlat(xy)
    assert np.abs(wrap_longitude(back[:, 0] - lonlat[:, 0])).max() < 1e-9  # 0.1 mm
    assert np.abs(back[:, 1] - lonlat[:, 1]).max() < 1e-9


@given(st.floats(-180, 180), st.floats(-70, 70), st.floats(-5000, 5000), st.floats(-5000, 5000))
@settings(max_examples=50, deadline=None)
def test_metres_come_back_through_degrees_anywhere(lon: float, lat: float, x: float, y: float) -> None:
    frame = local_frame([[lon, lat]])
    assert frame.from_lonlat(frame.to_lonlat([x, y])) == pytest.approx([x, y], abs=1e-4)


def test_files_of_one_place_share_a_frame() -> None:
    assert local_frame([[-83.7399, 42.2801], [-83.735, 42.281]]) == local_frame([[-83.741, 42.279]])


def test_points_on_both_sides_of_the_180th_meridian_lie_together() -> None:
    frame = local_frame([[179.99, -20.0], [-179.99, -20.0]])
    assert np.hypot(*frame.from_lonlat([179.99, -20.0])) < 1100
    assert np.hypot(*(frame.from_lonlat([179.99, -20.0]) - frame.from_lonlat([-179.99, -20.0]))) == pytest.approx(
        EARTH.inv(179.99, -20.0, -179.99, -20.0)[2], abs=0.01
    )


def test_utm_coordinates_are_those_of_the_epsg_definition() -> None:
    # EPSG Guidance Note 7-2 has no worked UTM point on WGS 84; a zone's central meridian at the equator is 500 km east.
    frame = LocalFrame(crs="EPSG:32617", origin_m=(500_000.0, 0.0))
    assert frame.from_lonlat([-81.0, 0.0]) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert utm_crs(-81.0, 10.0) == "EPSG:32617"
    assert utm_crs(180.0, -10.0) == "EPSG:32701"


def test_a_crs_in_metres_stays_and_feet_and_mercator_become_metres_of_the_ground() -> None:
    kept, xy = frame_of_crs("EPSG:32617", [[270_000.0, 4_680_000.0], [270_100.0, 4_680_000.0]])
    assert kept.crs == "EPSG:32617"
    assert xy[0].tolist() == [270_000.0, 4_680_000.0]
    lonlat = [[-83.74, 42.28], [-83.739, 42.28]]
    ground = EARTH.inv(-83.74, 42.28, -83.739, 42.28)[2]
    for crs, metres_a_unit in (("EPSG:3857", 0.7401), ("EPSG:2253", 0.3048)):  # Web Mercator; Michigan South, feet
        from pyproj import Transformer

        given = np.column_stack(Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*np.transpose(lonlat)))
        _, xy = frame_of_crs(crs, given)
        assert np.hypot(*np.diff(xy, axis=0)[0]) == pytest.approx(ground, abs=0.01)
        assert np.hypot(*np.diff(given, axis=0)[0]) * metres_a_unit == pytest.approx(ground, rel=2e-3)
        assert lonlat_of_crs(crs, given) == pytest.approx(np.array(lonlat), abs=1e-8)


@pytest.mark.parametrize("crs", ["EPSG:999999", "a frame of mine", "EPSG:4326", "EPSG:2253"])
def test_crs_that_is_no_metric_frame_is_refused_by_name(crs: str) -> None:
    with pytest.raises(SpecError, match=crs):
        LocalFrame(crs=crs)
