from typing import Any

import numpy as np
import pytest
from crowd_mapping.lanes.fits import always_in, fit_of, seen

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.crowd_mapping.lanes.closure_evidence import TAPER_LENGTHS
from wzsumo.crowd_mapping.lanes.closures import (
    Closure,
    ClosurePrior,
    fit_closures,
    log_closing,
    p_open_strips,
    slow_stretches,
)
from wzsumo.frames import FloatArray

STATIONS = np.arange(600, dtype=np.float64)
E, B = 250, 400  # the lane can no longer be driven from 250 m, and again from 400 m
L = 200.0  # taper
STRIPS = 8


def strips(*, outer_left: bool, p_closed: float = 1.0) -> FloatArray:
    interval = np.zeros((len(TAPER_LENGTHS), 600, 600))
    interval[:, E, B] = [p_length for _, p_length in TAPER_LENGTHS]
    closure = Closure(p_closed=p_closed, interval=interval)
    return p_open_strips([closure], STATIONS, outer_left=outer_left, taper_m=L, strips=STRIPS)


def test_taper_closes_the_strips_from_the_outer_line_to_the_inner_one() -> None:
    """At e 1.13 m of a 12 ft lane are left, .31 of its width: strip f closes (f - .31) L ahead of it."""
    p = strips(outer_left=True)
    across = (np.arange(STRIPS) + 0.5) / STRIPS
    for strip, f in enumerate(across):
        half = int(np.flatnonzero(p[:, strip] < 0.5)[0])
        assert half == pytest.approx(E + (1 - f - 0.69) * L, abs=2)  # half of the prior's tapers are of length L
        again = int(np.flatnonzero(p[:, strip] < 0.5)[-1])
        assert again == pytest.approx(B + f * 30, abs=2)  # downstream taper of 100 ft
    assert (np.diff(p[E - 100 : E + 40], axis=0) <= 1e-12).all()
    assert p[300].max() < 0.5
    assert p[[440, 599]].min() == 1.0


def test_all_lengths_of_tapers_meet_where_the_lane_can_no_longer_be_driven() -> None:
    p = strips(outer_left=True)
    across = (np.arange(STRIPS) + 0.5) / STRIPS
    assert (p[E - 1, across < 0.3] > 0.999).all()
    assert (p[E + 1, across > 0.33] < 0.001).all()


def test_taper_of_the_right_lane_is_the_mirror_image() -> None:
    assert strips(outer_left=False) == pytest.approx(strips(outer_left=True)[:, ::-1])


@pytest.mark.parametrize("p_closed", [0.0, 0.3, 0.9])
def test_strip_is_as_surely_closed_as_its_lane(p_closed: float) -> None:
    assert strips(outer_left=True, p_closed=p_closed)[395] == pytest.approx(1 - p_closed)


def test_vehicle_that_creeps_while_others_drive_by_is_slow() -> None:
    slowness = np.full((5, 10), 0.05)
    slowness[2, 4:7] = 0.5
    slowness[3] = 0.07
    slow = slow_stretches(seen(np.zeros((5, 10)), slowness=slowness))
    assert slow[2].tolist() == [False] * 4 + [True] * 3 + [False] * 3
    assert slow.sum() == 3


def test_queue_in_which_all_creep_has_no_slow_vehicle() -> None:
    assert not slow_stretches(seen(np.zeros((5, 10)), slowness=0.5)).any()


def prior_of(**announced: Any) -> ClosurePrior:
    zone = AnnouncedZone(start_m=300.0, end_m=700.0, **announced) if announced else None
    return ClosurePrior(announced=zone, taper_m=200.0, shoulders=(1.0, 1.0))


def log_odds(p: float) -> float:
    return float(np.log(p / (1 - p)))


def test_announcement_that_names_lanes_makes_these_likely_to_be_closed_and_the_others_not() -> None:
    said = prior_of(closed_lanes=(1,))
    assert said.log_odds(1) > log_odds(0.6)
    assert said.log_odds(0) < log_odds(0.2)
    assert prior_of(start_sd_m=50.0).log_odds(0) == pytest.approx(0.0, abs=1.0)
    assert prior_of().log_odds(0) < log_odds(0.1)


def test_ordinary_road_with_drivers_in_both_lanes_has_no_closure() -> None:
    fit = fit_of(always_in([0, 0, 0, 1, 1, 1], n_stations=50))
    _, closures = fit_closures(fit, seen(np.array([0, 0, 0, 3.6, 3.6, 3.6])[:, None] * np.ones(50)), prior_of())
    assert [[closure.p_closed < 0.01 for closure in of_lane] for of_lane in closures] == [[True], [True]]


