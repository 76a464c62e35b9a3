import numpy as np
import pandas as pd
import pytest

from wzsumo.crowd_mapping.course.common_path import CommonPath
from wzsumo.crowd_mapping.course.path_fit import fit_common_path, straddling_traces
from wzsumo.crowd_mapping.lane_fit import fit_lane_structure, update
from wzsumo.crowd_mapping.lane_model import LaneStructureSpec
from wzsumo.frames import BoolArray, FloatArray

WIDTH, STATIONS = 3.6, np.arange(0.0, 1200.0, 10.0)
COURSE = np.interp(np.arange(120), [0, 50, 61, 120], [0.0, 0.0, -3.0, -3.0])
# Half a lane to the left, the other half much later.
STRADDLING = WIDTH / 2 * np.interp(STATIONS, [200, 260, 700, 760], [0, 1, 1, 2])


def fitted(offsets: FloatArray, *, bias_effect: FloatArray | None = None) -> CommonPath:
    return fit_common_path(offsets, width=WIDTH, weights=np.ones(len(offsets)), bias_effect=bias_effect)


def family(n: int, *, seed: int, bias_sd: float, merging: float = 0.4) -> tuple[FloatArray, BoolArray]:
    """(offsets, whether each merged): traces of one course; some merge by a lane to the right between stations 10 and 40."""
    random = np.random.default_rng(seed)
    rows, merged = [], []
    for _ in range(n):
        merges = random.random() < merging
        t = np.clip((np.arange(120) - random.uniform(10, 34)) / 7, 0, 1)
        lane = -merges * t * t * (3 - 2 * t)
        rows.append(COURSE + WIDTH * lane + bias_sd * random.standard_normal() + 0.15 * random.standard_normal(120))
        merged.append(merges)
    return np.array(rows), np.array(merged)


def keepers(n: int, *, seed: int, error_m: float = 0.0) -> FloatArray:
    """Offsets of traces that keep one of two lanes; every third moves over once."""
    random = np.random.default_rng(seed)
    lanes = random.integers(0, 2, n).astype(float)[:, None] + np.zeros_like(STATIONS)
    t = np.clip((STATIONS - random.uniform(200, 600, (len(lanes[::3]), 1))) / 70, 0, 1)
    lanes[::3] += (1 - 2 * lanes[::3, :1]) * t * t * (3 - 2 * t)
    drift = 0.2 * error_m * np.cumsum(random.standard_normal(lanes.shape), axis=1) * np.sqrt(0.05)
    bias, scatter = error_m * random.standard_normal((n, 1)), 0.05 * random.standard_normal(lanes.shape)
    return np.asarray(WIDTH * lanes + bias + drift + scatter)


def as_traces(offsets: FloatArray) -> pd.DataFrame:
    parts = [
        pd.DataFrame({"vehicle_id": f"v{i:02d}", "time_s": STATIONS / 25, "x_m": STATIONS, "y_m": row})
        for i, row in enumerate(offsets)
    ]
    return pd.concat(parts, ignore_index=True)


def straddling_among(offsets: FloatArray) -> list[int]:
    return [int(row) for row in np.flatnonzero(straddling_traces(fitted(offsets), offsets, width=WIDTH))]


