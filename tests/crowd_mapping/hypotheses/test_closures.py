import numpy as np
import pytest

from wzsumo.crowd_mapping.hypotheses.announcement import AnnouncedZone
from wzsumo.crowd_mapping.hypotheses.closures import CandidateClosures, ClosurePrior, known_closure
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern
from wzsumo.frames import FloatArray

STATIONS = np.arange(0.0, 1700.0, 10.0)


def closures_of(announced: AnnouncedZone | None, pattern: LanePattern) -> CandidateClosures:
    return ClosurePrior(stations=STATIONS, announced=announced, merging_length_m=200.0).candidates(pattern)


def likeliest(closures: CandidateClosures) -> FloatArray:
    """Stations [m] of the likeliest closure's two ends."""
    return np.asarray(10.0 * closures.ends[np.argmax(closures.log_prior)])


# MUTCD 11th ed., Table 6B-3: a merging taper L, ahead of it one of L/3 for a shoulder's width; TA-37: 2 L between two merging
# tapers. Downstream 100 ft a lane. Candidates are 100 m apart.
@pytest.mark.parametrize(
    ("pattern", "shoulder", "closes_m", "opens_m"),
    [
        (LanePattern(2, (1,)), 0.0, 300 + 200, 1500 - 30),
        (LanePattern(2, (1,)), 1.0, 300 + 267, 1500 - 30),
        (LanePattern(3, (1, 2)), 0.0, 300 + 800, 1500 - 60),
    ],
)
def test_announced_lanes_are_closed_from_where_the_manual_puts_their_tapers(
    pattern: LanePattern, shoulder: float, closes_m: float, opens_m: float
) -> None:
    announced = AnnouncedZone(first_device=300.0, last_device=1500.0, shoulders_lanes=(0.0, shoulder))
    closures = closures_of(announced, pattern)
    assert np.exp(closures.log_prior).sum() == pytest.approx(1.0)
    np.testing.assert_allclose(likeliest(closures), [closes_m, opens_m], atol=55)


def test_length_of_a_closure_of_which_nothing_is_known_is_lognormal_about_500_m() -> None:
    closures = closures_of(None, LanePattern(2, (1,)))
    closes, opens = likeliest(closures)
    assert opens - closes == pytest.approx(500, abs=55)
    away = np.log(10.0 * np.diff(closures.ends, axis=1)[:, 0] / 500.0) / 0.6
    np.testing.assert_allclose(closures.log_prior + away**2 / 2, (closures.log_prior + away**2 / 2)[0])
    assert len(closures.ends) == 18 * 17 / 2


def test_end_of_an_announced_closure_is_elsewhere_with_a_probability_of_2_percent() -> None:
    announced = AnnouncedZone(first_device=300.0, last_device=1500.0, shoulders_lanes=(0.0, 0.0))
    closures = closures_of(announced, LanePattern(2, (1,)))
    chance = np.exp(closures.log_prior)
    closes, opens = closures.ends[np.argmax(chance)]
    same_end = closures.ends[:, 1] == opens
    earlier = chance[same_end & (closures.ends[:, 0] < closes)]  # a lane that ends late ends later
    # Each of 18 candidates has 1/18 of the 2 %. Closures of more than 500 m are all as likely.
    np.testing.assert_allclose(earlier / chance.max(), 0.02 / 18 / 0.95, rtol=0.1)


def test_shoulder_ahead_of_a_lane_on_the_right_is_that_of_the_mirrored_zone() -> None:
    announced = AnnouncedZone(first_device=300.0, last_device=1500.0, shoulders_lanes=(1.0, 0.0))
    mirrored = ClosurePrior(stations=STATIONS, announced=announced, merging_length_m=200.0).mirrored
    assert mirrored.announced is not None
    assert mirrored.announced.closing_prior(1, lanes_before=0) == announced.closing_prior(-1, lanes_before=0)


def test_lanes_that_all_stay_open_have_no_closure() -> None:
    np.testing.assert_array_equal(closures_of(None, LanePattern(2, ())).ends, [[0, 0]])


def test_known_closure_is_certain() -> None:
    closures = known_closure(3, 7)
    np.testing.assert_array_equal(closures.ends, [[3, 7]])
    np.testing.assert_array_equal(closures.log_prior, [0.0])
