"""The figure of a zone: no text covers another or leaves the figure, on a broad and on a narrow screen."""

import json
from itertools import combinations
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.figures.layout_figure import draw_zone, levels_of
from wzsumo.figures.narrow import narrow_png
from wzsumo.files.layout import layout_geojson
from wzsumo.files.result_folder import ResultFolder
from wzsumo.scenario.library import library_file
from wzsumo.scenario.scenario import load_scenario

SPANS = st.lists(st.tuples(st.floats(0, 100), st.floats(0.1, 50)).map(lambda pair: (pair[0], pair[0] + pair[1])), max_size=12)


def test_span_that_touches_another_keeps_its_level_and_one_that_overlaps_it_moves() -> None:
    assert levels_of([(0, 10), (10, 20), (5, 15), (12, 13), (14, 16)]) == [0, 0, 1, 2, 2]


@given(SPANS)
def test_spans_of_one_level_do_not_overlap_and_no_level_is_left_empty(spans: list[tuple[float, float]]) -> None:
    levels = levels_of(spans)
    assert set(levels) == set(range(len(set(levels))))
    for (one, a), (other, b) in combinations(zip(spans, levels, strict=True), 2):
        assert a != b or one[1] <= other[0] or other[1] <= one[0]


@pytest.mark.parametrize("width_in", [9.5025, 3.5])  # of the axes: broad, and in the figure for a screen of 390 px
@pytest.mark.parametrize("name", ["street_interior_lane", "one_lane_signal", "double_closure"])
def test_no_sign_or_name_of_an_area_covers_another_or_is_cut_off(name: str, width_in: float, tmp_path: Path) -> None:
    layout = layout_geojson(load_scenario(library_file(name)).facility().layout)
    figure = draw_zone(ResultFolder(folder=tmp_path, result={}, layout=json.loads(json.dumps(layout))), axes_width_in=width_in)
    if width_in < 9:
        narrow_png(figure)
    figure.canvas.draw()
    texts = [text for axes in figure.axes[:2] for text in axes.texts if " = " in text.get_text()]
    boxes = [text.get_window_extent() for text in texts]
    assert len(boxes) >= 7
    for box in boxes:
        assert box.x0 >= 0
        assert box.x1 <= figure.bbox.width
    for (text, box), (other, beside) in combinations(zip(texts, boxes, strict=True), 2):
        assert not box.overlaps(beside), (text.get_text(), other.get_text())