def test_lane_that_six_leave_ahead_of_the_announced_zone_is_closed_in_it() -> None:
    in_lane = always_in([0] * 12, n_stations=50)
    in_lane[:6, :18] = [0.0, 1.0]
    in_lane[:6, 36:] = [0.0, 1.0]
    offset = 3.6 * in_lane[:, :, 1]
    _, of_lanes = fit_closures(fit_of(in_lane), seen(offset), prior_of(start_sd_m=50.0, end_sd_m=50.0))
    closures = [of_lane[0] for of_lane in of_lanes]
    assert [len(of_lane) for of_lane in of_lanes] == [1, 1]
    assert closures[1].p_closed > 0.95
    assert closures[0].p_closed < 0.05
    interval = closures[1].interval.sum(axis=0)
    begin, end = (interval.sum(axis=axis) @ (20.0 * np.arange(50)) for axis in (1, 0))
    assert 350 < begin < 480
    assert 640 < end < 740


def test_two_work_areas_in_one_lane_are_two_closures() -> None:
    """The crowd leaves the lane ahead of 400 m and of 1,200 m, and comes back at 600 m and 1,400 m."""
    in_lane = always_in([0] * 40, n_stations=90)
    stations = np.arange(90)
    for i in range(20):
        inside = ((stations >= 18 - i % 3) & (stations <= 31 + i % 3)) | ((stations >= 58 - i % 3) & (stations <= 71 + i % 3))
        in_lane[i] = np.where(inside[:, None], [1.0, 0.0], [0.0, 1.0])
    fit = fit_of(in_lane)
    _, closures = fit_closures(fit, seen(3.6 * in_lane[:, :, 1]), prior_of())
    assert [len(of_lane) for of_lane in closures] == [1, 2]
    p_open = p_open_strips(closures[1], np.arange(0.0, 1800.0, 20.0), outer_left=True, taper_m=1.0, strips=1)[:, 0]
    assert p_open[[10, 45, 85]].min() > 0.9
    assert p_open[[25, 65]].max() < 0.1


def test_lane_that_vehicles_leave_outwards_is_no_likelier_for_it() -> None:
    """As on the way to an exit: in the outer lane for 200 m, then beside the road. A lane that closes is left inwards."""
    outwards = always_in([1] * 30, n_stations=60, n_lanes=2)
    outwards[:15, 40:50] = [1.0, 0.0]
    outwards[:15, 50:] = 0.0
    inwards = always_in([1] * 30, n_stations=60, n_lanes=2)
    inwards[:15, :40] = [1.0, 0.0]
    sights = [seen(3.6 * in_lane[:, :, 1]) for in_lane in (outwards, inwards)]
    assert log_closing(fit_of(outwards), sights[0]) < 1.0
    assert log_closing(fit_of(inwards), sights[1]) > 10.0


def test_auxiliary_lane_begins_where_good_receivers_enter_it_whatever_poor_ones_seem_to_drive() -> None:
    """Ten of 50 enter the right lane at 800 m and leave it by 1,100 m; eight poor receivers seem to be in it ahead of that."""
    in_lane = always_in([1] * 50, n_stations=90, n_lanes=3)
    for i in range(10):
        in_lane[i, 40 + i % 4 : 56 - i % 3] = [1.0, 0.0, 0.0]
    in_lane[42:, :40] = [0.7, 0.3, 0.0]
    sigma = np.r_[np.full(42, 0.5), np.full(8, 2.5)]
    _, closures = fit_closures(fit_of(in_lane, sigma=sigma), seen(3.6 * (in_lane @ np.arange(3.0))), ClosurePrior())
    p_open = p_open_strips(closures[0], np.arange(0.0, 1800.0, 20.0), outer_left=False, taper_m=1.0, strips=1)[:, 0]
    assert p_open[[16, 20, 24]].max() < 0.3
    assert p_open[48] > 0.8


def test_lane_that_nobody_enters_for_long_after_its_closure_has_one_closure() -> None:
    """The zone ends at 700 m, the crowd comes back at 1,200 m: nobody shows that the lane was open in between."""
    in_lane = always_in([0] * 40, n_stations=90)
    in_lane[:20, :18] = [0.0, 1.0]
    in_lane[:20, 60:] = [0.0, 1.0]
    _, closures = fit_closures(fit_of(in_lane), seen(3.6 * in_lane[:, :, 1]), prior_of(start_sd_m=15.0, end_sd_m=15.0))
    assert [len(of_lane) for of_lane in closures] == [1, 1]
