"""The picture at the head of a report: true to the layout, in one piece and in several."""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from builders import by_turns_layout, paper_layout
from figures.test_road_coordinates import zone_of

from wzsumo.files.result_folder import ResultFolder
from wzsumo.report.zone_picture import BROAD, NARROW, zone_picture

LAYOUT = paper_layout()
START, END = LAYOUT.start - 40.0, LAYOUT.end + 40.0  # of what is shown
HIGH = LAYOUT.road.left_edge


def driven(folder: Path, *, to_m: float, outcome: str) -> ResultFolder:
    """The paper's zone, driven at an offset of 5 m along the straight road up to a station."""
    (folder / "drives").mkdir(exist_ok=True)
    x, y = LAYOUT.road.to_xy(np.arange(100.0, to_m, 1.0), 5.0).T
    log = pd.DataFrame({"time_s": x / 20, "x_m": x, "y_m": y, "heading_rad": 0.0, "speed_mps": 20.0, "s_m": x - 100})
    log.to_csv(folder / "drives" / "swept.csv", index=False)
    return replace(zone_of(LAYOUT, folder), result={"methods": {"swept": {"outcome": outcome}}})


def points_of(path: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r"(-?[\d.]+) (-?[\d.]+)", path)]


@pytest.mark.parametrize(("kind", "size"), [("broad", BROAD), ("narrow", NARROW)])
def test_drive_and_devices_are_drawn_where_they_are(kind: str, size: tuple[float, int, float], tmp_path: Path) -> None:
    width, pieces, height = size
    drawing = zone_picture(driven(tmp_path, to_m=1700.0, outcome="REACHED_GOAL"), "swept")[kind]
    assert len(drawing["panels"]) == pieces
    along = width * pieces / (END - START)
    across = height / (HIGH + LAYOUT.road.right_shoulder)
    devices = [
        (START + n * (END - START) / pieces + x / along, HIGH - y / across)
        for n, panel in enumerate(drawing["panels"])
        for x, y in panel["devices"]
    ]
    expected = LAYOUT.devices.sort_values("s_m")[["s_m", "d_m"]].to_numpy()
    np.testing.assert_allclose(sorted(devices), expected, atol=0.1 / min(along, across))
    for panel in drawing["panels"]:
        (x0, y0), (x1, y1) = points_of(panel["drive"])  # a straight line from end to end
        assert (x0, x1) == pytest.approx((0, width), abs=1.5 * along)
        assert [y0, y1] == pytest.approx([(HIGH - 5.0) * across] * 2, abs=0.1)
        assert "ended" not in panel


def test_drive_that_ended_early_is_marked_where_it_ended(tmp_path: Path) -> None:
    (panel,) = zone_picture(driven(tmp_path, to_m=901.0, outcome="STRUCK_DEVICE"), "swept")["broad"]["panels"]
    along = BROAD[0] / (END - START)
    centre_m = 900.0 + 4.64 / 2 - 0.92  # of the vehicle, whose rear axle came to 900 m
    assert panel["ended"][0] == pytest.approx((centre_m - START) * along, abs=0.1)
    assert points_of(panel["drive"])[-1][0] == pytest.approx(panel["ended"][0], abs=0.1)
    (panel,) = zone_picture(driven(tmp_path, to_m=901.0, outcome="REACHED_GOAL"), "swept")["broad"]["panels"]
    assert "ended" not in panel  # a goal in the zone is no early end


@pytest.mark.parametrize("kind", ["broad", "narrow"])
def test_names_of_areas_stay_in_the_picture_and_do_not_overlap(kind: str, tmp_path: Path) -> None:
    drawing: dict[str, Any] = zone_picture(zone_of(LAYOUT, tmp_path), None)[kind]
    for panel in drawing["panels"]:
        spans: dict[float, list[tuple[float, float]]] = {}
        for name in panel["names"]:
            half = 7.0 * len(name["text"]) / 2
            assert name["middle"] - half >= 0
            assert name["middle"] + half <= drawing["width"]
            spans.setdefault(name["y"], []).append((name["middle"] - half, name["middle"] + half))
        for level in spans.values():
            assert all(a[1] < b[0] for a, b in pairwise(level))
    if kind == "broad":
        assert len(drawing["panels"][0]["names"]) == len(LAYOUT.areas)


def test_work_space_lies_on_closed_ground_beside_the_activity_area(tmp_path: Path) -> None:
    (panel,) = zone_picture(zone_of(LAYOUT, tmp_path), None)["broad"]["panels"]
    along, across = BROAD[0] / (END - START), BROAD[2] / (HIGH + LAYOUT.road.right_shoulder)
    x, y = panel["work_space"]
    area = LAYOUT.area("activity area")
    assert area.start < START + x / along < area.end
    assert HIGH - y / across > 12 * 0.3048  # to the left of the devices, at 12 ft


def test_arrows_point_the_way_that_each_lane_is_driven_and_stop_lines_stand_where_one_waits(tmp_path: Path) -> None:
    layout = by_turns_layout()
    (panel,) = zone_picture(zone_of(layout, tmp_path), None)["broad"]["panels"]
    ways = []
    for arrow in panel["arrows"]:
        (tip, y), (tail, _), _ = [tuple(map(float, point.split(","))) for point in arrow.split()]
        ways.append((y, tip > tail))
    assert [forward for _, forward in sorted(ways)] == [False, True]  # the left lane is driven against the stations
    assert layout.taking_turns is not None
    along = BROAD[0] / (layout.end - layout.start + 80.0)
    stops = [points_of(line["path"])[0][0] for line in panel["lines"] if line["kind"] == "stop"]
    expected = [(s - layout.start + 40.0) * along for s in (layout.taking_turns.start, layout.taking_turns.end)]
    assert stops == pytest.approx([x for x in expected if 0 < x < BROAD[0]], abs=0.1)
