"""The page of a mapped zone: differences with their intervals, and a drawing that is true to scale."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import lane_map_of, paper_layout

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.feeds.verified import VerifiedZone
from wzsumo.files.lanes import LanesFile
from wzsumo.geography import local_frame
from wzsumo.report.zone_drawings import WIDTHS, detail_drawing, label_place, map_drawing
from wzsumo.report.zone_page import differences, write_zone_page, zone_page

EXACT = LanesFile(lanes=lane_map_of(paper_layout()), frame=local_frame([[-83.74, 42.28]]))
ANNOUNCED = AnnouncedZone(start_m=300.0, end_m=900.0, start_sd_m=150.0, end_sd_m=15.0, closed_lanes=(2,))


def test_differences_are_verified_less_announced_with_an_interval_of_95_percent() -> None:
    verified = VerifiedZone(start_m=340.0, end_m=800.0, start_sd_m=10.0, end_sd_m=20.0, closed_lanes=(2,), shifted=())
    start, end = differences(ANNOUNCED, verified)
    assert (start.off_m, end.off_m) == (40.0, -100.0)
    assert start.interval_m == pytest.approx((20.4, 59.6))
    assert end.interval_m == pytest.approx((-139.2, -60.8))
    assert start.is_explained  # 40 m of a position that is estimated to 150 m
    assert not end.is_explained  # 100 m where both are known to 25 m


def test_page_sets_announced_against_verified_and_needs_no_network(tmp_path: Path) -> None:
    write_zone_page(EXACT, tmp_path, announced=ANNOUNCED, words=["shoulders are assumed"])
    page = (tmp_path / "zone.html").read_text()
    assert "http" not in page.replace("http-equiv", "")
    assert ">N</text>" in page
    assert "shoulders are assumed" in page
    rows = re.findall(r'<tr><th scope="row">(\d)</th><td>(\w+)</td><td>(\w+)</td>', page)
    assert rows == [("2", "closed", "closed"), ("1", "open", "shifted"), ("0", "open", "shifted")]


@pytest.mark.parametrize("kind", ["broad", "narrow"])
def test_scale_bar_and_corners_are_true_to_the_ground(kind: str) -> None:
    drawing = map_drawing(EXACT, None, width=WIDTHS[kind])
    (low, high) = drawing["corners"]
    assert EXACT.frame is not None
    (low_lat, low_lon), (_, high_lon) = [tuple(map(float, corner["text"].split(", "))) for corner in (low, high)]
    east = EXACT.frame.from_lonlat([[low_lon, low_lat], [high_lon, low_lat]])
    assert np.ptp(east[:, 0]) / (high["x"] - low["x"]) == pytest.approx(drawing["bar_m"] / drawing["bar"], rel=0.01)


def test_detail_draws_a_line_between_all_lanes_and_at_both_edges() -> None:
    lines = detail_drawing(EXACT.lanes, None, width=1100.0)["lines"]
    assert sorted(line["kind"] for line in lines) == ["edge", "edge", "lane", "lane"]  # of three lanes


def test_page_of_a_map_without_a_place_or_announcement_says_so() -> None:
    page = zone_page(replace(EXACT, frame=None), announced=None, title="t")
    assert "without a place on earth" in page
    assert ">y</text>" in page
    assert "Nothing was announced" in page


@pytest.mark.parametrize(
    ("across", "anchor"),
    [
        ([[400.0, 90.0], [402.0, 120.0]], "middle"),  # the road runs across the drawing
        ([[400.0, 100.0], [430.0, 105.0]], "start"),  # it runs up the drawing
        ([[1050.0, 100.0], [1080.0, 105.0]], "end"),  # and at its edge
    ],
)
def test_names_of_marks_stand_beside_the_road_and_within_the_drawing(across: list[list[float]], anchor: str) -> None:
    for ends in (across, across[::-1]):
        place = label_place(np.array(ends), width=1100.0)
        assert place["anchor"] == anchor
        assert place["y"] < 90 if anchor == "middle" else place["x"] in {across[0][0] - 6, across[1][0] + 6}
        assert 0 < place["x"] + {"middle": 55, "start": 110, "end": -110}[anchor] < 1100


@pytest.mark.parametrize("kind", ["broad", "narrow"])
@pytest.mark.parametrize("length_m", [20.0, 100.0, 600.0])
def test_names_of_both_announced_ends_and_of_all_stations_stand_apart(kind: str, length_m: float) -> None:
    near = replace(ANNOUNCED, start_m=300.0, end_m=300.0 + length_m)
    width, name_width, tick_width = WIDTHS[kind], 94.0, 46.0  # "announced start" and "1400 m" at 13 px, as a browser sets them
    detail, drawing = detail_drawing(EXACT.lanes, near, width=width), map_drawing(EXACT, near, width=width)
    for marks, at in ((detail["marks"], "label"), (drawing["marks"], "x")):
        start, end = (mark[at] for mark in marks)
        assert end - start >= name_width
        assert start >= name_width / 2
        assert end <= width - name_width / 2
    stations = [tick["x"] for tick in detail["ticks"]]
    assert len(stations) >= 2
    assert np.diff(stations).min() >= tick_width
