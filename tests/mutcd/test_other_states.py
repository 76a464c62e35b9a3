import numpy as np
import pytest
import shapely
from builders import interior_layout, paper_layout, paper_road, paper_work_zone

from wzsumo.errors import SpecError
from wzsumo.mutcd.layout import lay_out
from wzsumo.mutcd.other_states import with_devices_pushed, with_road_closed, without_zone

LANE_M = 12 * 0.3048


def test_road_without_its_zone_has_all_lanes_whole_and_nothing_on_them() -> None:
    layout, there = paper_layout(), without_zone(paper_layout())
    assert [(float(q.right(500.0)), float(q.left(500.0))) for q in there.lanes] == pytest.approx(
        np.array([(0, 1), (1, 2), (2, 3)]) * LANE_M
    )
    assert {(q.start, q.end) for q in there.lanes} == {(0.0, layout.road.length)}
    assert len(there.devices) == len(there.signs) == len(there.device_outlines) == 0
    assert there.closed_area.is_empty
    assert there.drivable.area == pytest.approx(3 * LANE_M * layout.road.length)
    assert (there.start, there.end) == (layout.start, layout.end)


def test_closed_road_has_devices_across_it_between_which_no_car_fits_and_no_drivable_ground_behind() -> None:
    layout = paper_layout()
    closed = with_road_closed(layout, 1000.0)
    row = closed.devices[closed.devices["s_m"] == 1000.0].sort_values("d_m")
    gaps = row["d_m"].diff().dropna() - 2 * row["radius_m"].iloc[0]
    assert gaps.max() < 1.86
    assert row["d_m"].iloc[0] - row["radius_m"].iloc[0] == pytest.approx(-layout.road.right_shoulder)
    assert row["d_m"].iloc[-1] + row["radius_m"].iloc[-1] == pytest.approx(layout.road.left_edge)
    assert (closed.devices["s_m"] <= 1000.0).all()
    assert closed.drivable.bounds[2] == pytest.approx(1000.0)
    assert closed.pavement.bounds[2] == pytest.approx(1000.0)
    with pytest.raises(SpecError, match="cannot be closed at 9000 m"):
        with_road_closed(layout, 9000.0)


@pytest.mark.parametrize(("side", "n_lanes"), [("left", 3), ("right", 3), ("left", 2), ("right", 2)])
def test_pushed_devices_stand_in_the_lane_beside_and_its_line_goes_round_them(side: str, n_lanes: int) -> None:
    lanes = {"left": (n_lanes - 1,), "right": (0,)}[side]
    road = paper_road(lane_count=n_lanes)
    layout = lay_out(paper_work_zone(closed_lanes=lanes, closed_shoulder=side, shift_ft=0, shifted_lane_width_ft=None), road)
    first = layout.area("activity area").start + 20.0
    pushed = with_devices_pushed(layout, first, first + 60.0, by=1.0)
    sign = -1.0 if side == "left" else 1.0
    inside = layout.devices["s_m"].between(first, first + 60.0)
    assert inside.sum() >= 1
    moved = pushed.devices["d_m"] - layout.devices["d_m"]
    np.testing.assert_allclose(moved[inside], sign)
    assert (moved[~layout.devices["s_m"].between(first - 15.0, first + 75.0)] == 0).all()
    np.testing.assert_allclose(pushed.devices["x_m"], layout.devices["x_m"])
    widths = [
        [float(q.left(first + 30.0) - q.right(first + 30.0)) for q in of.lanes if q.end == of.road.length and q.start == 0]
        for of in (layout, pushed)
    ]
    assert sorted(np.subtract(widths[0], widths[1])) == pytest.approx([0.0] * (n_lanes - 2) + [1.0])
    assert pushed.drivable.area == pytest.approx(layout.drivable.area - 60.0 - 15.0, abs=0.5)
    touching = shapely.intersects(shapely.buffer(pushed.drivable, -0.05), pushed.device_outlines)
    assert not touching.any()


def test_devices_beside_no_closed_side_cannot_be_pushed() -> None:
    layout = paper_layout()
    for of, first in ((layout, 10.0), (interior_layout(), layout.area("activity area").start)):
        with pytest.raises(SpecError, match="no closed side along"):
            with_devices_pushed(of, first, first + 50.0, by=1.0)
