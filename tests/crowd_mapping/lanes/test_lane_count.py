"""How many lanes traces alone show: two witnesses add a lane, one does not, receivers that err by a lane do not."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from crowd_mapping.lanes.fits import always_in, fit_of, seen
from scipy.signal import lfilter

from wzsumo.crowd_mapping.lanes import lane_count
from wzsumo.crowd_mapping.lanes.lane_mapping import map_lanes

LANE_M = 3.6


def crowd(levels_m: list[float], *, error_m: float = 0.2, poor: bool = False, seed: int = 3) -> pd.DataFrame:
    """One vehicle for each level beside the road's first lane, 1,500 m long, with a fix every 25 m, one second apart.

    The error of poor receivers lasts by 2 m, drifts by 2 m within 40 s and is noisy by 0.6 m.
    """
    x = np.arange(0.0, 1500.0, 25.0)
    parts = []
    for i, level in enumerate(levels_m):
        random = np.random.default_rng([seed, i])
        error = error_m * random.standard_normal() + 0.1 * random.standard_normal(len(x))
        if poor:
            drift = lfilter([np.sqrt(1 - np.exp(-2 / 40))], [1, -np.exp(-1 / 40)], random.standard_normal(len(x) + 200))[200:]
            error = 2.0 * random.standard_normal() + 2.0 * drift + 0.6 * random.standard_normal(len(x))
        y = level + error
        parts.append(pd.DataFrame({"vehicle_id": f"v{i:03d}", "time_s": 20.0 * i + x / 25.0, "x_m": x, "y_m": y}))
    return pd.concat(parts, ignore_index=True)


@pytest.mark.parametrize(("users", "lanes"), [(1, 1), (3, 2), (15, 2)])
def test_one_witness_adds_no_lane_and_several_do(users: int, lanes: int) -> None:
    made = map_lanes(crowd([0.0] * 27 + [LANE_M] * users))
    assert made.figures["lanes"] == lanes
    assert made.figures["open_lanes"] == lanes


def test_vehicles_that_keep_their_lane_for_long_do_not_hide_the_lane_beside_them() -> None:
    """Each of 28 that never enters a lane would cost half a nat at the usual rate of lane changes, 14 in all."""
    made = map_lanes(crowd([0.0] * 28 + [LANE_M] * 3, error_m=0.15))
    assert made.figures["lanes"] == 2


def test_receivers_that_err_by_a_lane_do_not_add_lanes() -> None:
    """Thirty good ones in two lanes, ten poor ones."""
    good, poor = crowd([0.0, LANE_M] * 15), crowd([0.0, LANE_M] * 5, poor=True, seed=7)
    poor["vehicle_id"] = "p" + poor["vehicle_id"]
    made = map_lanes(pd.concat([good, poor], ignore_index=True))
    assert made.figures["lanes"] == 2
    assert made.figures["fixes_on_free_share"] >= 0.95


def test_lane_that_all_its_users_leave_within_some_hundred_metres_is_a_lane() -> None:
    """Four of thirty drive in it and leave it between 600 and 700 m, as where it closes."""
    table = crowd([0.0] * 26 + [LANE_M] * 4)
    number = table["vehicle_id"].str[1:].astype(int)
    x = table["x_m"]
    leaves = np.clip((x - 600.0 - 10.0 * (number % 5)) / 80.0, 0, 1)
    made = map_lanes(table.assign(y_m=table["y_m"] - np.where(number >= 26, leaves * LANE_M, 0.0)))
    assert made.figures["lanes"] == 2
    assert made.lanes.closed_intervals(1)


def test_lane_that_poor_receivers_alone_show_is_in_doubt_and_warnings_say_so() -> None:
    """Eight good receivers in two lanes, four poor ones in the first, seven beside the second: in a third lane, or not."""
    good, poor = crowd([0.0, LANE_M] * 4), crowd([0.0] * 4 + [2 * LANE_M] * 7, poor=True, seed=21)
    poor["vehicle_id"] = "p" + poor["vehicle_id"]
    made = map_lanes(pd.concat([good, poor], ignore_index=True))
    assert made.figures["lanes"] == 3
    first, second, third = (lane.p_open_middle for lane in made.lanes.lanes)
    assert min(first.min(), second.min()) > 0.9
    assert 0.3 < third.max() < 0.8
    assert [word for word in made.figures["warnings"] if word.startswith("lane 2 (0 = rightmost) may not be there")]


def test_number_of_lanes_whose_outer_lane_loses_its_users_in_the_full_fit_leaves_the_others_in_play(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Roughly, three lanes are far the likeliest; fitted in full, nobody drives in the third."""
    observations = seen(np.array([0.0, 0.0, 0.0, 3.6, 3.6, 3.6])[:, None] * np.ones(20))
    two = fit_of(always_in([0, 0, 0, 1, 1, 1], n_stations=20))
    rough = replace(fit_of(always_in([0, 1, 2, 0, 1, 2], n_stations=20, n_lanes=3)), log_likelihood=np.full(6, 20.0))
    full = replace(fit_of(always_in([0, 0, 0, 1, 1, 1], n_stations=20, n_lanes=3)), log_likelihood=np.full(6, 20.0))
    monkeypatch.setattr(lane_count, "_rough_fits", lambda *_args, **_how: [rough, two])
    monkeypatch.setattr(lane_count, "in_full", lambda fit, _observations: full if fit is rough else fit)
    found, there = lane_count.fit_lane_count(observations)
    assert found is two
    assert there.tolist() == pytest.approx([1.0, 1.0])
