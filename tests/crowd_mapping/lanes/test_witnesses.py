from typing import Any

import numpy as np
import pytest
from crowd_mapping.lanes.fits import always_in, fit_of, seen
from scipy.stats import norm

from wzsumo.crowd_mapping.lanes.witnesses import misplaced_share, open_where_driven, share_of_fixes
from wzsumo.frames import FloatArray
from wzsumo.lane_map import MappedLane

M = 30


def lanes(p_open_left: FloatArray | float) -> tuple[MappedLane, ...]:
    sd = np.full(M, 0.1)
    p = np.broadcast_to(p_open_left, M)
    return tuple(
        MappedLane(right=np.full(M, 3.6 * k - 1.8), left=np.full(M, 3.6 * k + 1.8), right_sd=sd, left_sd=sd,
                   p_open=np.repeat(open_[:, None], 8, axis=1), n_traces=3)
        for k, open_ in enumerate((np.ones(M), p))
    )  # fmt: skip


def opened(
    users: int, *, sigma: float = 0.3, stray: FloatArray | float = 0.0, slow: bool = False
) -> tuple[FloatArray, list[str]]:
    """P(open) at the middle of a left lane that the model closes, in which some of 10 vehicles drive."""
    in_lane = always_in([1] * users + [0] * (10 - users), n_stations=M)
    fit = fit_of(in_lane, sigma=sigma, stray=stray)
    observations = seen(3.6 * in_lane[:, :, 1])
    made, words = open_where_driven(lanes(0.02), fit, observations, slow=np.full((10, M), slow))
    return made[1].p_open_middle, words


def test_one_that_drives_in_a_closed_lane_does_not_open_it_and_three_do_and_are_told() -> None:
    p, words = opened(1)
    assert (p == 0.02).all()
    assert words == []
    p, words = opened(3)
    assert (p > 0.804).all()  # free
    assert len(words) == 1
    assert "3 traces drove in lane 1" in words[0]
    assert "0 m and 580 m" in words[0]


def test_two_good_witnesses_open_a_closed_lane() -> None:
    assert (opened(2, sigma=0.3)[0] > 0.804).all()


@pytest.mark.parametrize("how", [{"sigma": 3.0}, {"stray": 0.9}, {"slow": True}])
def test_poor_receivers_stray_and_creeping_vehicles_are_no_witnesses(how: dict[str, Any]) -> None:
    assert (opened(4, **how)[0] == 0.02).all()


def test_lane_is_opened_where_witnesses_drove_and_stays_closed_elsewhere() -> None:
    in_lane = always_in([0] * 10, n_stations=M)
    in_lane[:4, 10:20] = [0.0, 1.0]
    made, _ = open_where_driven(lanes(0.02), fit_of(in_lane), seen(3.6 * in_lane[:, :, 1]), slow=np.zeros((10, M), dtype=bool))
    assert ((made[1].p_open_middle > 0.5) == ((np.arange(M) >= 10) & (np.arange(M) < 20))).all()
    assert (made[0].p_open_middle == 1.0).all()


@pytest.mark.parametrize("sigma", [0.3, 1.2, 3.0])
def test_share_that_is_misplaced_is_the_tail_beyond_half_a_lane(sigma: float) -> None:
    fit = fit_of(always_in([0] * 5, n_stations=M), sigma=sigma)
    assert misplaced_share(fit) == pytest.approx(norm.sf(1.8 / sigma))


def test_share_of_fixes_counts_those_in_free_and_in_closed_lanes() -> None:
    """Three of four keep the right lane; the left one is closed on a third of its stations."""
    in_lane = always_in([0, 0, 0, 1], n_stations=M)
    p_open = np.where(np.arange(M) < 10, 0.1, 0.9)
    burst = np.zeros((4, M))
    on_free, on_occupied = share_of_fixes(lanes(p_open), fit_of(in_lane, burst=burst), seen(3.6 * in_lane[:, :, 1]))
    assert on_occupied == pytest.approx(10 / 120)
    assert on_free == pytest.approx(110 / 120)
    burst[3] = 1.0  # off the lanes' course, and yet on the left lane's ground: it counts, unless it came there by a jump
    again = share_of_fixes(lanes(p_open), fit_of(in_lane, burst=burst), seen(3.6 * in_lane[:, :, 1]))
    assert again == pytest.approx((on_free, on_occupied))
    aside = share_of_fixes(lanes(p_open), fit_of(0 * in_lane + in_lane[0], burst=burst), seen(3.6 * in_lane[:, :, 1] * 4))
    assert aside == (1.0, 0.0)
