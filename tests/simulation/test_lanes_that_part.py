from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import pandas as pd
import pytest
import shapely
from builders import paper_road, paper_work_zone
from sumo_runs import driven, outlines_in

from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation.edges import edges_of
from wzsumo.simulation.network import write_network
from wzsumo.work_zone import WorkZoneLayout

HALF_OVER_M = 1.5  # from the middle of its lane: a car 1.85 m wide then reaches 0.6 m over the line
AHEAD_M = 105  # of the nose: no vehicle may change lanes from 100 m on
SPEED = 25.0  # m/s


def interior_layout() -> WorkZoneLayout:
    zone = paper_work_zone(closed_lanes=(1,), closed_shoulder="left", shift_ft=0, shifted_lane_width_ft=None)
    return lay_out(zone, paper_road(length_ft=7000))


LAYOUT = interior_layout()
NOSE = LAYOUT.area("shifting taper").start


def traces_of_one_astride(folder: Path, *, lane: int, others: Sequence[float]) -> pd.DataFrame:
    """Of a car astride the line to the other lane, with `others` in its lane, fronts so many metres ahead of its own."""
    net, edges = write_network(LAYOUT, folder), edges_of(LAYOUT)
    first = max(number for number, edge in enumerate(edges) if edge.start < NOSE - AHEAD_M)
    position = NOSE - AHEAD_M - edges[first].start
    towards = 1 if lane == 0 else -1
    at = f'type="car" route="on" depart="0" insertionChecks="none" departLane="{lane}" departSpeed="{SPEED}"'
    beside = "".join(
        f'<vehicle id="other_{n}" {at} departPos="{position + gap:.2f}" departPosLat="{-0.5 * towards}"/>'
        for n, gap in enumerate(others)
    )
    rows = driven(
        net,
        f'<vType id="car" length="4.8" width="1.85" speedFactor="1" sigma="0" lcLaneDiscipline="1" lcSublane="10"/>'
        f'<route id="on" edges="{" ".join(edge.id for edge in edges[first:])}"/>'
        f'<vehicle id="half" {at} departPos="{position:.2f}" departPosLat="{HALF_OVER_M * towards}"/>{beside}',
        folder,
    )
    return rows[rows["id"] == "half"]


@pytest.mark.parametrize("lane", [0, 1], ids=["right lane", "left lane"])
@pytest.mark.parametrize("others", [(0,), (8,), (0, 10, 20, -10, -20)], ids=["beside it", "ahead of it", "a platoon"])
def test_car_astride_the_line_falls_back_into_its_lane_before_the_nose_and_never_stands(
    tmp_path: Path, lane: int, others: Sequence[float]
) -> None:
    rows = traces_of_one_astride(tmp_path, lane=lane, others=others)
    outlines = outlines_in(rows, length=4.8, width=1.85)
    station = shapely.get_x(shapely.centroid(outlines))  # the road runs along +x
    assert station[0] < NOSE - 100
    assert station[-1] > LAYOUT.area("activity area").start
    assert not shapely.intersects(LAYOUT.closed_area, outlines).any()
    assert rows["speed"].min() > 5


def test_closed_ground_between_two_lanes_is_a_lane_that_bars_every_vehicle_from_the_nose_to_where_it_ends(
    tmp_path: Path,
) -> None:
    net = ET.parse(write_network(LAYOUT, tmp_path)).getroot()
    for edge in edges_of(LAYOUT):
        allowed = [lane.get("allow") for lane in net.findall(f"edge[@id='{edge.id}']/lane")]
        if NOSE < edge.end <= LAYOUT.area("downstream taper").end:
            assert allowed == [None, "custom1", None], edge.id
        else:
            assert "custom1" not in allowed, edge.id
