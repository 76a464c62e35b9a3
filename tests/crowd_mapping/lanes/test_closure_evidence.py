"""Evidence for a closed lane, on lanes driven that are set by hand: closed forms and orders."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.special import gammaln

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.crowd_mapping.lanes.closure_evidence import TAPER_LENGTHS, interval_evidence, interval_prior
from wzsumo.frames import BoolArray, FloatArray

SPACING = 20.0
STATIONS = 50
FIRST, LAST = 20, 35  # of the closure
WITHOUT_CHANGE_M = 3000.0  # beforehand, between two changes


def evidence(
    in_lane: FloatArray, *, visibility: float = 1.0, seen: BoolArray | None = None, other_changes: float = 0.0
) -> FloatArray:
    """Log LR of the lane, each vehicle changing lanes as often as it leaves and enters this one, and `other_changes` more."""
    n = len(in_lane)
    reached = np.ones(in_lane.shape, dtype=bool) if seen is None else seen
    return interval_evidence(
        in_lane, reached, visibility=np.full(n, visibility), driven_m=reached.sum(axis=1) * SPACING,
        seeming=np.full(in_lane.shape, 0.001), spacing=SPACING, without_change_m=WITHOUT_CHANGE_M,
        changes=np.abs(np.diff(in_lane, axis=1)).sum(axis=1) + other_changes,
    )  # fmt: skip


def leavers(n: int, *, stay: int = 0, come_back: bool = True) -> FloatArray:
    """Shares (2 n, stations) of the lane: n never in it, n in it that leave 1 to 5 stations ahead of FIRST but for `stay`."""
    in_lane = np.zeros((2 * n, STATIONS))
    for i in range(n):
        in_lane[i, : FIRST - 1 - i % 5] = 1.0
        if come_back:
            in_lane[i, LAST + 2 + i % 5 :] = 1.0
        if i < stay:
            in_lane[i] = 1.0
    return in_lane


def test_lane_that_everybody_leaves_is_closed_from_where_the_last_one_left() -> None:
    log_lr = evidence(leavers(10))
    assert log_lr.max() > 15
    e, b = np.unravel_index(int(log_lr.argmax()), log_lr.shape)
    assert FIRST - 1 <= e <= FIRST + 3
    assert LAST - 2 <= b <= LAST + 1
    assert np.isneginf(log_lr[30, 20])


def test_each_vehicle_that_stays_speaks_against_a_closure_by_the_odds_of_one_in_twenty() -> None:
    """log(1/20) = -3.0 each, and the change of lanes that it did not make."""
    log_lr = [evidence(leavers(10, stay=stay))[FIRST, LAST] for stay in range(4)]
    assert all(b < a - 3.0 for a, b in pairwise(log_lr))


def test_two_that_drive_through_open_the_lane_and_one_leaves_it_unsure() -> None:
    """Ten drive beside the lane; nobody leaves or enters it."""
    log_lr = []
    for through in range(3):
        in_lane = np.zeros((10, STATIONS))
        in_lane[:through] = 1.0
        log_lr.append(evidence(in_lane, other_changes=1 / 3)[FIRST, LAST])  # each on 1000 m: as often as beforehand
    assert log_lr[0] == pytest.approx(np.log(1 + 3200 / (3000 + 6800)), abs=0.02)  # driven beside it inside and outside, in m
    assert -4.0 < log_lr[1] < 0.0
    assert log_lr[2] < -4.0


def test_evidence_of_mere_absence_grows_with_the_logarithm_of_the_traces() -> None:
    """log(1 + E / E_0) with E = n times 1000 m beside the lane and E_0 = 3000 m between changes."""
    for n in (10, 100, 1000):
        log_lr = evidence(np.zeros((n, STATIONS)), other_changes=1 / 3)[0, STATIONS - 1]
        assert log_lr == pytest.approx(np.log(1 + n * STATIONS * SPACING / 3000.0), abs=0.05)


@pytest.mark.parametrize("other_changes", [0.0, 0.5])
def test_leavers_speak_for_a_closure_by_the_ratio_of_two_predictions_of_lane_changes(other_changes: float) -> None:
    """Ten of 20 leave at 40 m: on half a mile anywhere where the lane closes, or by a rate that is Gamma(1, 3000 m)."""
    in_lane = np.zeros((20, STATIONS))
    in_lane[:10, :2] = 1.0
    near, far = (evidence(in_lane, other_changes=other_changes)[at, 49] for at in ((10, 20)))
    changes, driven = 10 + 20 * other_changes, 3000 + 20 * STATIONS * SPACING

    def predicted(count: float) -> float:
        return float(gammaln(1 + count) - (1 + count) * np.log(driven))

    merged = predicted(changes - 10) - predicted(changes) - 10 * np.log(805.0)
    beside = 20 * (STATIONS - 10) * SPACING
    absence = np.log(1 + beside / (driven / (1 + changes) + 20 * 10 * SPACING - 10 * 2 * SPACING))
    assert near == pytest.approx(max(merged, 0) + absence - (200 - 30) / (805 / 2), abs=0.01)
    assert abs(near - far) < 1.5  # where they left says little of where the lane closes


def test_vehicles_that_leave_more_than_half_a_mile_ahead_say_nothing_of_a_closure() -> None:
    in_lane = np.zeros((20, STATIONS))
    in_lane[:10, :2] = 1.0
    assert evidence(in_lane)[40, 49] > evidence(in_lane)[44, 49] + 10


def test_receiver_that_cannot_tell_lanes_apart_says_little() -> None:
    sharp, blurred = (evidence(leavers(10), visibility=v)[FIRST, LAST] for v in (1.0, 0.05))
    assert 0 < blurred < 0.25 * sharp


def test_vehicles_that_were_not_seen_there_say_nothing_of_an_interval() -> None:
    in_lane = leavers(10, stay=3)
    seen = np.ones(in_lane.shape, dtype=bool)
    seen[:3, FIRST - 1 : LAST + 2] = False
    assert evidence(in_lane, seen=seen)[FIRST, LAST] > evidence(in_lane)[FIRST, LAST] + 6


STATIONS_M = np.linspace(0.0, 1980.0, 100)


def test_prior_of_an_interval_sums_to_1_and_no_closure_is_shorter_than_40_m() -> None:
    zone = AnnouncedZone(start_m=500.0, end_m=1500.0, start_sd_m=60.0, end_sd_m=60.0)
    for announced in (None, zone):
        prior = interval_prior(STATIONS_M, 1, 2, announced=announced, taper_m=219.0, shoulder=1.0).sum(axis=0)
        assert prior.sum() == pytest.approx(1.0)
        e, b = np.nonzero(prior)
        assert (STATIONS_M[b] - STATIONS_M[e]).min() >= 40


def test_closed_interval_begins_within_the_taper_behind_the_announced_first_device() -> None:
    """The lane is no longer usable some .7 L behind it, L = 219 m, and a shoulder taper of L/3 may stand ahead."""
    zone = AnnouncedZone(start_m=500.0, end_m=1500.0, start_sd_m=20.0, end_sd_m=20.0)
    prior = interval_prior(STATIONS_M, 1, 2, announced=zone, taper_m=219.0, shoulder=1.0).sum(axis=0)
    start, end = prior.sum(axis=1), prior.sum(axis=0)
    assert start[(STATIONS_M > 500) & (STATIONS_M < 900)].sum() > 0.75
    assert 600 < STATIONS_M[int(start.argmax())] < 780
    assert STATIONS_M[int(end.argmax())] == pytest.approx(1470, abs=20)
    # Some of it is anywhere: an announcement may be wrong.
    assert 0.02 < start[STATIONS_M < 400].sum() < 0.15


@pytest.mark.parametrize("shift", [-200.0, 300.0])
def test_prior_moves_with_the_announcement(shift: float) -> None:
    taper = {"taper_m": 219.0, "shoulder": 0.0}
    here, there = (
        interval_prior(
            STATIONS_M, 0, 2, announced=AnnouncedZone(start_m=600.0 + d, end_m=1400.0 + d, start_sd_m=30, end_sd_m=30), **taper
        ).sum(axis=0)
        for d in (0.0, shift)
    )
    for axis in (0, 1):
        peaks = [STATIONS_M[int(prior.sum(axis=axis).argmax())] for prior in (here, there)]
        assert peaks[1] - peaks[0] == pytest.approx(shift, abs=1)


def test_less_certain_announcement_spreads_the_prior() -> None:
    spread = []
    for sd in (15.0, 150.0):
        zone = AnnouncedZone(start_m=500.0, end_m=1500.0, start_sd_m=sd, end_sd_m=sd)
        end = interval_prior(STATIONS_M, 1, 2, announced=zone, taper_m=219.0, shoulder=0.0).sum(axis=(0, 1))
        near = np.abs(STATIONS_M - 1470) < 450
        spread.append(np.sqrt(np.average((STATIONS_M[near] - 1470) ** 2, weights=end[near])))
    assert spread[1] > 1.5 * spread[0]


def test_longer_taper_ends_farther_behind_the_first_device() -> None:
    """So a taper that is held to be long begins no earlier: its open ground ends where a short one's does."""
    zone = AnnouncedZone(start_m=500.0, end_m=1500.0, start_sd_m=5.0, end_sd_m=5.0)
    prior = interval_prior(STATIONS_M, 1, 2, announced=zone, taper_m=200.0, shoulder=0.0)
    near = (STATIONS_M > 500) & (STATIONS_M < 1000)
    for of_length, (length, p_length) in zip(prior, TAPER_LENGTHS, strict=True):
        start = of_length.sum(axis=1) * near
        assert STATIONS_M[int(start.argmax())] == pytest.approx(500 + 0.69 * length * 200.0, abs=11)
        assert of_length.sum() == pytest.approx(p_length, rel=0.02)
