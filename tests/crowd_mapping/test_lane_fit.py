import numpy as np
import pandas as pd
import pytest
from crowd_mapping.lane_values import WIDTH_M, common_path
from crowd_mapping.zone_traces import drive, noisy, zone_layout

from wzsumo.crowd_mapping.course.path_fit import straddling_traces
from wzsumo.crowd_mapping.lane_fit import fit_lane_structure, refit, update
from wzsumo.crowd_mapping.lane_model import LaneStructure, LaneStructureSpec
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.road import Road

SPEC = LaneStructureSpec()


def right_edge(model: LaneStructure, points: FloatArray, axis: Road) -> FloatArray:
    """Offsets (n,) [m] from an axis of the model's right edge beside points (n, 2)."""
    s, _ = model.axis.to_sd(points)
    d = np.interp(s, model.table.stations, model.path.course) + model.levels.right - model.levels.width / 2
    return np.asarray(axis.to_sd(model.axis.to_xy(s, d))[1])


def test_update_equals_the_fit_of_all_traces() -> None:
    zone = drive(zone_layout(), 24, seed=7)
    noisy_traces = noisy(zone, 0.5, seed=1, interval_s=1.0)
    late = noisy_traces["vehicle_id"].isin(["v20", "v21", "v22", "v23"])
    model = fit_lane_structure(noisy_traces[~late], spec=SPEC)
    updated = update(model, noisy_traces[late], keep=1.0)
    whole = fit_lane_structure(noisy_traces, spec=SPEC)
    assert len(updated.weights) == 24
    assert updated.levels.n_lanes == whole.levels.n_lanes
    s = model.table.stations[5:-5]
    ours, theirs = (right_edge(m, m.axis.to_xy(s, np.zeros(len(s))), updated.axis) for m in (updated, whole))
    assert np.median(np.abs(ours - theirs)) < 0.1


def test_traces_whose_weight_falls_below_a_hundredth_leave_the_model() -> None:
    zone = drive(zone_layout(), 10, seed=7)
    first = zone.traces["vehicle_id"].isin([f"v{i}" for i in range(5)])
    model = fit_lane_structure(zone.traces[first], spec=SPEC)
    later = {f"v{i}" for i in range(5, 10)}
    assert set(update(model, zone.traces[~first], keep=0.0).table.vehicle_ids) == later
    assert set(update(model, zone.traces[~first], keep=0.008).table.vehicle_ids) == later
    faded = update(model, zone.traces[~first], keep=0.012)
    np.testing.assert_allclose(faded.weights, [0.012] * 5 + [1.0] * 5)
    with pytest.raises(TraceError, match="old traces"):
        update(model, zone.traces[~first], keep=1.5)


def test_refit_of_a_fresh_model_is_the_same_model() -> None:
    zone = drive(zone_layout(), 8, seed=7)
    model = fit_lane_structure(zone.traces, spec=SPEC)
    again = refit(model)
    assert (again.levels.right, again.levels.width, again.shifts) == (model.levels.right, model.levels.width, model.shifts)
    np.testing.assert_array_equal(again.path.course, model.path.course)


# A quarter is the most: where more traces seem to straddle the lanes, it is the lanes that are not understood.
@pytest.mark.parametrize(("n_straddling", "n_left_out"), [(4, 4), (5, 5), (6, 0), (9, 0)])
def test_traces_that_straddle_the_lanes_are_left_out_unless_more_than_a_quarter_do(n_straddling: int, n_left_out: int) -> None:
    offsets = np.zeros((20, 100))
    offsets[:n_straddling, 50:] = WIDTH_M / 2
    path = common_path(np.zeros((20, 100)), offsets.mean(axis=1))
    straddling = straddling_traces(path, offsets, width=WIDTH_M)
    np.testing.assert_array_equal(np.flatnonzero(straddling), np.arange(n_left_out))


@pytest.mark.parametrize("error_m", [0.0, 2.0])
def test_speed_behind_the_taper_length_is_the_85th_percentile_of_the_vehicles(error_m: float) -> None:
    zone = drive(zone_layout(), 40, seed=2)
    speeds = [
        np.hypot(*(g[["x_m", "y_m"]].iloc[-1] - g[["x_m", "y_m"]].iloc[0])) / np.ptp(g["time_s"])
        for _, g in zone.traces.groupby("vehicle_id")
    ]
    model = fit_lane_structure(noisy(zone, error_m, seed=0, interval_s=0.2), spec=SPEC)
    assert model.speed_mps == pytest.approx(np.quantile(speeds, 0.85), rel=0.05)


def test_posted_speed_goes_before_that_of_the_vehicles() -> None:
    zone = drive(zone_layout(), 4, seed=2)
    posted = fit_lane_structure(zone.traces, spec=LaneStructureSpec(posted_speed_mph=60))
    assert posted.speed_mps == pytest.approx(26.8224)


def test_short_traces_cannot_make_a_road() -> None:
    track = pd.DataFrame({"vehicle_id": "a", "time_s": np.arange(5.0), "x_m": np.arange(5.0), "y_m": 0.0})
    with pytest.raises(TraceError, match="road's line needs one of at least 50 m"):
        fit_lane_structure(track, spec=SPEC)
