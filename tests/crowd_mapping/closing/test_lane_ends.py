from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from crowd_mapping.lane_values import STATIONS, WIDTH_M, lane_levels, station_table

from wzsumo.crowd_mapping.closing.lane_ends import LaneEnds, fit_lane_ends
from wzsumo.crowd_mapping.course.shifts import Shift
from wzsumo.crowd_mapping.hypotheses.announcement import AnnouncedZone
from wzsumo.frames import FloatArray

CLOSED_FROM, OPEN_FROM = 50, 80  # indices of stations: 500 m and 800 m
ANNOUNCED = AnnouncedZone(first_device=300.0, last_device=850.0, shoulders_lanes=(0.0, 0.0))


def keeper() -> FloatArray:
    return np.zeros(len(STATIONS))


def user(*, leaves_m: float = 400.0, returns_m: float = np.inf) -> FloatArray:
    """Drives in lane 1 on the left, leaves it within 40 m and returns into it within 40 m."""
    left = 1 - np.clip((STATIONS - leaves_m) / 40, 0, 1)
    return np.asarray(left + (np.clip((STATIONS - returns_m) / 40, 0, 1) if np.isfinite(returns_m) else 0.0))


def ends_of(
    lanes: npt.ArrayLike,
    *,
    weights: FloatArray | None = None,
    announced: AnnouncedZone | None = None,
    shifts: tuple[Shift, ...] = (),
) -> LaneEnds:
    """The ends of lane 1, beside one open lane 0, at 60 mph."""
    lanes = np.asarray(lanes)
    levels = lane_levels(lanes, n_lanes=1, closed=(1,), closed_from=CLOSED_FROM, open_from=OPEN_FROM)
    weights = np.ones(len(lanes)) if weights is None else weights
    return fit_lane_ends(
        station_table(WIDTH_M * lanes), weights, levels, lanes=(1,), announced=announced, shifts=shifts, speed_mps=26.8,
        vehicle_width_m=1.86,
    )  # fmt: skip


@pytest.mark.parametrize(("weight", "ends"), [(0.5, False), (0.7, True)])
def test_lane_ends_where_more_than_six_tenths_of_a_trace_used_it(weight: float, ends: bool) -> None:
    assert (1 in ends_of([keeper(), keeper(), user()], weights=np.array([1.0, 1.0, weight])).closing) == ends


def test_lane_of_faded_traces_ends_where_more_than_six_tenths_of_their_weight_used_it() -> None:
    assert 1 in ends_of([keeper(), user()], weights=np.array([0.1, 0.4])).closing
    assert 1 not in ends_of([keeper(), user()], weights=np.array([0.4, 0.1])).closing


@pytest.mark.parametrize(("n_returning", "opens"), [(7, False), (9, True)])
def test_lane_begins_again_where_more_than_eight_percent_of_the_traces_return(n_returning: int, opens: bool) -> None:
    lanes = [keeper()] * (100 - n_returning) + [user(returns_m=860.0)] * n_returning
    assert (1 in ends_of(lanes).opening) == opens


def test_lane_that_begins_again_does_so_ahead_of_the_first_vehicle_that_returns() -> None:
    line = ends_of([keeper()] * 5 + [user(returns_m=860.0)] * 5).opening[1]
    assert 700 < -line.end < 880


def test_announced_end_of_the_zone_goes_before_vehicles_that_seem_to_return() -> None:
    alone, told = (
        ends_of([keeper()] * 5 + [user(returns_m=value)] * 5, announced=ANNOUNCED).opening[1] for value in (np.inf, 820.0)
    )
    np.testing.assert_array_equal(told.probability, alone.probability)


# Its middle is nearer to lane 1 up to 10 m beyond where it leaves: at three stations of the closure, or at four.
@pytest.mark.parametrize(("leaves_m", "believed"), [(510.0, True), (520.0, False)])
def test_trace_that_seems_to_drive_more_than_three_stations_in_the_closed_lane_does_not_tell_where_it_ends(
    leaves_m: float, believed: bool
) -> None:
    assert bool(ends_of([keeper(), user(leaves_m=leaves_m)]).closing) == believed


def test_trace_mistaken_to_drive_in_the_closed_lane_beside_the_work_does_not_hold_an_announced_taper_open() -> None:
    through = np.where(STATIONS < 900, 1.0, 0.0)
    alone, mistaken = (ends_of([keeper(), *others], announced=ANNOUNCED).closing[1] for others in ([], [through]))
    np.testing.assert_array_equal(mistaken.probability, alone.probability)


def test_lane_ends_where_the_open_lane_begins_to_shift_away_from_it() -> None:
    lanes, shift = [keeper()] * 3 + [user(leaves_m=250.0)] * 2, Shift(start=480.0, end=560.0, size=-3.0)
    free, drawn = ends_of(lanes), ends_of(lanes, shifts=(shift,))
    assert drawn.closing[1].end_sd < free.closing[1].end_sd
    towards = ends_of(lanes, shifts=(replace(shift, size=3.0),))
    np.testing.assert_array_equal(towards.closing[1].probability, free.closing[1].probability)


# The last vehicle is in the lane up to 430 m; a kink up to 30 m ahead of that still counts.
@pytest.mark.parametrize(("start_m", "counts"), [(395.0, False), (405.0, True), (790.0, True), (810.0, False)])
def test_shift_counts_from_30_m_ahead_of_the_last_merge_to_the_end_of_the_closure(start_m: float, counts: bool) -> None:
    lanes, shift = [keeper()] * 3 + [user()] * 2, Shift(start=start_m, end=start_m + 80, size=-3.0)
    ends = [ends_of(lanes, shifts=shifts).closing[1] for shifts in ((), (shift,))]
    assert (ends[0].end_sd != ends[1].end_sd) == counts
