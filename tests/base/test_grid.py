import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.errors import MapError
from wzsumo.grid import OccupancyGrid, blank_grid, cells_inside


@given(row=st.integers(0, 199), col=st.integers(0, 299), x=st.floats(-1e4, 1e4), y=st.floats(-1e4, 1e4))
def test_cell_comes_back_from_its_centre(row: int, col: int, x: float, y: float) -> None:
    grid = OccupancyGrid(p_occupied=np.zeros((200, 300), dtype=np.float32), resolution=0.127, origin=(x, y))
    back_row, back_col = grid.cell_of(grid.centre_of(row, col))
    assert (back_row[0], back_col[0]) == (row, col)
    assert grid.contains(grid.centre_of(row, col)).all()


def test_row_zero_is_the_lowest_y() -> None:
    grid = OccupancyGrid(p_occupied=np.zeros((4, 6), dtype=np.float32), resolution=0.5, origin=(-10.0, 3.0))
    assert grid.centre_of(0, 0).tolist() == [-9.75, 3.25]
    assert grid.bounds == (-10.0, 3.0, -7.0, 5.0)
    assert grid.contains([[-10.0, 3.0], [-7.01, 4.99], [-10.01, 3.0], [-7.0, 4.0], [-9.0, 5.0]]).tolist() == [
        True, True, False, False, False,
    ]  # fmt: skip


def test_free_means_below_map_servers_threshold_and_unknown_is_not_free() -> None:
    grid = OccupancyGrid(p_occupied=np.array([[0.0, 0.195, 0.197, 0.5, 1.0]]), resolution=1, origin=(0, 0))
    assert grid.free.tolist() == [[True, True, False, False, False]]


@pytest.mark.parametrize(
    ("p", "resolution", "origin", "rule"),
    [
        (np.zeros((0, 3)), 1, (0, 0), r"shape \(0, 3\)"),
        (np.zeros(3), 1, (0, 0), "rows and columns"),
        (np.array([[np.nan]]), 1, (0, 0), "finite"),
        (np.array([[1.01]]), 1, (0, 0), r"in \[0, 1\]"),
        (np.zeros((2, 2)), 0, (0, 0), "resolution=0 m"),
        (np.zeros((2, 2)), 1, (0, np.inf), "origin="),
    ],
)
def test_grid_that_cannot_be_is_refused(
    p: npt.NDArray[np.float32], resolution: int, origin: tuple[float, float], rule: str
) -> None:
    with pytest.raises(MapError, match=rule):
        OccupancyGrid(p_occupied=p, resolution=resolution, origin=origin)


@given(low=st.tuples(st.floats(-500, 500), st.floats(-500, 500)), size=st.tuples(st.floats(0.2, 50), st.floats(0.2, 50)))
def test_blank_grid_exceeds_its_bounds_by_less_than_a_cell(low: tuple[float, float], size: tuple[float, float]) -> None:
    bounds = (*low, low[0] + size[0], low[1] + size[1])
    over = np.array(blank_grid(bounds, resolution=0.2, p_occupied=0.5).bounds) - bounds
    assert (over * [-1, -1, 1, 1] > -1e-6).all()
    assert (np.abs(over) < 0.2 + 1e-6).all()


def test_cells_inside_an_area_match_a_point_in_polygon_test_of_every_centre() -> None:
    grid = blank_grid((-3, -2, 5, 4), resolution=0.25, p_occupied=0)
    area = shapely.Point(1.0, 1.0).buffer(2.0).union(shapely.box(3, -9, 4, 9)).difference(shapely.box(0, 0, 1, 1))
    rows, cols = np.indices(grid.shape)
    every = [[area.contains(shapely.Point(grid.centre_of(r, c))) for c in cols[0]] for r in rows[:, 0]]
    assert (cells_inside(grid, area) == np.array(every)).all()


@given(corners=st.lists(st.tuples(st.floats(-8, 12), st.floats(-8, 12)), min_size=3, max_size=20), hole=st.floats(0.1, 4))
def test_cells_inside_match_shapely_for_any_polygons_with_holes_that_reach_beyond_the_map(
    corners: list[tuple[float, float]], hole: float
) -> None:
    grid = blank_grid((-3, -2, 5, 4), resolution=0.3, p_occupied=0)
    area = shapely.MultiPoint(corners).buffer(1.3).difference(shapely.Point(1.01, 1.02).buffer(hole))
    centres = grid.centre_of(*np.indices(grid.shape))
    assert (cells_inside(grid, area) == shapely.contains_xy(area, centres[..., 0], centres[..., 1])).all()


@pytest.mark.parametrize("area", [shapely.Polygon(), shapely.box(100, 100, 110, 110)])
def test_no_cell_is_inside_an_area_that_is_empty_or_off_the_map(area: shapely.Polygon) -> None:
    assert not cells_inside(blank_grid((0, 0, 5, 4), resolution=0.5, p_occupied=0), area).any()
