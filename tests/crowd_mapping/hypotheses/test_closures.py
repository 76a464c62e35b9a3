import numpy as np
import pytest

from wzsumo.crowd_mapping.hypotheses.announcement import Announced
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern

STATIONS = np.arange(0.0, 1700.0, 10.0)
TAPER_M = 200.0


def likeliest(announced, pattern):
    """Stations [m] of the likeliest closure's two ends."""
    closures = ClosurePrior(stations=STATIONS, announced=announced, merging_m=TAPER_M).closures(pattern)
    assert np.exp(closures.log_chance).sum() == pytest.approx(1.0)
    return 10.0 * closures.pairs[np.argmax(closures.log_chance)]


# MUTCD 11th ed., Table 6B-3: a merging taper L, ahead of it one of L/3 for a shoulder's width; TA-37: 2 L between two merging
# tapers. Downstream 100 ft a lane. Places are tried every 100 m.
@pytest.mark.parametrize(
    ("pattern", "shoulder", "closes_m", "opens_m"),
    [
        (LanePattern(2, (1,)), 0.0, 300 + 200, 1500 - 30),
        (LanePattern(2, (1,)), 1.0, 300 + 267, 1500 - 30),
        (LanePattern(3, (1, 2)), 0.0, 300 + 800, 1500 - 60),
    ],
)
def test_announced_lanes_are_closed_from_where_the_manual_puts_their_tapers(
    pattern, shoulder: float, closes_m: float, opens_m: float
) -> None:
    announced = Announced(start=300.0, end=1500.0, shoulders=(0.0, shoulder))
    np.testing.assert_allclose(likeliest(announced, pattern), [closes_m, opens_m], atol=55)


def test_closure_of_which_nothing_is_known_is_about_500_m_long() -> None:
    closes, opens = likeliest(None, LanePattern(2, (1,)))
    assert opens - closes == pytest.approx(500, abs=55)


def test_shoulder_ahead_of_a_lane_on_the_right_is_that_of_the_mirrored_zone() -> None:
    announced = Announced(start=300.0, end=1500.0, shoulders=(1.0, 0.0))
    prior = ClosurePrior(stations=STATIONS, announced=announced, merging_m=TAPER_M)
    assert prior.mirrored.announced.closing(1, lanes_before=0) == announced.closing(-1, lanes_before=0)


def test_lanes_that_all_stay_open_have_no_closure() -> None:
    closures = ClosurePrior(stations=STATIONS, announced=None, merging_m=TAPER_M).closures(LanePattern(2, ()))
    np.testing.assert_array_equal(closures.pairs, [[0, 0]])
