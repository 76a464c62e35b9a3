"""Figures for narrow screens: as wide as they, with all of their words and bars inside."""

import io

import numpy as np
from PIL import Image

from wzsumo.figures.narrow import narrow_png
from wzsumo.figures.zone_axes import legend_above, new_figure


def test_narrow_figure_has_its_axes_and_its_legend_within_its_edges() -> None:
    figure, (upper, lower) = new_figure(2, row_height=1.2)
    for n in range(6):
        upper.plot([400, 1500], [n, n + 1], label=f"a line of the name {n}")
    lower.plot([0, 1], [0, 1])
    legend_above(figure, upper)
    heights = [axes.get_position().height * figure.get_size_inches()[1] for axes in (upper, lower)]
    image = Image.open(io.BytesIO(narrow_png(figure)))
    assert image.width < 600
    assert figure.get_size_inches()[0] < 4.5
    for axes, height in zip((upper, lower), heights, strict=True):
        place = axes.get_position()
        assert 0.1 < place.x0 < place.x1 < 1
        assert np.isclose(place.height * figure.get_size_inches()[1], height)
    (legend,) = figure.legends
    bounds = legend.get_window_extent().transformed(figure.transFigure.inverted())
    assert bounds.x0 >= 0
    assert bounds.x1 <= 1
    assert bounds.y0 > upper.get_position().y1
    assert [text.get_text() for text in legend.get_texts()] == [f"a line of the name {n}" for n in range(6)]
