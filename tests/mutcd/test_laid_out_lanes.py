import numpy as np
import pytest
from builders import interior_layout, paper_layout

from wzsumo.mutcd.laid_out_lanes import laid_out_lanes


def test_open_ground_of_the_lanes_is_the_drivable_area_of_the_layout() -> None:
    for layout in (paper_layout(), interior_layout(), paper_layout(closed_lanes=(0,), closed_shoulder="right")):
        lanes = laid_out_lanes(layout)
        open_m2 = sum(
            float(np.trapezoid(lane.p_open.mean(axis=1) * (lane.left - lane.right), lanes.stations)) for lane in lanes.lanes
        )
        assert open_m2 == pytest.approx(layout.drivable.area, rel=0.025)  # beside an interior closure no lane takes all


def test_lane_that_closes_is_open_up_to_its_taper_and_again_after_the_zone() -> None:
    layout = paper_layout()
    lanes = laid_out_lanes(layout)
    taper = layout.area("merging taper")
    before, after = lanes.open_intervals(2)
    assert before[0] == 0.0
    assert taper.start < before[1] < taper.end
    assert after[0] == pytest.approx(layout.end, abs=35)
    ((start, end),) = lanes.open_intervals(0)
    assert (start, end) == pytest.approx((0.0, layout.road.length))
