from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wzsumo.frames import FloatArray
from wzsumo.metrics.space_time import SpaceTime, queue_lengths, space_time_grid

DT = 0.1


def stream(*, headway_s: float, speed: float, until_s: float = 300.0, road_m: float = 1000.0) -> FloatArray:
    """Fixes (time, station, speed) of cars that enter at 0 m one headway after the other and keep their speed."""
    fixes = []
    for start in np.arange(0, until_s, headway_s):
        time = start + np.arange(0, road_m / speed, DT)
        fixes.append(np.column_stack([time, speed * (time - start), np.full(len(time), speed)]))
    return np.concatenate(fixes).T


def test_uniform_stream_has_the_flow_density_and_speed_of_its_headway() -> None:
    grid = space_time_grid(*stream(headway_s=2.0, speed=25.0), dt=DT, cell_s=60, cell_m=500)
    assert grid.flow[2:4] == pytest.approx(np.full((2, 2), 1800))  # 3600 / 2 s
    assert grid.density[2:4] == pytest.approx(np.full((2, 2), 20))  # one car every 50 m
    assert grid.speed[2:4] == pytest.approx(np.full((2, 2), 25))


@settings(max_examples=30)
@given(st.lists(st.tuples(st.floats(0, 95), st.floats(0, 399), st.floats(0, 40)), min_size=1, max_size=40))
def test_cells_hold_what_a_loop_over_the_fixes_counts(fixes: list[tuple[float, float, float]]) -> None:
    t, s, v = (np.array(column) for column in zip(*fixes, strict=True))
    grid = space_time_grid(t, s, v, dt=DT, cell_s=10, cell_m=20)
    spent = np.zeros_like(grid.time_spent)
    distance = np.zeros_like(spent)
    for time, station, speed in fixes:
        cell = int((time + 1e-6) // 10), int(station // 20)
        spent[cell] += DT
        distance[cell] += speed * DT
    np.testing.assert_allclose(grid.time_spent, spent)
    np.testing.assert_allclose(grid.distance, distance)


def test_cell_without_a_vehicle_has_no_speed() -> None:
    grid = space_time_grid([0.0, 35.0], [10.0, 90.0], [20.0, 10.0], dt=DT, cell_s=10, cell_m=20)
    assert np.isnan(grid.speed[1]).all()
    assert grid.flow[1].sum() == 0


def test_table_of_the_grid_has_one_row_a_cell_with_its_start() -> None:
    grid = space_time_grid([0.0, 35.0], [10.0, 90.0], [20.0, 10.0], dt=DT, cell_s=10, cell_m=20)
    table = grid.table()
    assert len(table) == grid.speed.size
    row = table[(table["time_s"] == 30) & (table["station_m"] == 80)].iloc[0]
    assert (row["speed_mps"], row["flow_vph"]) == (10.0, pytest.approx(3600 * 10 * DT / (10 * 20)))


def grid_of_speeds(speeds: Sequence[float | None]) -> SpaceTime:
    """A grid of one time cell and stretches of 100 m at the given speeds, None: no vehicle there."""
    station = np.array([100.0 * k + 50 for k, v in enumerate(speeds) if v is not None])
    v = np.array([v for v in speeds if v is not None], dtype=float)
    return space_time_grid(np.zeros_like(v), station, v, dt=DT, cell_s=10, cell_m=100)


@pytest.mark.parametrize(
    ("speeds", "length"),
    [
        ([25, 25, 25, 25, 25, 25], 0),
        ([25, 25, 5, 5, 5, 25], 300),
        ([25, 5, 25, 5, 5, 25], 400),  # stop and go: 100 m of free driving in it
        ([5, 25, 25, 25, 5, 25], 100),  # 300 m of free driving: two queues
        ([25, 5, None, 5, 5, 25], 400),
        ([5, 5, 25, 25, 25, 25], 500),  # its head 300 m ahead of the bottleneck
        ([25, 25, 25, 25, 25, 5], 0),  # slow beyond the bottleneck at 500 m
        ([25, 5, 25, 25, 5, 25], 400),  # 200 m of free driving: one queue
        ([25, 25, 13.1, 12.9, 25, 25], 200),  # slow below 13 m/s
    ],
)
def test_queue_reaches_from_the_bottleneck_to_its_farthest_slow_stretch(speeds: Sequence[float | None], length: int) -> None:
    assert queue_lengths(grid_of_speeds(speeds), bottleneck=500.0, slow=13.0).tolist() == [length]


@pytest.mark.parametrize(("n_free", "length"), [(5, 600), (6, 0)])
def test_head_of_the_queue_is_at_most_500_m_ahead_of_the_bottleneck(n_free: int, length: int) -> None:
    speeds = [*[25.0] * (8 - n_free), 5.0, *[25.0] * n_free]
    assert queue_lengths(grid_of_speeds(speeds), bottleneck=900.0, slow=13.0).tolist() == [length]


def test_queue_is_told_in_every_time_cell() -> None:
    time, station = np.array([5.0, 5.0, 15.0, 15.0]), np.array([350.0, 450.0, 350.0, 450.0])
    grid = space_time_grid(time, station, [5.0, 5.0, 20.0, 5.0], dt=DT, cell_s=10, cell_m=100)
    assert queue_lengths(grid, bottleneck=500.0, slow=13.0).tolist()[:2] == [200, 100]


def test_fix_at_the_edge_of_a_cell_belongs_to_the_later_one() -> None:
    grid = space_time_grid([0.1 * 3 * 100], [40.0], [20.0], dt=DT, cell_s=30.0, cell_m=20.0)  # 30.000000000000004 s or below
    assert np.argwhere(grid.time_spent > 0).tolist() == [[1, 2]]
    below = space_time_grid([30 - 1e-9], [40.0], [20.0], dt=DT, cell_s=30.0, cell_m=20.0)
    assert np.argwhere(below.time_spent > 0).tolist() == [[1, 2]]


def test_fix_before_the_road_does_not_count() -> None:
    grid = space_time_grid([0.0, 0.0], [-5.0, 5.0], [20.0, 10.0], dt=DT, cell_s=10, cell_m=20)
    assert grid.time_spent.sum() == pytest.approx(DT)
    assert grid.distance.sum() == pytest.approx(10.0 * DT)
