from pathlib import Path

import pytest
import shapely
from builders import two_lane_road
from sumo_runs import driven, outlines_in

from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation.edges import edges_of
from wzsumo.simulation.network import write_network
from wzsumo.work_zone import WorkZone

TRUCK_M, TRUCK_WIDTH_M = 12.0, 2.5
ONE_LANE = WorkZone(
    posted_speed_mph=45, road_type="rural", typical_application="TA-12", start_ft=800, closed_lanes=(0,),
    one_lane_two_way="signal", work_length_ft=200,
)  # fmt: skip


@pytest.mark.parametrize("side", ["left", "right"])
def test_truck_that_keeps_to_one_side_of_a_lane_that_turns_by_one_in_ten_cuts_no_device(tmp_path: Path, side: str) -> None:
    layout = lay_out(ONE_LANE, two_lane_road())
    net, edges = write_network(layout, tmp_path), edges_of(layout)
    rows = driven(
        net,
        f'<vType id="truck" length="{TRUCK_M}" width="{TRUCK_WIDTH_M}" latAlignment="{side}"/>'
        f'<route id="on" edges="{" ".join(edge.id for edge in edges)}"/>'
        '<vehicle id="truck" type="truck" route="on" depart="0" departPos="130" departPosLat="center" departSpeed="15"/>',
        tmp_path,
    )
    outlines = outlines_in(rows, length=TRUCK_M, width=TRUCK_WIDTH_M)
    assert shapely.bounds(outlines)[-1, 0] > layout.end
    assert shapely.bounds(outlines)[:, 1].max() > 12 * 0.3048  # over to the other direction's lane
    assert not shapely.intersects(layout.closed_area, outlines).any()
