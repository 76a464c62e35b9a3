import numpy as np
import pytest
from scipy.stats import exponnorm, norm

from wzsumo.crowd_mapping.closing.taper_line import TaperLine, _gap_density, fit_taper_line
from wzsumo.crowd_mapping.hypotheses.announcement import TaperEndPrior
from wzsumo.frames import FloatArray
from wzsumo.tapers import merging_taper_m

STATIONS = np.arange(0.0, 1400.0, 10.0)
FIRST_DEVICE = TaperEndPrior(first_device=500.0, lanes_before=0, shoulder_lanes=0.0)  # a lane then ends at 700 m


def leaver(at: float, *, length: float = 60.0) -> FloatArray:
    """A vehicle that starts to leave the lane at a station: shares (stations,) of the lane still to go."""
    t = np.clip((STATIONS - at) / length, 0, 1)
    return np.asarray(1 - t * t * (3 - 2 * t))


def jumpers(at: list[float]) -> FloatArray:
    """Vehicles that are in the lane up to stations [m] and out of it from the next one on."""
    return np.where(np.array(at)[:, None] >= STATIONS, 1.0, 0.0)


def fitted(
    leavers: FloatArray | list[FloatArray],
    *,
    kink: float | None = None,
    end_prior: TaperEndPrior | None = None,
    mislabelled: float = 0.0,
) -> TaperLine:
    """The line of a taper of 200 m for vehicles half a lane wide."""
    leavers = np.array(leavers).reshape(-1, len(STATIONS))
    return fit_taper_line(
        STATIONS, leavers, length=200.0, half_vehicle=0.25, kink=kink, end_prior=end_prior,
        mislabelled=np.full(len(leavers), mislabelled),
    )  # fmt: skip


# MUTCD 11th ed., Table 6B-4: 12 ft at 40 mph 320 ft, at 60 mph 720 ft.
@pytest.mark.parametrize(("speed_mph", "length_ft"), [(40, 320), (60, 720)])
def test_taper_length_matches_the_manual(speed_mph: int, length_ft: int) -> None:
    assert merging_taper_m(speed_mph * 0.44704, width_m=3.6576) == pytest.approx(length_ft * 0.3048, rel=1e-3)


def test_line_lies_beyond_every_vehicle_that_was_still_in_the_lane() -> None:
    line = fitted([leaver(400.0), leaver(300.0)])
    # The body's outer side is at 3/4 of the lane at s = 400: a line of 200 m that clears it ends at 400 + 0.75 * 200 or later.
    chance = line.open_beyond(np.array([390.0, 400.0]), np.array([0.7, 0.7]))
    assert (chance > 0.75).all()
    assert line.end > 400 + 0.75 * 200 - 10


# Sixty vehicles that leave at one place leave a gap of 100 / 60 / 60 m; with a chance of 0.3 all leave early, 100 m on average.
def test_line_lies_30_m_beyond_many_vehicles_that_leave_at_one_place_for_they_may_all_be_early() -> None:
    line = fitted(jumpers([400.0] * 60))
    assert line.end == pytest.approx(400 + 0.75 * 200 + 30, abs=3)


# One vehicle: an exponential gap of 100 m; with a chance of 0.3 one of 200 m. Ends are looked for up to 400 m and more beyond.
def test_line_lies_100_m_beyond_a_single_vehicle_and_more_where_it_may_be_early() -> None:
    gap = np.arange(0.0, 400.0)
    density = 0.7 * np.exp(-gap / 100) / 100 + 0.3 * np.exp(-gap / 200) / 200
    assert fitted(jumpers([400.0])).end == pytest.approx(400 + 0.75 * 200 + (density * gap).sum() / density.sum(), abs=8)


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


def test_line_ends_at_the_kink_or_a_tangent_of_half_a_taper_ahead_of_it() -> None:
    free, drawn = (fitted(jumpers([550.0]), kink=kink) for kink in (None, 900.0))
    ahead = 900.0 - free.stations
    # Each has four tenths: at the kink to 10 m, or 100 m ahead to a tenth of 200 m; else the line ends anywhere ahead.
    expected = 0.4 * norm.pdf(ahead, 0, 10) + 0.4 * norm.pdf(ahead, 100, 20)
    expected += 0.2 * np.where(ahead > -10, 1 / 200, 0) / np.sqrt(2 * np.pi)
    weight = drawn.probability[1][: len(ahead)] / free.probability[1]
    near = np.abs(ahead - 50) < 70
    np.testing.assert_allclose((weight / weight[near].sum())[near], (expected / expected[near].sum())[near], rtol=1e-3)


