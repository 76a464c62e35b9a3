import math

import numpy as np
import pytest

from wzsumo.planning.connection import N_WORDS, dubins_word, segment_sign, shortest_length
from wzsumo.planning.lattice import poses_along


@pytest.mark.parametrize("word", range(N_WORDS))
def test_dubins_word_ends_at_the_goal_pose(word) -> None:
    rng, solved = np.random.default_rng(word), 0
    for _ in range(300):
        goal, start_heading, radius = rng.uniform([-8, -8, -4], [8, 8, 4]), rng.uniform(-4, 4), rng.uniform(0.5, 3)
        lengths = dubins_word(word, goal[0], goal[1], start_heading, goal[2], radius)
        if not np.isfinite(lengths[0]):
            continue
        segments = np.array([(length, segment_sign(word, k) / radius) for k, length in enumerate(lengths)])
        assert segments[:, 0].min() >= 0
        end = poses_along(np.array([0.0, 0.0, start_heading]), segments, max_step_m=100.0)[-1]
        np.testing.assert_allclose(end[:2], goal[:2], atol=1e-9)
        assert abs(math.remainder(end[2] - goal[2], 2 * math.pi)) < 1e-9
        solved += 1
    assert solved > 100


@pytest.mark.parametrize(
    ("goal", "length"),
    [
        ((10, 0, 0), 10),  # straight on
        ((3, 3, math.pi / 2), 1.5 * math.pi),  # a quarter turn
        ((0, 6, math.pi), 3 * math.pi),  # a half turn
        ((-6, 0, 0), 2 * math.pi * 3 + 6),  # once round, then 6 m on the far side
        ((0, 0, 0), 0),
    ],
)
def test_shortest_curve_of_radius_3_has_the_length_of_the_closed_form(goal, length) -> None:
    found = shortest_length(0.0, 0.0, 0.0, np.array(goal, dtype=float), 3.0)
    if goal[0] == -6:  # the closed form is one feasible way; a shorter one may exist
        assert found <= length + 1e-9
    else:
        assert found == pytest.approx(length, abs=1e-6)
