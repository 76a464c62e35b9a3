"""Lines on the pavement, against the manual's own widths of the zones that they are laid out for."""

from pathlib import Path

import numpy as np
import pytest
from builders import bent_road, by_turns_layout, paper_layout, paper_work_zone
from figures.test_road_coordinates import zone_of

from wzsumo.figures.lane_lines import LaneLine, lane_lines
from wzsumo.mutcd.layout import lay_out

FT = 0.3048


def at(lines: list[LaneLine], station: float) -> list[tuple[str, float]]:
    """Kind and offset [ft] of each line that crosses a station, from the right."""
    found = [
        (line.kind, float(np.interp(station, line.stations, line.offsets)) / FT)
        for line in lines
        if line.stations[0] <= station <= line.stations[-1]
    ]
    return sorted(((str(kind), round(offset, 2)) for kind, offset in found), key=lambda each: each[1])


@pytest.mark.parametrize("radius_ft", [None, 984])
def test_lines_of_the_papers_zone_lie_where_its_lanes_do_on_a_straight_and_on_a_bend(
    radius_ft: float | None, tmp_path: Path
) -> None:
    layout = paper_layout() if radius_ft is None else lay_out(paper_work_zone(), bent_road(radius_ft))
    lines = lane_lines(zone_of(layout, tmp_path))
    # Three lanes of 12 ft; in the activity area two of 11 ft that were moved 12 ft to the right, at the line of devices.
    assert at(lines, 100.0) == [("edge", 0), ("lane", 12), ("lane", 24), ("edge", 36)]
    activity = layout.area("activity area")
    assert at(lines, (activity.start + activity.end) / 2) == [("edge", -10), ("lane", 1), ("edge", 12)]


def test_lane_that_is_driven_against_the_other_has_a_centre_line_between(tmp_path: Path) -> None:
    lines = lane_lines(zone_of(by_turns_layout(), tmp_path))
    assert at(lines, 100.0) == [("edge", 0), ("centre", 12), ("edge", 24)]


def test_each_stretch_of_a_line_is_drawn_once(tmp_path: Path) -> None:
    lines = lane_lines(zone_of(paper_layout(), tmp_path))
    for station in np.arange(101.0, 1800.0, 50.0):
        offsets = [offset for _, offset in at(lines, float(station))]
        assert (np.diff(offsets) > 0.5).all(), station