def test_chance_falls_along_the_road_and_towards_the_outer_edge() -> None:
    line = fitted([leaver(300.0), leaver(350.0)])
    along = line.open_beyond(STATIONS, np.full(len(STATIONS), 0.5))
    assert (np.diff(along) <= 1e-12).all()
    across = line.open_beyond(np.full(11, 460.0), np.linspace(0, 1, 11))
    assert (np.diff(across) <= 1e-12).all()
    assert along[0] == pytest.approx(1.0, abs=1e-6)
    assert along[-1] == pytest.approx(0.0, abs=1e-6)


def test_length_of_the_taper_is_the_manuals_or_15_percent_off_with_a_chance_of_a_quarter_each() -> None:
    line = TaperLine(stations=np.array([700.0]), probability=np.ones((3, 1)), lengths=fitted([leaver(300.0)]).lengths)
    np.testing.assert_allclose(line.lengths, [170.0, 200.0, 230.0])
    # At the outer edge the line passes 700 m less its length.
    chance = line.open_beyond(np.array([460.0, 480.0, 510.0, 540.0]), np.ones(4))
    np.testing.assert_allclose(chance, [1.0, 0.75, 0.25, 0.0], atol=1e-9)


def test_blurred_gap_has_the_density_of_an_exponentially_modified_gaussian_of_8_m() -> None:
    gap, mean = np.linspace(-40, 300, 50), 60.0
    np.testing.assert_allclose(_gap_density(gap, mean), exponnorm.pdf(gap, mean / 8.0, scale=8.0), rtol=1e-9)


# MUTCD 11th ed., Table 6B-3: a shoulder's taper is a third of L for its own width. Ahead of lanes without a shoulder: none.
@pytest.mark.parametrize(("shoulder", "end_m"), [(0.0, 700.0), (1.0, 700.0 + 200.0 / 3)])
def test_line_of_an_announced_zone_ends_where_the_manual_puts_it(shoulder: float, end_m: float) -> None:
    prior = TaperEndPrior(first_device=500.0, lanes_before=0, shoulder_lanes=shoulder)
    line = fitted(np.empty((0, len(STATIONS))), end_prior=prior)
    median = line.stations[np.searchsorted(np.cumsum(line.probability[1]), 0.5)]
    assert median == pytest.approx(end_m, abs=6)


# A trace has mistaken lanes with a chance of a twentieth at least. It then seems to leave the lane anywhere along 1000 m.
@pytest.mark.parametrize(("mislabelled", "mistaken"), [(0.0, 0.05), (0.3, 0.3)])
def test_announced_line_of_one_vehicle_equals_its_densities_written_out(mislabelled: float, mistaken: float) -> None:
    line = fitted(jumpers([840.0]), end_prior=FIRST_DEVICE, mislabelled=mislabelled)
    gap, certain = line.stations - (840 + 0.75 * 200), 1 - mistaken
    clear = certain * norm.cdf(gap / 8)
    mean = (100 + clear * np.maximum(gap, 0)) / (1 + clear)
    left = np.asarray(certain * exponnorm.pdf(gap, mean / 8, scale=8) + mistaken / 1000)
    belief = FIRST_DEVICE.density_as_drawn(line.stations, length=200.0) * (1 - certain * norm.cdf(-gap / 8))
    belief += FIRST_DEVICE.density_late(line.stations, length=200.0) * left / left.max()
    np.testing.assert_allclose(line.probability[1], belief / belief.sum(), rtol=1e-6)


def test_vehicles_that_drove_on_beyond_the_announced_line_move_it() -> None:
    assert fitted(jumpers([840.0] * 4), end_prior=FIRST_DEVICE).end > 950.0


def test_line_that_many_vehicles_moved_lies_just_beyond_the_last_of_them() -> None:
    # Twenty vehicles leave the lane one after the other over 300 m: a line 200 m beyond them all would be a coincidence.
    line = fitted(jumpers(list(np.linspace(550.0, 850.0, 20) - 5)), end_prior=FIRST_DEVICE, mislabelled=0.05)
    # The body's outer side is at 3/4 of the lane: clear of lines of 200 m that end 150 m on.
    assert 960 < line.end < 1060


def test_vehicle_that_may_have_been_in_another_lane_does_not_move_the_announced_line() -> None:
    assert fitted(jumpers([840.0]), end_prior=FIRST_DEVICE, mislabelled=0.3).end == pytest.approx(700, abs=40)
