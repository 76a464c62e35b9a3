import pytest
from builders import paper_layout, paper_work_zone
from sumo_runs import driven

from wzsumo.mutcd.layout import lay_out
from wzsumo.road import RoadSpec
from wzsumo.simulation.edges import edges_of
from wzsumo.simulation.network import write_network

HALF_OVER_M = 1.6  # from the middle of the open lane: a car 1.85 m wide then reaches 0.7 m over the line


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
    zone = paper_work_zone(closed_lanes=closed, closed_shoulder=shoulder, shift_ft=0, shifted_lane_width_ft=None)
    layout = lay_out(zone, RoadSpec(lane_count=3, left_shoulder_ft=12, right_shoulder_ft=12, length_ft=6000).build())
    merging, beside = traces_of_two(layout, tmp_path, side=side)
    for car in (merging, beside):
        assert car["x"].iloc[-1] - car["x"].iloc[0] > 200  # m in 30 s
    assert merging["lane"].iloc[0] != merging["lane"].iloc[-1]


def test_nobody_drives_on_what_is_left_of_a_closed_lane():
    edge = next(edge for edge in edges_of(paper_layout()) if len(edge.through) < len(edge.lanes))
    assert [lane.index for lane in edge.through] == [0, 1]
    assert [lane.index for lane in edge.lanes] == [0, 1, 2]
