import numpy as np
import pandas as pd
import pytest
import shapely
from builders import paper_layout, paper_work_zone, vehicle_outlines
from sumo_runs import driven

from wzsumo.frames import advance, heading_from_sumo_angle
from wzsumo.mutcd.layout import lay_out
from wzsumo.road import RoadSpec
from wzsumo.simulation.edges import edges_of
from wzsumo.simulation.network import write_network
from wzsumo.units import METRES_PER_FOOT

HALF_OVER_M = 1.6  # from the middle of the open lane: a car 1.85 m wide then reaches 0.7 m over the line
SIZES = {"car": (4.8, 1.85), "truck": (12.0, 2.5)}  # m


def closing_layout(closed, shoulder):
    zone = paper_work_zone(closed_lanes=closed, closed_shoulder=shoulder, shift_ft=0, shifted_lane_width_ft=None)
    return lay_out(zone, RoadSpec(lane_count=3, left_shoulder_ft=12, right_shoulder_ft=12, length_ft=6000).build())


def traces_of_two(layout, folder, *, side):
    """Of a car half over the line where the lane on one side (1: left) of lane 1 ends, and of one that stands beside it."""
    net, edges = write_network(layout, folder), edges_of(layout)
    first_without = next(number for number, edge in enumerate(edges) if len(edge.through) < len(edge.lanes))
    last_with = edges[first_without - 1]
    length = last_with.end - last_with.start
    edge_ids = " ".join(edge.id for edge in edges[first_without - 1 :])
    at = 'type="car" route="on" depart="0" insertionChecks="none" departLane="1"'
    rows = driven(
        net,
        f'<vType id="car" length="4.8" width="1.85"/><route id="on" edges="{edge_ids}"/>'
        f'<vehicle id="merging" {at} departPos="{length - 0.1:.2f}" departPosLat="{side * HALF_OVER_M}" departSpeed="0.5"/>'
        f'<vehicle id="beside" {at} departPos="{length - 1.5:.2f}" departSpeed="0"/>',
        folder,
    )
    return rows[rows["id"] == "merging"], rows[rows["id"] == "beside"]


@pytest.mark.parametrize(
    ("closed", "shoulder", "side"), [((2,), "left", 1), ((0,), "right", -1)], ids=["left lane closes", "right lane closes"]
)
def test_car_half_over_the_line_at_the_end_of_its_lane_goes_on_though_somebody_stands_beside_it(
    tmp_path, closed, shoulder, side
):
    merging, beside = traces_of_two(closing_layout(closed, shoulder), tmp_path, side=side)
    for car in (merging, beside):
        assert car["x"].iloc[-1] - car["x"].iloc[0] > 200  # m in 30 s
    assert merging["lane"].iloc[0] != merging["lane"].iloc[-1]


def outlines_of_two_abreast(layout, folder, *, kind):
    """Of a vehicle half over the line of the closing left lane, beside a platoon that leaves it no room, to beyond the taper."""
    net, edges = write_network(layout, folder), edges_of(layout)
    first = next(number for number, edge in enumerate(edges) if len(edge.through) < len(edge.lanes))
    length, width = SIZES[kind]
    at = 'route="on" depart="0" insertionChecks="none" departLane="1" departSpeed="9"'
    platoon = "".join(f'<vehicle id="beside_{n}" type="car" {at} departPos="{30 - 6 * n}" departPosLat="-0.8"/>' for n in range(5))
    rows = driven(
        net,
        f'<vType id="car" length="4.8" width="1.85" maxSpeed="9" latAlignment="-0.8" sigma="0" tau="0.1"/>'
        f'<vType id="half" length="{length}" width="{width}" sigma="0"/>'
        f'<route id="on" edges="{" ".join(edge.id for edge in edges[first:])}"/>'
        f'<vehicle id="half" type="half" {at} departPos="20" departPosLat="{HALF_OVER_M - 0.3}"/>{platoon}',
        folder,
    )
    rows = rows[rows["id"] == "half"]
    bumper = np.column_stack([rows["x"], rows["y"], heading_from_sumo_angle(rows["angle"])])
    x, y, heading = advance(bumper, -length / 2).T
    return vehicle_outlines(pd.DataFrame({"x_m": x, "y_m": y, "heading_rad": heading, "length_m": length, "width_m": width}))


@pytest.mark.parametrize("kind", SIZES)
def test_driver_whom_a_platoon_keeps_over_the_line_of_a_closing_lane_does_not_reach_over_the_devices(tmp_path, kind):
    layout = closing_layout((2,), "left")
    outlines = outlines_of_two_abreast(layout, tmp_path, kind=kind)
    assert outlines[0].bounds[3] > 24 * METRES_PER_FOOT + 0.3  # over the line between lanes 1 and 2
    assert shapely.bounds(outlines)[:, 2].max() > layout.area("activity area").start  # it came past
    assert not shapely.intersects(layout.closed_area, outlines).any()


def test_nobody_drives_on_what_is_left_of_a_closed_lane():
    edge = next(edge for edge in edges_of(paper_layout()) if len(edge.through) < len(edge.lanes))
    assert [lane.index for lane in edge.through] == [0, 1]
    assert [lane.index for lane in edge.lanes] == [0, 1, 2]
