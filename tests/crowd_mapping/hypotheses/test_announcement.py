import numpy as np
import pytest

from wzsumo.crowd_mapping.hypotheses.announcement import AnnouncedZone, TaperEndPrior
from wzsumo.frames import FloatArray

ENDS = np.arange(0.0, 8000.0)  # the first device stands at 500 m; a taper is 200 m long


def prior(*, lanes_before: int = 0, shoulder_lanes: float = 0.0) -> TaperEndPrior:
    return TaperEndPrior(first_device=500.0, lanes_before=lanes_before, shoulder_lanes=shoulder_lanes)


def mass_near(density: FloatArray, end: float) -> float:
    return float(density[np.abs(ENDS - end) < 40].sum())


def test_lane_ends_one_taper_beyond_the_first_device_with_a_standard_deviation_of_8_m() -> None:
    density = prior().density_as_drawn(ENDS, length=200.0)
    mean = (density * ENDS).sum() / density.sum()
    assert mean == pytest.approx(700.0)
    assert np.sqrt((density * (ENDS - mean) ** 2).sum() / density.sum()) == pytest.approx(8.0, rel=1e-3)


# MUTCD 11th ed., Table 6B-3: a shoulder's taper is a third of L for its own width, here 8 ft of 12.
@pytest.mark.parametrize(("shoulder_lanes", "share"), [(0.65, 0.9), (0.55, 0.1)])
def test_shoulder_of_8_ft_and_more_is_likely_closed_by_a_taper_of_its_own(shoulder_lanes: float, share: float) -> None:
    density = prior(shoulder_lanes=shoulder_lanes).density_as_drawn(ENDS, length=600.0)
    assert mass_near(density, 500 + 600 * (1 + shoulder_lanes / 3)) == pytest.approx(0.95 * share, rel=1e-3)


# MUTCD 11th ed., TA-37: 2 L between two merging tapers.
@pytest.mark.parametrize(("end_m", "share"), [(900.0, 0.3), (1100.0, 0.2), (1300.0, 0.5)])
def test_second_lane_ends_after_another_taper_and_a_tangent(end_m: float, share: float) -> None:
    assert mass_near(prior(lanes_before=1).density_as_drawn(ENDS, length=200.0), end_m) == pytest.approx(0.95 * share, rel=1e-3)


def test_one_lane_in_twenty_ends_late_on_average_two_tapers_beyond_the_first() -> None:
    density = prior().density_late(ENDS, length=200.0)
    assert density.sum() == pytest.approx(0.05, rel=0.01)
    assert (density * ENDS).sum() / density.sum() == pytest.approx(700 + 2 * 200, rel=0.01)
    assert density[ENDS <= 700].sum() == 0.0
    assert prior().density(ENDS, length=200.0).sum() == pytest.approx(1.0, rel=1e-3)


def test_lane_is_announced_with_the_shoulder_on_its_side_and_opens_without_any() -> None:
    zone = AnnouncedZone(first_device=500.0, last_device=1500.0, shoulders_lanes=(0.8, 0.4))
    assert zone.closing_prior(-1, lanes_before=1) == prior(lanes_before=1, shoulder_lanes=0.8)
    assert zone.closing_prior(2, lanes_before=0) == prior(shoulder_lanes=0.4)
    assert zone.mirrored.closing_prior(2, lanes_before=0) == zone.closing_prior(-1, lanes_before=0)
    assert zone.opening_prior(lanes_before=0) == TaperEndPrior(first_device=-1500.0, lanes_before=0, shoulder_lanes=0.0)
