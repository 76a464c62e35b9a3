import numpy as np
import pytest

from wzsumo.errors import InputError
from wzsumo.frames import FloatArray
from wzsumo.metrics.discharge import bottleneck_discharge

FREE = 25.0


def series(*pieces: tuple[int, float, float]) -> tuple[FloatArray, FloatArray]:
    """Minutes of (number, count, share of the free speed)."""
    count = np.concatenate([np.full(n, c, dtype=float) for n, c, _ in pieces])
    speed = np.concatenate([np.full(n, FREE * share, dtype=float) for n, _, share in pieces])
    return count, speed


def test_capacity_and_discharge_are_the_flows_on_both_sides_of_the_breakdown() -> None:
    found = bottleneck_discharge(*series((20, 25, 1.0), (15, 30, 0.95), (8, 20, 0.3), (20, 26, 0.3)), free_speed=FREE)
    assert found.peak_flow_per_h == 1800  # 30 a minute for the 15 minutes up to it
    assert found.queue_discharge_per_h == 1560  # 26 a minute, the 8 settling minutes of 20 left out
    assert found.drop == pytest.approx(1 - 1560 / 1800)
    assert (found.breakdown_min, found.n_discharge_min) == (35, 20)


def test_slow_minutes_that_recover_are_no_breakdown() -> None:
    found = bottleneck_discharge(*series((20, 25, 1.0), (6, 20, 0.3), (30, 25, 1.0)), free_speed=FREE)
    assert np.isnan(found.breakdown_min)
    assert np.isnan(found.queue_discharge_per_h)
    assert np.isnan(found.drop)
    assert found.peak_flow_per_h == 1500


def test_flow_past_a_queue_that_barely_slows_is_no_discharge() -> None:
    light, heavy = (20, 30, 0.55), (23, 24, 0.3)
    found = bottleneck_discharge(*series((20, 30, 1.0), light, heavy), free_speed=FREE)
    # 10 minutes' mean is below half where 3 of them are heavy (7 x 0.55 + 3 x 0.3 = 4.75): those after minutes 28 to 32.
    assert found.breakdown_min == 28
    # 8 minutes' mean is where 2 are (6 x 0.55 + 2 x 0.3 = 3.9): from minute 42 on.
    assert found.n_discharge_min == 21
    assert found.queue_discharge_per_h == 1440
    assert np.isnan(bottleneck_discharge(*series((20, 30, 1.0), light), free_speed=FREE).queue_discharge_per_h)


def test_minutes_without_a_vehicle_count_as_free() -> None:
    count, speed = series((40, 0, 1.0))
    assert np.isnan(bottleneck_discharge(count, np.full_like(speed, np.nan), free_speed=FREE).breakdown_min)


def test_queue_that_is_seen_for_too_short_gives_no_discharge() -> None:
    found = bottleneck_discharge(*series((20, 30, 1.0), (17, 20, 0.3)), free_speed=FREE)
    assert found.peak_flow_per_h == 1800
    assert np.isnan(found.queue_discharge_per_h)
    assert found.n_discharge_min == 0


@pytest.mark.parametrize(("share", "breakdown_min"), [(0.59, 20), (0.61, 25)])
def test_breakdown_begins_where_the_speed_falls_below_60_percent_of_the_free_one(share: float, breakdown_min: int) -> None:
    found = bottleneck_discharge(*series((20, 30, 1.0), (5, 20, share), (20, 20, 0.3)), free_speed=FREE)
    assert found.breakdown_min == breakdown_min


@pytest.mark.parametrize(("share", "breaks_down"), [(0.59, True), (0.61, False)])
def test_first_5_minutes_of_a_breakdown_are_below_60_percent_on_average(share: float, breaks_down: bool) -> None:
    # Then 10 minutes of which the mean is below half, that of the last nine and the next one is not.
    found = bottleneck_discharge(
        *series((20, 30, 1.0), (5, 20, share), (1, 20, 0.0), (9, 20, 0.54), (9, 30, 1.0)), free_speed=FREE
    )
    assert np.isfinite(found.breakdown_min) == breaks_down


@pytest.mark.parametrize(("share", "breaks_down"), [(0.49, True), (0.51, False)])
def test_breakdown_needs_10_minutes_below_half_the_free_speed_behind_the_slow_ones(share: float, breaks_down: bool) -> None:
    found = bottleneck_discharge(*series((20, 30, 1.0), (5, 20, 0.55), (10, 20, share), (5, 20, 1.0)), free_speed=FREE)
    assert np.isfinite(found.breakdown_min) == breaks_down


def test_breakdown_begins_with_the_first_slow_minute() -> None:
    # The 5 minutes from the 18th on have a mean share of (2 x 1.0 + 3 x 0.3) / 5 = 0.58: its first slow one is the 20th.
    found = bottleneck_discharge(*series((20, 30, 1.0), (30, 20, 0.3)), free_speed=FREE)
    assert found.breakdown_min == 20


def test_breakdown_at_the_very_end_of_a_series_is_seen() -> None:
    assert bottleneck_discharge(*series((5, 30, 1.0), (15, 20, 0.3)), free_speed=FREE).breakdown_min == 5
    assert bottleneck_discharge(*series((15, 20, 0.3)), free_speed=FREE).breakdown_min == 0
    assert np.isnan(bottleneck_discharge(*series((14, 20, 0.3)), free_speed=FREE).breakdown_min)


@pytest.mark.parametrize(("n_queued", "n_discharge"), [(17, 0), (18, 10), (30, 22)])
def test_discharge_is_counted_from_8_minutes_after_the_breakdown_and_needs_10_minutes(n_queued: int, n_discharge: int) -> None:
    found = bottleneck_discharge(*series((20, 30, 1.0), (n_queued, 20, 0.3)), free_speed=FREE)
    assert found.n_discharge_min == n_discharge
    assert np.isfinite(found.queue_discharge_per_h) == (n_discharge > 0)


@pytest.mark.parametrize(("share", "n_discharge"), [(0.49, 22), (0.51, 10)])
def test_discharge_counts_minutes_after_8_with_a_mean_below_half_the_free_speed(share: float, n_discharge: int) -> None:
    # 18 minutes queued at 0.3: 10 of discharge. Then 12 at a share: with 0.51 the eight-minute mean stays below half up to the
    # minute before which all eight are at 0.51, so 8 more minutes count (the mean of 7 x 0.51 and 0.3 is 0.484).
    found = bottleneck_discharge(*series((20, 30, 1.0), (18, 20, 0.3), (12, 20, share)), free_speed=FREE)
    assert found.n_discharge_min == (n_discharge if share < 0.5 else n_discharge + 8)


def test_capacity_is_a_15_minute_flow_and_needs_15_minutes() -> None:
    peak = series((30, 20, 1.0), (14, 30, 1.0), (30, 20, 1.0))
    assert bottleneck_discharge(*peak, free_speed=FREE).peak_flow_per_h == 4 * (14 * 30 + 20)
    assert bottleneck_discharge(*series((15, 20, 1.0)), free_speed=FREE).peak_flow_per_h == 1200
    assert np.isnan(bottleneck_discharge(*series((14, 20, 1.0)), free_speed=FREE).peak_flow_per_h)


def test_series_of_different_minutes_are_refused() -> None:
    with pytest.raises(InputError, match="two series of the same minutes"):
        bottleneck_discharge([1, 2, 3], [20.0, 20.0], free_speed=FREE)