@pytest.mark.parametrize("bias_sd", [0.2, 1.0, 2.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_course_and_changes_are_found_beside_biases_of_any_size(bias_sd: float, seed: int) -> None:
    offsets, merged = family(12, seed=seed, bias_sd=bias_sd)
    path = fitted(offsets)
    assert np.std(path.course - COURSE) < 0.12
    np.testing.assert_array_equal(np.rint(path.lanes[:, -1]), -merged.astype(float))


def test_merges_are_found_beside_biases_of_2_m_that_turn_on_a_bend() -> None:
    offsets, merged = family(40, seed=2, bias_sd=2.0)
    random = np.random.default_rng(3)
    bearing = np.linspace(-1.25, 1.25, 120)
    effect = np.column_stack([-np.sin(bearing), np.cos(bearing) - 1.0])
    offsets += 0.45 * random.standard_normal(offsets.shape) + 2.0 * random.standard_normal((40, 2)) @ effect.T
    offsets[random.random(offsets.shape) < 0.67] = np.nan
    path = fitted(offsets, bias_effect=effect)
    np.testing.assert_array_equal(np.rint(path.lanes[:, -1]), -merged.astype(float))
    assert path.errors.bias_m == pytest.approx(2.0, rel=0.3)
    # Taken for drift, the same biases hide merges.
    assert (np.rint(fitted(offsets).lanes[:, -1]) != -merged.astype(float)).any()


def test_change_of_the_first_guess_is_not_taken_for_the_course() -> None:
    # The trace that is tried first merges, all others keep their lane.
    offsets, _ = family(9, seed=4, bias_sd=0.5, merging=0.0)
    merging, _ = family(1, seed=5, bias_sd=0.5, merging=1.0)
    path = fitted(np.vstack([merging, offsets]))
    np.testing.assert_array_equal(np.rint(path.lanes[:, -1]), [-1.0] + [0.0] * 9)


def test_single_trace_is_its_own_course() -> None:
    offsets, _ = family(1, seed=0, bias_sd=0.0, merging=0.0)
    path = fitted(offsets)
    np.testing.assert_array_equal(path.lanes, 0.0)
    assert np.std(path.course - COURSE) < 0.15


def scattered(noise_m: float, drift_m: float, *, n: int = 40, stations: int = 200) -> FloatArray:
    random = np.random.default_rng(0)
    walk = drift_m * np.cumsum(random.standard_normal((n, stations)), axis=1)
    return random.standard_normal((n, 1)) + walk + noise_m * random.standard_normal((n, stations))


@pytest.mark.parametrize(("noise_m", "drift_m"), [(0.4, 0.08), (0.25, 0.2), (0.8, 0.15)])
def test_noise_and_drift_are_estimated(noise_m: float, drift_m: float) -> None:
    errors = fitted(scattered(noise_m, drift_m)).errors
    assert errors.noise_m == pytest.approx(noise_m, rel=0.15)
    assert errors.drift_m == pytest.approx(drift_m, rel=0.25)


def test_estimated_noise_stays_between_0_12_and_1_m_and_drift_above_15_percent_of_it() -> None:
    still, wild = fitted(scattered(0.02, 0.0)).errors, fitted(scattered(1.6, 0.0)).errors
    assert (still.noise_m, still.drift_m) == pytest.approx((0.12, 0.15 * 0.12))
    assert wild.noise_m == 1.0
    assert wild.drift_m >= 0.15


def test_estimated_drift_stays_below_half_a_metre() -> None:
    assert fitted(scattered(0.3, 0.9, n=12)).errors.drift_m <= 0.5


def test_trace_of_too_few_stations_has_the_errors_that_are_usual() -> None:
    # Three stations have no nine differences at two distances.
    errors = fitted(np.array([[0.0, 0.1, 0.0], [1.0, 1.2, 1.1]])).errors
    assert (errors.drift_m, errors.noise_m) == (0.08, 0.25)


@pytest.mark.parametrize(("n", "is_estimated"), [(8, False), (9, True)])
def test_nine_differences_are_enough_for_an_estimate(n: int, is_estimated: bool) -> None:
    # Three stations: two differences a trace over one station, one over two.
    errors = fitted(np.random.default_rng(1).standard_normal((n, 1)) + np.array([0.0, 0.3, 0.0])).errors
    assert (errors.noise_m != 0.25) == is_estimated


def test_single_wild_stretch_does_not_move_the_course() -> None:
    offsets, _ = family(7, seed=3, bias_sd=0.3, merging=0.0)
    expected = fitted(offsets).course
    offsets[0, 30:40] += 1.5
    np.testing.assert_allclose(fitted(offsets).course, expected, atol=0.15)


@pytest.mark.parametrize("seed", range(4))
def test_vehicle_that_straddles_a_line_for_hundreds_of_metres_is_told_from_those_that_change_lanes(seed: int) -> None:
    assert straddling_among(np.vstack([keepers(9, seed=seed), STRADDLING])) == [9]


@pytest.mark.parametrize("error_m", [0.0, 1.0, 2.0])
def test_no_vehicle_in_a_lane_straddles_lines_whatever_the_positioning_error(error_m: float) -> None:
    assert straddling_among(keepers(30, seed=5, error_m=error_m)) == []


def path_with_departures(departures: FloatArray) -> tuple[CommonPath, FloatArray]:
    """(a straight path in lane 0, offsets): one constant departure to either side a trace, by halves of its way."""
    signs = np.where(np.arange(100) < 50, 1.0, -1.0)
    offsets = departures[:, None] * signs
    path = fitted(np.zeros((len(departures), 100)))
    return path, offsets


@pytest.mark.parametrize(
    ("usual_m", "odd_m", "straddles"), [(0.1, 0.71, False), (0.1, 0.73, True), (0.4, 1.19, False), (0.4, 1.21, True)]
)
def test_trace_straddles_beyond_a_fifth_of_a_lane_and_three_times_the_usual(
    usual_m: float, odd_m: float, straddles: bool
) -> None:
    path, offsets = path_with_departures(np.array([usual_m] * 9 + [odd_m]))
    assert straddling_traces(path, offsets, width=WIDTH).tolist() == [False] * 9 + [straddles]


@pytest.mark.parametrize(("n_odd", "left_out"), [(3, 3), (4, 0)])
def test_where_more_than_a_quarter_seem_to_straddle_none_does(n_odd: int, left_out: int) -> None:
    path, offsets = path_with_departures(np.array([0.1] * (12 - n_odd) + [1.8] * n_odd))
    assert straddling_traces(path, offsets, width=WIDTH).sum() == left_out


def test_lanes_are_what_they_are_without_the_vehicle_that_straddled_them_and_it_is_named() -> None:
    clean = keepers(9, seed=1)
    without = fit_lane_structure(as_traces(clean), spec=LaneStructureSpec())
    model = fit_lane_structure(as_traces(np.vstack([clean, STRADDLING])), spec=LaneStructureSpec())
    assert model.table.dropped["vehicle_id"].tolist() == ["v09"]
    assert "between lanes" in model.table.dropped["reason"].iloc[0]
    assert (model.levels.n_lanes, model.levels.closed) == (without.levels.n_lanes, without.levels.closed)
    assert model.levels.width == pytest.approx(without.levels.width, abs=0.02)


def test_update_leaves_out_a_vehicle_that_straddled_lines_and_keeps_the_others() -> None:
    model = fit_lane_structure(as_traces(keepers(9, seed=2)), spec=LaneStructureSpec())
    after = update(model, as_traces(np.vstack([keepers(1, seed=3), STRADDLING])), keep=1.0)
    assert len(after.weights) == len(after.table.offsets) == len(after.path.lanes) == 10
    assert after.table.dropped["vehicle_id"].tolist() == ["v01"]
