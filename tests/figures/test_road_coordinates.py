import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from builders import bent_road, paper_work_zone
from shapely.geometry import shape

from wzsumo.figures.layout_figure import draw_zone
from wzsumo.figures.road_coordinates import area_in_road_coordinates, cells_in_road_coordinates, points_in_road_coordinates
from wzsumo.files.layout import layout_geojson
from wzsumo.files.result_folder import ResultFolder
from wzsumo.grid import blank_grid, cells_inside
from wzsumo.mutcd.layout import lay_out
from wzsumo.road import Road
from wzsumo.work_zone import WorkZoneLayout

ROAD = bent_road(-984)  # 300 m, to the right


def zone_of(layout: WorkZoneLayout, folder: Path) -> ResultFolder:
    """The zone as a report reads it from its file."""
    return ResultFolder(folder=folder, result={}, layout=json.loads(json.dumps(layout_geojson(layout))))


def test_strip_of_a_bend_unrolls_to_a_rectangle() -> None:
    strip = ROAD.strip(200, 1200, -3.0, 11.0)
    assert area_in_road_coordinates(strip, ROAD).symmetric_difference(shapely.box(200, -3, 1200, 11)).area < 1e-3 * 14 * 1000


def test_straight_edge_across_a_bend_unrolls_to_a_curve() -> None:
    chord = shapely.LineString(ROAD.to_xy([600, 700], [0, 0])).buffer(0.5, cap_style="flat")
    # The sagitta of a 100 m chord on 300 m less 18 ft: c^2 / (8 R).
    assert abs(area_in_road_coordinates(chord, ROAD).bounds[1]) == pytest.approx(100**2 / (8 * 305.5) + 0.5, rel=0.05)


def test_every_pixel_of_an_unrolled_map_is_the_cell_that_its_point_lies_in() -> None:
    area = ROAD.strip(400, 800, 0.0, 7.0)
    grid = blank_grid(area.buffer(3.0).bounds, resolution=0.25, p_occupied=0.0)
    values = cells_inside(grid, area)
    stations, offsets = np.linspace(380, 820, 300), np.linspace(-6, 14, 60)
    image = cells_in_road_coordinates(values, grid, ROAD, stations=stations, offsets=offsets)
    for row, col in np.random.default_rng(1).integers((60, 300), size=(200, 2)):
        x, y = ROAD.to_xy(stations[col], offsets[row])
        inside = grid.contains([[x, y]])[0]
        assert np.ma.getmaskarray(image)[row, col] == (not inside)
        if inside:
            (cell_row,), (cell_col,) = grid.cell_of([[x, y]])
            assert image[row, col] == values[cell_row, cell_col]
    well_inside = (stations[None] > 402) & (stations[None] < 798) & (offsets[:, None] > 0.5) & (offsets[:, None] < 6.5)
    assert image[well_inside].all()


def test_zone_read_from_its_file_has_the_road_devices_and_lanes_of_the_layout(tmp_path: Path) -> None:
    layout = lay_out(paper_work_zone(), ROAD)
    zone = zone_of(layout, tmp_path)
    assert zone.devices[["x_m", "y_m", "s_m"]].to_numpy() == pytest.approx(layout.devices[["x_m", "y_m", "s_m"]].to_numpy())
    signs = zone.signs[zone.signs["s_m"].between(0, ROAD.length)]
    assert len(signs) == 2
    assert points_in_road_coordinates(signs[["x_m", "y_m"]], zone.road) == pytest.approx(
        signs[["s_m", "d_m"]].to_numpy(dtype=float)
    )
    activity = layout.area("activity area")
    lanes_ft = np.array(zone.lanes_at((activity.start + activity.end) / 2)) / 0.3048
    assert lanes_ft == pytest.approx(np.array([[-10, 1], [1, 12]]), abs=1e-3)  # two 11 ft lanes, shifted by 12 ft


@pytest.mark.parametrize(("road", "panels"), [(ROAD, 4), (bent_road(1_000_000), 3)])
def test_drawing_of_a_zone_shows_the_road_as_it_lies_where_it_bends(tmp_path: Path, road: Road, panels: int) -> None:
    figure = draw_zone(zone_of(lay_out(paper_work_zone(), road), tmp_path))
    assert len(figure.axes) == panels
    assert figure.axes[2].get_aspect() == 1.0
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert [text.split("\n")[0] for text in texts] == [
        "ROAD WORK AHEAD", "LEFT LANE CLOSED AHEAD", "LEFT LANE ENDS", "END ROAD WORK",
    ]  # fmt: skip
    assert "merging taper, 219 m = 720 ft" in [text.get_text() for text in figure.axes[1].texts]
    assert [text.get_text() for text in figure.axes[2].texts if text.get_text()] == ["3.35 m\n11.0 ft"] * 2


def test_layout_file_is_valid_geojson_whose_lanes_lie_on_the_pavement() -> None:
    layout = lay_out(paper_work_zone(), ROAD)
    features = layout_geojson(layout)["features"]
    lanes = [shape(feature["geometry"]) for feature in features if feature["properties"]["name"] == "lane"]
    assert len(lanes) == 4  # three, and the closed one once more where it opens again
    whole = ROAD.strip(0, ROAD.length, -ROAD.right_shoulder, ROAD.left_edge).buffer(1e-6)
    assert all(lane.is_valid and whole.covers(lane) for lane in lanes)
