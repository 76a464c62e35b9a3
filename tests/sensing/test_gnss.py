from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError

from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.sensing.gnss import GnssSpec, _gauss_markov, report


def straight_traces(vehicles: int, *, seconds: float = 60.0, step: float = 0.1, speed: float = 20.0) -> pd.DataFrame:
    """Vehicles v0, v1, ... side by side along +x."""
    time = np.arange(0, seconds, step)
    parts = [
        pd.DataFrame({
            "vehicle_id": f"v{i}", "time_s": time, "x_m": speed * time, "y_m": 3.5 * i, "heading_rad": 0.0, "speed_mps": speed,
            "length_m": 4.6, "width_m": 1.9,
        })
        for i in range(vehicles)
    ]  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def errors_of(reported: pd.DataFrame, traces: pd.DataFrame) -> FloatArray:
    """Errors (n, 2) of reported fixes against the true ones of the same vehicle and time."""
    both = reported.merge(traces, on=["vehicle_id", "time_s"], suffixes=("", "_true"))
    assert len(both) == len(reported)
    return np.asarray(both[["x_m", "y_m"]].to_numpy() - both[["x_m_true", "y_m_true"]].to_numpy())


def series(traces: pd.DataFrame, spec: GnssSpec, *, seed: int = 0) -> FloatArray:
    """Errors (vehicles, fixes, 2)."""
    reported = report(traces, spec=spec, seed=seed)
    return errors_of(reported, traces).reshape(traces["vehicle_id"].nunique(), -1, 2)


def test_exact_receiver_at_the_traces_own_interval_reports_the_traces() -> None:
    traces = straight_traces(3)
    reported = report(traces, spec=GnssSpec(error_m=0.0, sampling_interval_s=0.1), seed=4)
    np.testing.assert_array_equal(errors_of(reported, traces), 0.0)
    assert len(reported) >= len(traces) - 3  # a vehicle's first fix may come before its first report
    assert list(reported.columns) == list(traces.columns)


@pytest.mark.parametrize("error_m", [0.5, 2.0])
def test_total_error_is_the_standard_deviation_on_each_axis(error_m: float) -> None:
    errors = series(straight_traces(1500, seconds=2.0, step=1.0), GnssSpec(error_m=error_m))[:, 0]
    # The standard error of a standard deviation from n normals is sd / sqrt(2 n): 4 of them.
    np.testing.assert_allclose(errors.std(axis=0), error_m, rtol=4 / np.sqrt(2 * 1500))
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=4 * error_m / np.sqrt(1500))
    assert abs(np.corrcoef(errors[:, 0], errors[:, 1]).min()) < 4 / np.sqrt(1500)


def test_total_error_is_80_percent_bias_15_percent_correlated_and_5_percent_white_in_variance() -> None:
    shares = np.square(GnssSpec(error_m=2.0).standard_deviations_m) / 2.0**2
    np.testing.assert_allclose(shares, [0.80, 0.15, 0.05])


def test_correlated_error_lasts_for_a_minute_unless_given() -> None:
    assert GnssSpec(error_m=1.0).correlation_time_s == 60.0


def test_part_that_is_left_out_is_zero() -> None:
    assert GnssSpec(white_sd_m=0.5).standard_deviations_m == (0.0, 0.0, 0.5)


def test_error_of_a_trace_has_more_bias_than_scatter() -> None:
    errors = series(straight_traces(400, seconds=30.0, step=1.0), GnssSpec(error_m=1.0))
    between, within = errors.mean(axis=1).var(), errors.var(axis=1).mean()
    assert between > 4 * within


def test_autocovariance_equals_closed_form() -> None:
    spec = GnssSpec(bias_sd_m=0.6, correlated_sd_m=1.0, correlation_time_s=4.0, white_sd_m=0.5, sampling_interval_s=1.0)
    errors = series(straight_traces(1500, seconds=12.0, step=1.0), spec)
    # A product of two errors of variance v has a standard deviation of at most sqrt(2) v; 3000 pairs, 4 standard errors.
    for lag in (0, 1, 2, 5, 8):
        measured = (errors[:, 0] * errors[:, lag]).mean()
        expected = 0.6**2 + 1.0**2 * np.exp(-lag / 4.0) + (0.5**2 if lag == 0 else 0.0)
        assert measured == pytest.approx(expected, abs=4 * 1.61 * np.sqrt(2) / np.sqrt(3000))


