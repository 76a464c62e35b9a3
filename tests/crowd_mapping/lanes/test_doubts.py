from dataclasses import replace

import numpy as np
import pytest
from crowd_mapping.lanes.fits import always_in, fit_of, seen

from wzsumo.crowd_mapping.lanes.course import Course
from wzsumo.crowd_mapping.lanes.doubts import said_of_lanes, said_of_shift, said_of_traces
from wzsumo.lane_map import MappedBranch, MappedLane

M = 30


def course(shift: float, *, sd: float = 0.1) -> Course:
    return Course(
        offset=np.full(M, shift), sd=np.full(M, 0.1), shift=shift, shift_sd=sd, width=3.6, width_sd=0.02, log_prior=0.0
    )


@pytest.mark.parametrize(("shift", "size", "side"), [(1.5, "1.5 m", "left"), (-5.0, "5.0 m", "right")])
def test_common_shift_is_told_with_size_and_side(shift: float, size: str, side: str) -> None:
    (word,) = said_of_shift(course(shift), has_road=True, removed=0.0)
    assert size in word
    assert f"to the {side} of the road" in word
    assert "road is taken to be drawn off its place" in word
    assert "removed" in said_of_shift(course(shift), has_road=True, removed=shift)[0]


def test_small_or_uncertain_shift_is_not_told_and_one_that_nothing_tells_is() -> None:
    assert said_of_shift(course(0.2), has_road=True, removed=0.2) == []
    assert said_of_shift(course(0.8, sd=0.7), has_road=True, removed=0.8) == []
    assert said_of_shift(course(3.0), has_road=False, removed=0.0) == []
    (word,) = said_of_shift(course(0.1, sd=2.0), has_road=True, removed=0.0)
    assert "cannot be told" in word


def lane(*, n_traces: int = 5, p_open: float | np.ndarray = 0.99) -> MappedLane:
    edge, sd = np.zeros(M), np.full(M, 0.1)
    p = np.broadcast_to(p_open, M)
    return MappedLane(
        right=edge, left=edge + 3.6, right_sd=sd, left_sd=sd, p_open=np.repeat(p[:, None], 8, axis=1), n_traces=n_traces
    )


def words_of(*lanes: MappedLane, sigma: float = 0.3, branches: tuple[MappedBranch, ...] = ()) -> str:
    in_lane = always_in([0] * 6, n_stations=M, n_lanes=len(lanes))
    return " | ".join(said_of_lanes(lanes, fit_of(in_lane, sigma=sigma), seen(np.zeros((6, M))), branches=branches))


def test_map_without_weaknesses_has_no_doubts() -> None:
    assert words_of(lane(), lane()) == ""


def test_lane_that_nobody_or_one_drove_is_named() -> None:
    assert "no trace drove in lane 1" in words_of(lane(), lane(n_traces=0, p_open=0.5))
    assert "one trace alone drove in lane 1" in words_of(lane(), lane(n_traces=1))


def test_branch_is_told_with_its_length_and_traces() -> None:
    branch = MappedBranch(line=np.array([[0.0, -8.0], [120.0, -8.0]]), width=np.full(2, 3.2), p_open=0.95, n_traces=4)
    assert "4 traces drove beside the lanes over 120 m" in words_of(lane(), branches=(branch,))


def test_poor_receivers_are_told_with_their_error() -> None:
    assert "half of the receivers err by 2.5 m" in words_of(lane(), sigma=2.5)


def test_taper_that_rests_on_the_manual_says_so() -> None:
    closing = np.r_[np.ones(8), 0.8, 0.6, 0.4, 0.2, np.full(M - 12, 0.01)]
    said = words_of(lane(), lane(p_open=closing))
    assert "lane 1 closes between 160 m and" in said
    assert "manual's" in said


def test_traces_that_bear_no_witness_are_named_with_the_reason() -> None:
    closed = np.where((np.arange(M) > 5) & (np.arange(M) < 20), 0.01, 0.99)
    lanes = (lane(), lane(p_open=closed))
    in_lane = always_in([0, 0, 0, 1, 1], n_stations=M)
    fit = fit_of(in_lane, stray=np.array([0.9, 0, 0, 0, 0]), burst=np.zeros((5, M)))
    burst = fit.burst.copy()
    burst[1, :8], in_lane[1, :8] = 1.0, 0.0
    place = 3.6 * in_lane[:, :, 1]
    place[1, :8] = -6.0
    slow = np.zeros((5, M), dtype=bool)
    slow[3, 10:15] = True
    odd, (word,) = said_of_traces(replace(fit, burst=burst), seen(place), slow=slow, lanes=lanes)
    reasons = {entry["vehicle_id"]: entry["reason"] for entry in odd}
    assert list(reasons) == ["v0", "v1", "v3", "v4"]
    assert reasons["v0"] == "follows no lane"
    assert "160 m" in reasons["v1"]
    assert "work vehicle" in reasons["v3"]
    assert "closed to the others" in reasons["v4"]
    assert word.startswith("4 of 5 traces")
    assert all(f"{name} {reason}" in word for name, reason in reasons.items())


def test_trace_off_the_lanes_course_whose_place_is_in_a_lane_is_not_called_beside_them() -> None:
    fit = fit_of(always_in([0, 0], n_stations=M))
    burst = fit.burst.copy()
    burst[1, :] = 1.0
    assert said_of_traces(
        replace(fit, burst=burst), seen(np.zeros((2, M))), slow=np.zeros((2, M), dtype=bool), lanes=(lane(),)
    ) == ([], [])


def test_traces_that_keep_their_lanes_are_not_odd() -> None:
    fit = fit_of(always_in([0, 1, 1], n_stations=M))
    odd, words = said_of_traces(fit, seen(np.zeros((3, M))), slow=np.zeros((3, M), dtype=bool), lanes=(lane(), lane()))
    assert (odd, words) == ([], [])
