import numpy as np
import pandas as pd
import pytest

from wzsumo.crowd_mapping.reference_line import reference_line_from_traces
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray


def trace(vehicle_id: str, xy: FloatArray) -> pd.DataFrame:
    return pd.DataFrame({"vehicle_id": vehicle_id, "time_s": np.arange(float(len(xy))), "x_m": xy[:, 0], "y_m": xy[:, 1]})


def straight(length_m: float, *, y_m: float = 0.0, start_m: float = 0.0, reverse: bool = False) -> FloatArray:
    x = np.arange(start_m, start_m + length_m + 1e-9, 5.0)
    return np.column_stack([x[::-1] if reverse else x, np.full(len(x), y_m)])


def on_circle(radius_m: float, turn_rad: float, *, offset_m: float = 0.0) -> FloatArray:
    """Points every 5 m along a circle about (0, radius), from the origin to the left."""
    angle = np.arange(0.0, turn_rad, 5.0 / radius_m)
    r = radius_m - offset_m
    return np.column_stack([r * np.sin(angle), radius_m - r * np.cos(angle)])


def table(*lines: FloatArray) -> pd.DataFrame:
    return pd.concat([trace(f"v{i:02d}", xy) for i, xy in enumerate(lines)], ignore_index=True)


@pytest.mark.parametrize("length_m", [49.9, 50.1])
def test_traces_shorter_than_50_m_make_no_line(length_m: float) -> None:
    lines = [np.column_stack([np.linspace(0, length_m, 20), np.full(20, y)]) for y in (0.0, 0.5)]
    if length_m < 50:
        with pytest.raises(TraceError, match=r"longest of 2 traces extends over 49\.9 m; .* at least 50 m"):
            reference_line_from_traces(table(*lines))
    else:
        assert reference_line_from_traces(table(*lines)).length == pytest.approx(50.1, abs=2)


def test_line_has_a_point_every_5_m() -> None:
    axis = reference_line_from_traces(table(straight(800.0), straight(800.0, y_m=3.6)))
    assert axis.length == pytest.approx(800, abs=5)
    np.testing.assert_allclose(np.diff(axis.stations), 5.0, atol=0.05)


def test_line_runs_as_most_vehicles_drive_even_where_the_longest_traces_run_the_other_way() -> None:
    against = [straight(900.0, y_m=4.0 + i, reverse=True) for i in range(3)]
    along = [straight(700.0, y_m=0.5 * i, start_m=100.0) for i in range(6)]
    axis = reference_line_from_traces(table(*against, *along))
    assert np.diff(axis.reference_line[:, 0]).min() > 0


def test_line_lies_on_the_carriageway_of_most_vehicles_though_all_longest_traces_are_of_the_other() -> None:
    others = [straight(1000.0, y_m=30.0 + 0.3 * i, reverse=True) for i in range(8)]
    axis = reference_line_from_traces(table(*others, *(straight(900.0, y_m=0.3 * i, start_m=50.0) for i in range(12))))
    assert np.abs(axis.reference_line[:, 1]).max() < 5
    assert np.diff(axis.reference_line[:, 0]).min() > 0


def test_line_follows_a_bend_of_300_m_radius() -> None:
    axis = reference_line_from_traces(table(*(on_circle(300.0, 1.5, offset_m=d) for d in (0.0, 3.6, 3.6, 0.0))))
    inner = axis.reference_line[10:-10]
    # In the middle of two lanes at 0 and 3.6 m.
    np.testing.assert_allclose(300.0 - np.hypot(inner[:, 0], inner[:, 1] - 300.0), 1.8, atol=0.1)


def test_line_keeps_out_of_the_shift_of_a_work_zone() -> None:
    # All vehicles shift by 3 m over 90 m, as a shifting taper at 60 mph has it.
    x = np.arange(0.0, 1500.0, 5.0)
    lines = [np.column_stack([x, d - 3.0 * np.clip((x - 700) / 90, 0, 1)]) for d in (0.0, 0.5, 1.0)]
    axis = reference_line_from_traces(table(*lines))
    _, offsets = axis.to_sd(lines[1])
    # More than half of it stays in the offsets, and the axis nowhere leans as the taper does (1 : 30).
    assert 1.5 < np.ptp(offsets[100:200]) < 2.3
    assert np.abs(np.diff(axis.reference_line[:, 1]) / np.diff(axis.reference_line[:, 0])).max() < 1 / 60


def test_line_of_a_vehicle_that_stands_for_a_while_does_not_fold_back() -> None:
    random = np.random.default_rng(0)
    x = np.concatenate([np.arange(0.0, 200.0, 5.0), np.full(300, 200.0), np.arange(200.0, 400.0, 5.0)])
    axis = reference_line_from_traces(table(np.column_stack([x, np.zeros(len(x))]) + 0.4 * random.standard_normal((len(x), 2))))
    assert np.diff(axis.reference_line[:, 0]).min() > 0
    assert axis.length == pytest.approx(395, abs=5)


def test_line_follows_a_ramp_that_turns_by_more_than_a_half_circle() -> None:
    axis = reference_line_from_traces(table(*(on_circle(100.0, 4.7, offset_m=d) for d in (0.0, 0.5))))
    assert axis.length == pytest.approx(470, rel=0.02)
    inner = axis.reference_line[5:-5]
    np.testing.assert_allclose(np.hypot(inner[:, 0], inner[:, 1] - 100.0), 99.75, atol=3)


def test_line_is_that_which_most_traces_follow_and_not_the_longest() -> None:
    # Two traces leave the road by a ramp and are the longest.
    x = np.arange(0.0, 1500.0, 5.0)
    away = np.column_stack([x, np.where(x > 300, (x - 300) ** 2 / 2000, 0.0)])
    axis = reference_line_from_traces(table(away, away + 0.5, *(straight(1000.0, y_m=0.3 * i) for i in range(6))))
    assert np.abs(axis.reference_line[:, 1]).max() < 3


def test_wild_fix_does_not_draw_the_line() -> None:
    lines = [straight(600.0, y_m=0.5 * i) for i in range(4)]
    lines[2][60, 1] = 40.0
    axis = reference_line_from_traces(table(*lines))
    assert np.abs(axis.reference_line[:, 1] - 0.75).max() < 0.2
