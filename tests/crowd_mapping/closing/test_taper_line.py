import numpy as np
import pytest
from scipy.stats import exponnorm

from wzsumo.crowd_mapping.closing.taper_line import STATION_SD_M, _shifted_exponential, fit_taper_line
from wzsumo.tapers import merging_taper_m

STATIONS = np.arange(0.0, 1000.0, 10.0)
HALF_VEHICLE = 0.25  # of a lane


def leaver(at, *, length=60.0):
    """A vehicle that starts to leave the lane at a station: shares of the lane still to go."""
    t = np.clip((STATIONS - at) / length, 0, 1)
    return 1 - t * t * (3 - 2 * t)


def fitted(leavers, *, kink=None):
    return fit_taper_line(STATIONS, np.array(leavers), length=200.0, half_vehicle=HALF_VEHICLE, kink=kink)


# MUTCD 11th ed., Table 6B-4: 12 ft at 40 mph 320 ft, at 60 mph 720 ft.
@pytest.mark.parametrize(("speed_mph", "length_ft"), [(40, 320), (60, 720)])
def test_taper_length_matches_the_manual(speed_mph: int, length_ft: int) -> None:
    assert merging_taper_m(speed_mph * 0.44704, width_m=3.6576) == pytest.approx(length_ft * 0.3048, rel=1e-3)


def test_line_lies_beyond_every_vehicle_that_was_still_in_the_lane() -> None:
    line = fitted([leaver(400.0), leaver(300.0)])
    # Body's outer side at 3/4 of the lane at s = 400: a line of 200 m that clears it ends at 400 + 0.75 * 200 or later.
    chance = line.open_beyond(np.array([390.0, 400.0]), np.array([0.7, 0.7]))
    assert (chance > 0.75).all()
    assert line.end > 400 + 0.75 * 200 - 10


def test_more_vehicles_narrow_the_belief() -> None:
    random = np.random.default_rng(0)
    few, many = (fitted([leaver(500 - gap) for gap in random.exponential(80, n)]) for n in (2, 40))
    assert many.end_sd < few.end_sd


def test_belief_covers_the_true_end_as_often_as_it_says() -> None:
    random = np.random.default_rng(1)
    ranks = []
    for _ in range(150):
        end = random.uniform(500, 700)
        latest = end - 0.75 * 200.0  # the latest place to start leaving
        leavers = [leaver(latest - min(gap, 330.0)) for gap in random.exponential(80, 5)]
        line = fitted(leavers)
        ranks.append(1 - line.open_beyond(np.array([end]), np.zeros(1))[0])
    # Uniform if calibrated; its length is uncertain by 15 % too, so the middle is somewhat fuller.
    assert 0.75 < np.mean((np.array(ranks) > 0.05) & (np.array(ranks) < 0.95)) <= 1.0
    assert 0.35 < np.mean(ranks) < 0.65


def test_kink_ahead_draws_the_line_to_it() -> None:
    free = fitted([leaver(300.0)])
    drawn = fitted([leaver(300.0)], kink=480.0)
    assert abs(drawn.end - 480.0) < abs(free.end - 480.0)
    assert drawn.end_sd < free.end_sd


def test_chance_falls_along_the_road_and_towards_the_outer_edge() -> None:
    line = fitted([leaver(300.0), leaver(350.0)])
    along = line.open_beyond(STATIONS, np.full(len(STATIONS), 0.5))
    assert (np.diff(along) <= 1e-12).all()
    across = line.open_beyond(np.full(11, 460.0), np.linspace(0, 1, 11))
    assert (np.diff(across) <= 1e-12).all()
    assert along[0] == pytest.approx(1.0, abs=1e-6)
    assert along[-1] == pytest.approx(0.0, abs=1e-6)


def test_blurred_gap_has_the_density_of_an_exponentially_modified_gaussian() -> None:
    gap, scale = np.linspace(-40, 300, 50), 60.0
    expected = exponnorm.pdf(gap, scale / STATION_SD_M, scale=STATION_SD_M)
    np.testing.assert_allclose(_shifted_exponential(gap, scale), expected, rtol=1e-9)
