import numpy as np
import pandas as pd
import pytest

from wzsumo.crowd_mapping.course.path_fit import fit_common_path, straddling_traces
from wzsumo.crowd_mapping.lane_fit import fit_lane_structure, update
from wzsumo.crowd_mapping.lane_model import LaneStructureSpec

WIDTH, STATIONS = 3.6, np.arange(0.0, 1200.0, 10.0)
HALF = WIDTH / 2 * np.interp(STATIONS, [200, 260, 700, 760], [0, 1, 1, 2])  # half a lane to the left, the other half later


def keepers(n, *, seed, error_m=0.0):
    """Offsets of traces that keep one of two lanes; every third moves over once."""
    random = np.random.default_rng(seed)
    lanes = random.integers(0, 2, n)[:, None] + np.zeros_like(STATIONS)
    t = np.clip((STATIONS - random.uniform(200, 600, (len(lanes[::3]), 1))) / 70, 0, 1)
    lanes[::3] += (1 - 2 * lanes[::3, :1]) * t * t * (3 - 2 * t)
    drift = 0.2 * error_m * np.cumsum(random.standard_normal(lanes.shape), axis=1) * np.sqrt(0.05)
    bias, scatter = error_m * random.standard_normal((n, 1)), 0.05 * random.standard_normal(lanes.shape)
    return WIDTH * lanes + bias + drift + scatter


def as_traces(offsets):
    parts = [
        pd.DataFrame({"vehicle_id": f"v{i:02d}", "time_s": STATIONS / 25, "x_m": STATIONS, "y_m": row})
        for i, row in enumerate(offsets)
    ]
    return pd.concat(parts, ignore_index=True)


def odd_among(offsets):
    path = fit_common_path(offsets, width=WIDTH, weights=np.ones(len(offsets)))
    return np.flatnonzero(straddling_traces(path, offsets, width=WIDTH)).tolist()


@pytest.mark.parametrize("seed", range(4))
def test_vehicle_that_is_half_over_a_line_for_hundreds_of_metres_is_told_from_those_who_change_lanes(seed) -> None:
    assert odd_among(np.vstack([keepers(9, seed=seed), HALF])) == [9]


@pytest.mark.parametrize("error_m", [0.0, 1.0, 2.0])
def test_nobody_is_odd_among_vehicles_in_lanes_whatever_the_positioning_error(error_m: float) -> None:
    assert odd_among(keepers(30, seed=5, error_m=error_m)) == []


def test_lanes_are_what_they_are_without_the_vehicle_that_drove_in_none_and_it_is_named() -> None:
    clean = keepers(9, seed=1)
    without = fit_lane_structure(as_traces(clean), spec=LaneStructureSpec())
    model = fit_lane_structure(as_traces(np.vstack([clean, HALF])), spec=LaneStructureSpec())
    assert model.table.dropped["vehicle_id"].tolist() == ["v09"]
    assert "between lanes" in model.table.dropped["reason"].iloc[0]
    assert (model.levels.n_lanes, model.levels.closed) == (without.levels.n_lanes, without.levels.closed)
    assert model.levels.width == pytest.approx(without.levels.width, abs=0.02)


def test_update_leaves_out_a_vehicle_that_drove_in_no_lane_and_keeps_the_others() -> None:
    model = fit_lane_structure(as_traces(keepers(9, seed=2)), spec=LaneStructureSpec())
    further = np.vstack([keepers(1, seed=3), HALF])
    after = update(model, as_traces(further), keep=1.0)
    assert len(after.weights) == len(after.table.offsets) == len(after.path.lanes) == 10
    assert after.table.dropped["vehicle_id"].tolist() == ["v01"]
