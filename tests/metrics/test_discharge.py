import numpy as np
import pytest

from wzsumo.errors import InputError
from wzsumo.metrics.discharge import bottleneck_discharge

FREE = 25.0


def series(*pieces):
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


def test_minutes_after_the_last_are_left_out() -> None:
    pieces = series((20, 30, 1.0), (8, 20, 0.3), (10, 24, 0.3), (10, 0, 0.3))
    assert bottleneck_discharge(*pieces, free_speed=FREE, last_min=38).queue_discharge_per_h == pytest.approx(1440, rel=0.03)


def test_series_of_different_minutes_are_refused() -> None:
    with pytest.raises(InputError, match="two series of the same minutes"):
        bottleneck_discharge([1, 2, 3], [20.0, 20.0], free_speed=FREE)