def test_correlation_at_uneven_times_follows_the_time_between_fixes() -> None:
    time = np.array([0.0, 0.3, 0.4, 2.9, 3.0, 11.0])
    traces = pd.DataFrame({"vehicle_id": np.repeat(np.arange(1500), 6), "time_s": np.tile(time, 1500), "x_m": 0.0, "y_m": 0.0})
    spec = GnssSpec(correlated_sd_m=1.0, correlation_time_s=2.0, sampling_interval_s=0.1)
    reported = report(traces, spec=spec, seed=0)
    last = reported.groupby("vehicle_id")[["x_m", "y_m"]].tail(3).to_numpy().reshape(1500, 3, 2)
    rows = np.vstack([last[:, :, 0], last[:, :, 1]])
    correlation = np.corrcoef(rows.T)
    # Fixes 0.1 s and 8 s apart: exp(-dt / 2 s); standard error (1 - r^2) / sqrt(3000).
    assert correlation[0, 1] == pytest.approx(np.exp(-0.05), abs=0.01)
    assert correlation[1, 2] == pytest.approx(np.exp(-4.0), abs=0.08)


def test_gauss_markov_kernel_equals_step_by_step_twin() -> None:
    random = np.random.default_rng(0)
    time, normals = np.cumsum(random.exponential(1.0, 50)), random.standard_normal((50, 2))
    twin = [normals[0]]
    for gap, normal in zip(np.diff(time), normals[1:], strict=True):
        twin.append(np.exp(-gap / 3) * twin[-1] + np.sqrt(1 - np.exp(-2 * gap / 3)) * normal)
    np.testing.assert_allclose(_gauss_markov(time, 3.0, normals), twin, atol=1e-12)


def test_errors_of_a_vehicle_do_not_depend_on_the_others() -> None:
    traces, spec = straight_traces(6), GnssSpec(error_m=1.0)
    everyone = report(traces, spec=spec, seed=1)
    some = report(traces[traces["vehicle_id"].isin(["v2", "v5"])], spec=spec, seed=1)
    alone = everyone[everyone["vehicle_id"].isin(["v2", "v5"])].reset_index(drop=True)
    pd.testing.assert_frame_equal(some, alone)


def test_longer_interval_of_one_phase_keeps_the_same_errors() -> None:
    traces = straight_traces(4)
    dense = report(traces, spec=GnssSpec(error_m=1.0, sampling_interval_s=0.1), seed=1)
    sparse = report(traces, spec=GnssSpec(error_m=1.0, sampling_interval_s=3.0), seed=1)
    both = sparse.merge(dense, on=["vehicle_id", "time_s", "x_m", "y_m"])
    assert len(both) == len(sparse)


@pytest.mark.parametrize("interval_s", [0.1, 0.5, 1.0, 3.0])
def test_fixes_come_at_the_interval(interval_s: float) -> None:
    traces = straight_traces(20, seconds=60.0)
    reported = report(traces, spec=GnssSpec(error_m=0.0, sampling_interval_s=interval_s), seed=2)
    gaps = reported.groupby("vehicle_id")["time_s"].diff().dropna()
    np.testing.assert_allclose(gaps, interval_s, atol=0.1 + 1e-9)
    assert gaps.mean() == pytest.approx(interval_s, rel=0.02)
    if interval_s > 1:  # vehicles do not report in step
        assert reported.groupby("vehicle_id")["time_s"].first().nunique() > 5


def test_trace_shorter_than_the_interval_reports_once() -> None:
    traces = straight_traces(10, seconds=0.5)
    reported = report(traces, spec=GnssSpec(error_m=1.0, sampling_interval_s=60.0), seed=0)
    assert (reported.groupby("vehicle_id").size() == 1).all()
    assert reported["vehicle_id"].nunique() == 10


def test_seed_decides_the_errors() -> None:
    traces, spec = straight_traces(2), GnssSpec(error_m=1.0)
    first, again, other = (report(traces, spec=spec, seed=s) for s in (1, 1, 2))
    pd.testing.assert_frame_equal(first, again)
    assert len(first) != len(other) or not np.allclose(first["x_m"], other["x_m"])


@pytest.mark.parametrize("given", [{}, {"error_m": 1.0, "white_sd_m": 0.5}])
def test_total_and_parts_together_or_neither_are_refused(given: Mapping[str, float]) -> None:
    with pytest.raises(ValidationError, match="give either error_m or"):
        GnssSpec.model_validate(given)


def test_table_without_positions_is_named() -> None:
    with pytest.raises(TraceError, match="y_m missing"):
        report(straight_traces(1).drop(columns="y_m"), spec=GnssSpec(error_m=1.0), seed=0)
