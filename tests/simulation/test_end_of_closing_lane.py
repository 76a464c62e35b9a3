from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest
import shapely
from builders import paper_work_zone
from sumo_runs import driven, outlines_in

from wzsumo.mutcd.layout import lay_out
from wzsumo.road import RoadSpec
from wzsumo.simulation.edges import edges_of
from wzsumo.simulation.network import write_network
from wzsumo.work_zone import WorkZoneLayout

ASTRIDE_M = 1.6  # from the middle of the open lane: a car 1.85 m wide then reaches 0.7 m over the line
LENGTH_M, WIDTH_M = 4.8, 1.85


def closing_layout(closed: tuple[int, ...], shoulder: str) -> WorkZoneLayout:
    zone = paper_work_zone(closed_lanes=closed, closed_shoulder=shoulder, shift_ft=0, shifted_lane_width_ft=None)
    return lay_out(zone, RoadSpec(lane_count=3, left_shoulder_ft=12, right_shoulder_ft=12, length_ft=6000).build())


def traces_of_two(layout: WorkZoneLayout, folder: Path, *, side: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Of a car astride the line where the lane on one side (1: left) of lane 1 ends, and of one that stands beside it."""
    net, edges = write_network(layout, folder), edges_of(layout)
    first_without = next(number for number, edge in enumerate(edges) if len(edge.through_lanes) < len(edge.lanes))
    last_with = edges[first_without - 1]
    length = last_with.end - last_with.start
    edge_ids = " ".join(edge.id for edge in edges[first_without - 1 :])
    at = 'type="car" route="on" depart="0" insertionChecks="none" departLane="1"'
    rows = driven(
        net,
        f'<vType id="car" length="4.8" width="1.85"/><route id="on" edges="{edge_ids}"/>'
        f'<vehicle id="merging" {at} departPos="{length - 0.1:.2f}" departPosLat="{side * ASTRIDE_M}" departSpeed="0.5"/>'
        f'<vehicle id="beside" {at} departPos="{length - 1.5:.2f}" departSpeed="0"/>',
        folder,
    )
    return rows[rows["id"] == "merging"], rows[rows["id"] == "beside"]


@pytest.mark.parametrize(
    ("closed", "shoulder", "side"), [((2,), "left", 1), ((0,), "right", -1)], ids=["left lane closes", "right lane closes"]
)
def test_car_astride_the_line_at_the_end_of_its_lane_drives_on_though_another_stands_beside_it(
    tmp_path: Path, closed: tuple[int, ...], shoulder: str, side: int
) -> None:
    merging, beside = traces_of_two(closing_layout(closed, shoulder), tmp_path, side=side)
    for car in (merging, beside):
        assert car["x"].iloc[-1] - car["x"].iloc[0] > 200  # m in 30 s
    assert merging["lane"].iloc[0] != merging["lane"].iloc[-1]


def outlines_of_one_astride(layout: WorkZoneLayout, folder: Path) -> npt.NDArray[np.object_]:
    """Of a car astride the line of the closing left lane, beside a row of cars that stand and leave it no gap in their lane."""
    net, edges = write_network(layout, folder), edges_of(layout)
    narrow = next(number for number, edge in enumerate(edges) if len(edge.through_lanes) < len(edge.lanes))
    reach, ahead = (edge.end - edge.start for edge in (edges[narrow], edges[narrow - 1]))
    start = f'departPos="{ahead - 10:.1f}" departPosLat="{ASTRIDE_M}" departSpeed="5"'
    ids, size = [edge.id for edge in edges], f'length="{LENGTH_M}" width="{WIDTH_M}"'
    at = 'depart="0" insertionChecks="none" departLane="1"'
    row = "".join(
        f'<vehicle id="stands_{n}" type="stands" route="row" {at} departPos="{place:.1f}" departPosLat="-0.8" departSpeed="0"/>'
        for n, place in enumerate(np.arange(5.0, reach, 5.0))
    )
    rows = driven(
        net,
        f'<vType id="stands" {size} maxSpeed="0.01"/><vType id="half" {size}/>'
        f'<route id="row" edges="{" ".join(ids[narrow:])}"/><route id="on" edges="{" ".join(ids[narrow - 1 :])}"/>'
        f'<vehicle id="half" type="half" route="on" {at} {start}/>{row}',
        folder,
    )
    return outlines_in(rows[rows["id"] == "half"], length=LENGTH_M, width=WIDTH_M)


def test_car_that_finds_no_gap_waits_astride_the_line_of_a_closing_lane_before_it_reaches_the_devices(
    tmp_path: Path,
) -> None:
    layout = closing_layout((2,), "left")
    outlines = outlines_of_one_astride(layout, tmp_path)
    over_the_line_m = shapely.bounds(outlines)[:, 3] - 24 * 0.3048
    assert over_the_line_m.min() > 0.4
    assert shapely.bounds(outlines)[-1, 2] > layout.area("merging taper").start + 0.6 * layout.area("merging taper").length
    assert not shapely.intersects(layout.closed_area, outlines).any()
