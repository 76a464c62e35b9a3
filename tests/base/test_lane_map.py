"""LaneMap: intervals, world points and refusals."""

import numpy as np
import pytest

from wzsumo.errors import MapError
from wzsumo.lane_map import LaneMap, MappedLane
from wzsumo.road import Road

STATIONS = np.array([0.0, 10.0, 20.0, 30.0, 40.0])


def mapped_lane(p_open: list[float], *, right: float = 0.0) -> MappedLane:
    flat = np.full(5, 0.1)
    return MappedLane(
        right=np.full(5, right),
        left=np.full(5, right + 3.6),
        right_sd=flat,
        left_sd=flat,
        p_open=np.repeat(np.array(p_open)[:, None], 4, axis=1),
        n_traces=3,
    )


def lane_map(*lanes: MappedLane) -> LaneMap:
    axis = Road(reference_line=np.array([[5.0, 0.0], [5.0, 100.0]]), lane_widths=(3.6,), left_shoulder=1, right_shoulder=1)
    return LaneMap(axis=axis, stations=STATIONS, lanes=lanes, n_traces=3, first_time_s=0.0, last_time_s=9.0)


def test_lane_is_open_and_closed_in_intervals_that_end_half_way_between_stations() -> None:
    made = lane_map(mapped_lane([1.0, 0.9, 0.5, 0.2, 0.9]))
    assert made.open_intervals(0) == ((0.0, 15.0), (35.0, 40.0))
    assert made.closed_intervals(0) == ((25.0, 35.0),)


def test_p_open_at_the_middle_is_that_of_the_two_middle_strips() -> None:
    lane = mapped_lane([1.0] * 5)
    tapering = MappedLane(**{**vars(lane), "p_open": np.tile([1.0, 0.8, 0.4, 0.0], (5, 1))})
    np.testing.assert_allclose(tapering.p_open_middle, 0.6)
    np.testing.assert_allclose(tapering.middle, 1.8)


def test_offsets_count_from_the_right_edge_line_to_the_left() -> None:
    # The road runs north along x = 5; its one lane's right edge line is 1.8 m to the east of that.
    np.testing.assert_allclose(lane_map().to_xy(20.0, 1.0), [5.8, 20.0])


@pytest.mark.parametrize("change", [{"p_open": np.full((5, 2), 1.1)}, {"left": np.zeros(4)}, {"p_open": np.ones((4, 2))}])
def test_lane_with_wrong_values_is_refused(change: dict[str, np.ndarray]) -> None:
    with pytest.raises(MapError, match="lane 0"):
        lane_map(MappedLane(**{**vars(mapped_lane([1.0] * 5)), **change}))
