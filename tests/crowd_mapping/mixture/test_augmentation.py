import numpy as np
import pandas as pd
import pytest

from wzsumo.crowd_mapping.mixture.augmentation import with_copies


def trace(n: int = 200) -> pd.DataFrame:
    """Fixes of one vehicle on a circle of 500 m about (0, 500)."""
    angle = np.linspace(0, 1, n)
    return pd.DataFrame(
        {
            "vehicle_id": "a",
            "time_s": np.arange(n, dtype=float),
            "x_m": 500 * np.sin(angle),
            "y_m": 500 - 500 * np.cos(angle),
            "speed_mps": 9.0,
        }
    )


def test_copies_of_a_trace_on_a_bend_run_beside_it_at_one_offset_each() -> None:
    table = with_copies(trace(), copies=3, driver_sd_m=0.25, seed=1)
    # On a circle of 500 m about (0, 500) a place's offset is its distance to the middle.
    radius = (
        table.assign(radius_m=np.hypot(table["x_m"], table["y_m"] - 500)).groupby("vehicle_id")["radius_m"].agg(["mean", "std"])
    )
    assert len(radius) == 4
    assert radius["std"].max() < 0.01
    assert radius["mean"].nunique() == 4


def test_offsets_of_copies_have_the_standard_deviation_of_drivers() -> None:
    table = with_copies(trace(20), copies=2000, driver_sd_m=0.25, seed=2)
    offsets = table.assign(offset_m=np.hypot(table["x_m"], table["y_m"] - 500) - 500).groupby("vehicle_id")["offset_m"].mean()
    # The standard error of a standard deviation of n is sd / sqrt(2 n): 1.6 %.
    assert offsets.std() == pytest.approx(0.25, rel=0.05)


def test_trace_of_one_fix_has_no_direction_and_no_copies() -> None:
    table = with_copies(pd.concat([trace(), trace().head(1).assign(vehicle_id="b")]), copies=2, driver_sd_m=0.25, seed=1)
    assert sorted(table["vehicle_id"].unique()) == ["a", "a copy 0", "a copy 1", "b"]


def test_no_copies_leave_the_traces_as_they_are() -> None:
    pd.testing.assert_frame_equal(with_copies(trace(), copies=0, driver_sd_m=0.25, seed=1), trace(), check_dtype=False)
