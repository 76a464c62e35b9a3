import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wzsumo.errors import SpecError
from wzsumo.geography import local_frame
from wzsumo.roads.line_file import read_line

PLACE = local_frame([[-83.74, 42.28]])
LINE = PLACE.to_lonlat([(0.0, 0.0), (300.0, 0.0), (600.0, 20.0)]).tolist()


def write(path: Path, coordinates: Any = LINE, **properties: Any) -> Path:
    geometry = {"type": "LineString", "coordinates": coordinates}
    path.write_text(json.dumps({"type": "Feature", "geometry": geometry, "properties": properties}))
    return path


def test_line_with_attributes_is_a_road(tmp_path: Path) -> None:
    given = {"lanes": 3, "lane_width_ft": 11, "left_shoulder_ft": 4, "right_shoulder_m": 3.0, "speed_limit_mph": 60}
    found = read_line(write(tmp_path / "r.geojson", **given), frame=PLACE)
    road = found.road
    assert road.lane_widths == pytest.approx([3.3528] * 3)
    assert (road.left_shoulder, road.right_shoulder) == pytest.approx((1.2192, 3.0))
    assert road.reference_line == pytest.approx(np.array([(0, 0), (300, 0), (600, 20)]), abs=1e-3)
    assert found.speed_mps == pytest.approx(26.8224)
    assert found.assumed == ()


def test_heights_are_left_out_and_shoulders_may_be_nought(tmp_path: Path) -> None:
    line = [[*position, 250.0] for position in LINE]
    found = read_line(write(tmp_path / "r.geojson", line, lanes=1, left_shoulder_ft=0, right_shoulder_ft=0), frame=PLACE)
    assert (found.road.left_shoulder, found.road.right_shoulder) == (0.0, 0.0)
    assert found.road.length == pytest.approx(600.7, abs=0.1)


def test_what_a_line_does_not_say_is_assumed_and_listed(tmp_path: Path) -> None:
    found = read_line(write(tmp_path / "r.geojson", lanes=2), frame=PLACE)
    assert found.road.lane_widths == pytest.approx([3.6576] * 2)
    assert len(found.assumed) == 2
    slow = read_line(write(tmp_path / "s.geojson", lanes=1, speed_limit_mph=30), frame=PLACE)
    assert (slow.road.left_shoulder, slow.road.right_shoulder) == (0.0, 0.0)  # a street


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "properties.lanes=None must be the number of lanes"),
        ({"lanes": "two"}, "properties.lanes='two' must be a number"),
        ({"lanes": 9}, "properties.lanes=9 must be the number of lanes, 1 to 8"),
        ({"lanes": 2, "lane_width_ft": -3}, "properties.lane_width_ft=-3"),
        ({"lanes": 2, "left_shoulder_ft": -0.5}, "properties.left_shoulder_ft=-0.5"),
        ({"lanes": 2, "lane_width_ft": 11, "lane_width_m": 3.3}, "give one of lane_width_m and lane_width_ft"),
        ({"lanes": 2, "coordinates": [[500000, 4000000], [500100, 4000000]]}, "is no longitude and latitude"),
        ({"lanes": 2, "coordinates": [LINE[0], LINE[1], LINE[0]]}, "take a stretch without sharp turns"),
    ],
)
def test_line_that_is_no_road_is_refused(tmp_path: Path, given: dict[str, Any], said: str) -> None:
    with pytest.raises(SpecError, match=said):
        read_line(write(tmp_path / "r.geojson", **given), frame=PLACE)


def test_file_without_a_line_or_frame_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    for content, said in (("{", "is no GeoJSON"), ('{"type": "FeatureCollection", "features": []}', "holds no LineString")):
        path.write_text(content)
        with pytest.raises(SpecError, match=said):
            read_line(path, frame=PLACE)
    with pytest.raises(SpecError, match="say theirs with --crs"):
        read_line(write(path, lanes=2), frame=None)
