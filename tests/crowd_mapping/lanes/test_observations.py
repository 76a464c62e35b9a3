from typing import Any

import numpy as np
import pandas as pd
import pytest
from crowd_mapping.lanes.fits import seen

from wzsumo.crowd_mapping.lanes.observations import Observations, cumulated_course, observe
from wzsumo.crowd_mapping.reference_line import axis_of
from wzsumo.frames import FloatArray


def observed(
    *, length_m: float = 1000.0, interval_s: float = 1.0, speed_mps: float = 25.0, offsets: tuple[float, ...] = (0.0, 3.6),
    noise_m: float = 0.0,
) -> Observations:  # fmt: skip
    """Vehicles at offsets along the x axis."""
    random = np.random.default_rng(1)
    parts = []
    for i, y in enumerate(offsets):
        x = np.arange(0.0, length_m + 1e-6, speed_mps * interval_s)
        places = {"x_m": x, "y_m": y + noise_m * random.standard_normal(len(x))}
        parts.append(pd.DataFrame({"vehicle_id": f"v{i}", "time_s": x / speed_mps} | places))
    return observe(pd.concat(parts, ignore_index=True), axis_of(np.array([[-10.0, 0.0], [length_m + 10.0, 0.0]])))


SAMPLINGS: dict[str, dict[str, Any]] = {
    "1 Hz": {},
    "10 Hz creeping": {"interval_s": 0.1, "speed_mps": 1.5, "length_m": 300.0},
    "100 Hz": {"interval_s": 0.01, "length_m": 300.0},
    "100 m": {"length_m": 100.0, "interval_s": 0.5},
    "20 km": {"length_m": 20_000.0},
}


@pytest.mark.parametrize("how", SAMPLINGS)
def test_offsets_are_those_of_the_traces_at_every_station_however_they_are_sampled(how: str) -> None:
    given = SAMPLINGS[how]
    observations = observed(**given)
    inner = slice(2, -2)
    assert (observations.eta[:, inner] > 0).all()
    assert (observations.eta <= 1).all()
    assert observations.offset[0, inner] == pytest.approx(0.0, abs=1e-6)
    assert observations.offset[1, inner] == pytest.approx(3.6, abs=1e-6)
    assert observations.speed == pytest.approx(given.get("speed_mps", 25.0), rel=0.05)
    assert observations.slowness[:, inner] == pytest.approx(1 / given.get("speed_mps", 25.0), rel=0.05)
    assert 10 <= len(observations.stations) <= 402
    assert observations.stations[0] == pytest.approx(10.0, abs=0.002 * given.get("length_m", 1000.0) + 1e-6)


def test_stations_lie_20_m_apart_and_nearer_on_short_roads_and_farther_apart_on_long_ones() -> None:
    spacing = [observed(length_m=length).spacing for length in (100.0, 1000.0, 20_000.0)]
    assert spacing[0] == pytest.approx(10.0, rel=0.05)
    assert spacing[1] == pytest.approx(20.0)
    assert spacing[2] == pytest.approx(50.0, rel=0.05)


def test_road_of_5_m_has_two_stations_or_more() -> None:
    observations = observed(length_m=5.0, interval_s=0.04)
    assert len(observations.stations) >= 2
    assert np.isfinite(observations.offset).all()


def test_one_fix_in_30_s_counts_whole_at_its_nearest_station_and_says_nothing_elsewhere() -> None:
    observations = observed(length_m=6000.0, interval_s=30.0, speed_mps=24.7)
    for eta, offset in zip(observations.eta, observations.offset, strict=True):
        assert 7 <= (eta > 0).sum() <= 9  # a fix each 741 m
        assert eta[eta > 0] == pytest.approx(1.0)
        assert len(set(offset[eta > 0])) == 1
    steps = np.diff(np.flatnonzero(observations.eta[1] > 0)) * observations.spacing
    assert steps == pytest.approx(741.0, abs=observations.spacing)


def test_statements_of_a_dense_trace_together_weigh_as_one_each_60_m() -> None:
    for length in (300.0, 1200.0, 3000.0):
        observations = observed(length_m=length, interval_s=0.2)
        assert observations.eta.sum(axis=1) == pytest.approx(length / 60, rel=0.15, abs=1)


def test_variance_grows_by_the_white_noise_of_the_receiver() -> None:
    quiet, noisy = (float(observed(noise_m=sd, length_m=3000.0).variance.mean()) for sd in (0.0, 1.0))
    assert quiet == pytest.approx(0.25**2, rel=0.05)
    assert noisy - quiet == pytest.approx(1.0, rel=0.35)


def test_fix_on_another_road_is_left_out() -> None:
    table = pd.DataFrame({"vehicle_id": "v", "time_s": np.arange(41.0), "x_m": 25 * np.arange(41.0), "y_m": 0.0})
    table.loc[20, "y_m"] = 300.0
    observations = observe(table, axis_of(np.array([[-10.0, 0.0], [1010.0, 0.0]])))
    assert observations.offset == pytest.approx(np.zeros_like(observations.offset))


def moving(step: FloatArray) -> Observations:
    base = observed(offsets=(0.0, 3.6, 0.2))
    return Observations(**{**base.__dict__, "offset": base.offset + step})


def test_cumulated_course_follows_what_all_traces_do_and_not_what_one_does() -> None:
    m = len(observed().stations)
    together = np.where((np.arange(m) > 15) & (np.arange(m) < 30), 3.0, 0.0)
    assert cumulated_course(moving(together[None])) == pytest.approx(together, abs=0.05)
    alone = np.vstack([np.zeros((2, m)), together])
    assert cumulated_course(moving(alone)) == pytest.approx(np.zeros(m), abs=0.05)


def test_trace_reaches_all_stations_from_its_first_fix_to_its_last_and_no_others() -> None:
    sparse = observed(interval_s=5.0, offsets=(0.0,))
    assert (sparse.eta[0] > 0).sum() < len(sparse.stations) / 4
    at = sparse.stations - 10.0  # x
    assert (sparse.reached[0] == ((at >= -10.0) & (at <= 1010.0))).all()
    part = seen(np.zeros((2, 8)), eta=np.array([[0, 0, 1, 0, 0, 1, 0, 0], [0, 0, 0, 0, 0, 0, 0, 0]]))
    assert part.reached.astype(int).tolist() == [[0, 0, 1, 1, 1, 1, 0, 0], [0] * 8]


def test_first_course_follows_traces_whose_fixes_lie_many_stations_apart() -> None:
    offset = np.tile(np.r_[np.zeros(10), np.linspace(0.0, 3.0, 11), np.full(9, 3.0), np.linspace(3.0, 0.0, 10)], (3, 1))
    eta = np.zeros_like(offset)
    eta[:, ::5] = eta[:, -1] = 1.0
    course = cumulated_course(seen(np.where(eta > 0, offset, 0.0), eta=eta))
    assert course == pytest.approx(offset[0], abs=0.8)
