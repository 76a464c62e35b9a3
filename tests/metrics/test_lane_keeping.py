import numpy as np
import pytest
from builders import by_turns_layout, interior_layout, paper_layout, two_lane_road

from wzsumo.frames import FloatArray
from wzsumo.metrics.lane_keeping import measure_lane_keeping
from wzsumo.mutcd.layout import lay_out
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZone, WorkZoneLayout

CAR = VehicleGeometry()  # 1.86 m wide
LAYOUT = paper_layout(shift_ft=0, shifted_lane_width_ft=None)  # lanes 0 and 1 go straight on, lane 2 closes
RIGHT, MIDDLE = 1.829, 5.486  # middles of 12 ft lanes


def along(offsets: FloatArray, *, layout: WorkZoneLayout = LAYOUT) -> FloatArray:
    """Rear-axle poses at evenly spaced stations from 100 m before the zone to 100 m beyond, headed along the offsets."""
    s = np.linspace(layout.start - 100, layout.end + 100, len(offsets))
    return np.column_stack([s, offsets, np.arctan2(np.gradient(offsets), np.gradient(s))])


def test_middle_of_a_lane_is_over_no_line_and_off_by_nothing() -> None:
    kept = measure_lane_keeping(along(np.full(2000, MIDDLE)), vehicle=CAR, layout=LAYOUT)
    assert kept.over_line_share == 0
    assert kept.mean_off_middle_m == pytest.approx(0, abs=0.002)
    assert (kept.n_lane_changes, kept.n_needed_changes) == (0, 0)


@pytest.mark.parametrize(("offset", "share"), [(3.658 + 0.94, 0.0), (3.658 + 0.92, 1.0), (3.658 - 0.94, 0.0)])
def test_outline_is_over_the_line_from_half_its_width_on(offset: float, share: float) -> None:
    kept = measure_lane_keeping(along(np.full(2000, offset)), vehicle=CAR, layout=LAYOUT)
    assert kept.over_line_share == pytest.approx(share, abs=0.01)


def test_lane_that_has_closed_is_no_neighbour_whose_line_counts() -> None:
    # The line to lane 2, at 24 ft, counts while lane 2 is as wide as the car: over the first half of its taper of 720 ft.
    kept = measure_lane_keeping(along(np.full(4000, 7.315)), vehicle=CAR, layout=LAYOUT)
    closing = next(lane for lane in LAYOUT.lanes if lane.index == 2)
    full = closing.end - 720 * 0.3048
    reopened = sum(LAYOUT.end - lane.start for lane in LAYOUT.lanes if lane.index == 2 and lane.start > 0)
    as_wide = full + (1 - 1.86 / 3.658) * 720 * 0.3048
    expected = (as_wide - LAYOUT.start + max(reopened, 0)) / (LAYOUT.end - LAYOUT.start)
    assert kept.over_line_share == pytest.approx(expected, abs=0.02)


def test_share_over_a_line_is_of_the_length_in_the_zone() -> None:
    n = 4000
    s = np.linspace(LAYOUT.start - 100, LAYOUT.end + 100, n)
    quarter = LAYOUT.start + 0.25 * (LAYOUT.end - LAYOUT.start)
    offsets = np.where(s < quarter, RIGHT + 1.83, RIGHT)  # over the line, also before the zone, then in the lane
    poses = np.column_stack([s, offsets, np.zeros(n)])
    assert measure_lane_keeping(poses, vehicle=CAR, layout=LAYOUT).over_line_share == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize("aside_m", [-0.4, 0.0, 1e-9, 0.4])
def test_lane_that_both_directions_share_is_no_other_lane(aside_m: float) -> None:
    layout = by_turns_layout()
    own = next(lane for lane in layout.lanes if not lane.opposing)
    turns = layout.taking_turns
    assert turns is not None
    s = np.linspace(layout.start - 100, layout.end + 100, 4000)
    returns_late = np.where(s > (turns.start + turns.end) / 2, s - 12.0, s)
    middle = (own.right(returns_late) + own.left(returns_late)) / 2
    poses = np.column_stack([s, middle + np.where((s > turns.start) & (s < turns.end), aside_m, 0.0), np.zeros(len(s))])
    kept = measure_lane_keeping(poses, vehicle=CAR, layout=layout)
    assert (kept.n_lane_changes, kept.n_needed_changes) == (0, 0)
    into_the_other = measure_lane_keeping(
        np.column_stack([s, np.where(s < turns.start - 50, 5.5, middle), np.zeros(len(s))]), vehicle=CAR, layout=layout
    )
    assert into_the_other.n_lane_changes == 1


def test_weaving_has_the_standard_deviation_of_a_sine() -> None:
    s = np.linspace(0, 8 * 2 * np.pi, 6000)
    kept = measure_lane_keeping(along(MIDDLE + 0.3 * np.sin(s)), vehicle=CAR, layout=LAYOUT)
    assert kept.sd_off_middle_m == pytest.approx(0.3 / np.sqrt(2), rel=0.03)
    assert kept.mean_off_middle_m == pytest.approx(0.3 * 2 / np.pi, rel=0.03)


def test_constant_place_beside_the_middle_does_not_weave() -> None:
    kept = measure_lane_keeping(along(np.full(2000, MIDDLE + 0.4)), vehicle=CAR, layout=LAYOUT)
    assert kept.sd_off_middle_m == pytest.approx(0, abs=1e-6)
    assert kept.mean_off_middle_m == pytest.approx(0.4, abs=0.002)


def test_changes_there_and_back_are_counted_and_not_needed() -> None:
    ramp = np.concatenate([np.zeros(900), np.linspace(0, 1, 100), np.ones(1000), np.linspace(1, 0, 100), np.zeros(900)])
    kept = measure_lane_keeping(along(MIDDLE + (RIGHT - MIDDLE) * ramp), vehicle=CAR, layout=LAYOUT)
    assert (kept.n_lane_changes, kept.n_needed_changes) == (2, 0)


def test_way_out_of_a_closing_lane_and_back_into_it_needs_two_changes() -> None:
    start, n = 3.5 * 3.658 - 3.658, 3000
    s = np.linspace(LAYOUT.start - 100, LAYOUT.end + 100, n)
    reopens = max(lane.start for lane in LAYOUT.lanes if lane.index == 2)
    closing = min(lane.end for lane in LAYOUT.lanes if lane.index == 2)
    offsets = np.interp(s, [closing - 150, closing - 100, reopens + 20, reopens + 80], [start, MIDDLE, MIDDLE, start])
    poses = np.column_stack([s, offsets, np.zeros(n)])
    kept = measure_lane_keeping(poses, vehicle=CAR, layout=LAYOUT)
    assert (kept.n_lane_changes, kept.n_needed_changes) == (2, 2)


def test_lanes_parted_by_the_work_share_no_line() -> None:
    layout = interior_layout()
    kept = measure_lane_keeping(along(np.full(2000, RIGHT), layout=layout), vehicle=CAR, layout=layout)
    assert kept.over_line_share == 0
    assert kept.n_needed_changes == 0


def test_line_to_oncoming_traffic_counts() -> None:
    zone = WorkZone.model_validate({
        "posted_speed_mph": 55, "road_type": "rural", "start_ft": 800, "closed_shoulder": "right", "work_length_ft": 650,
    })  # fmt: skip
    layout = lay_out(zone, two_lane_road())
    kept = measure_lane_keeping(along(np.full(2000, 3.4), layout=layout), vehicle=CAR, layout=layout)
    assert kept.over_line_share == pytest.approx(1.0, abs=0.01)
