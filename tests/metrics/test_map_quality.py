import numpy as np

from wzsumo.frames import BoolArray
from wzsumo.metrics.map_quality import quality_of_cells


def cells(*rows: str) -> BoolArray:
    """Cells that are true at every x of the rows."""
    return np.array([[letter == "x" for letter in row] for row in rows])


EVERYWHERE = np.ones((4, 6), dtype=bool)


def test_precision_recall_and_iou_are_shares_of_free_of_drivable_and_of_either_cells() -> None:
    free = cells("......", ".xxx..", ".xxx..", "......")  # 6 cells
    drivable = cells("......", "..xxx.", "..xxx.", "..xxx.")  # 9 cells, 4 of them free
    quality = quality_of_cells(free, drivable=drivable, counted=EVERYWHERE)
    assert (quality.precision, quality.recall, quality.iou) == (4 / 6, 4 / 9, 4 / 11)
    assert quality.n_fragments == 1


def test_cells_that_do_not_count_change_nothing() -> None:
    free = cells("xxxxxx", ".xxx..", ".xxx..", "......")
    drivable = cells("......", "..xxx.", "..xxx.", "..xxx.")
    counted = cells("......", "xxxxxx", "xxxxxx", "xxxxxx")
    quality = quality_of_cells(free, drivable=drivable, counted=counted)
    assert (quality.precision, quality.recall, quality.iou) == (4 / 6, 4 / 9, 4 / 11)


def test_fragments_are_pieces_that_touch_not_even_at_a_corner() -> None:
    free = cells("x...xx", ".x..x.", "......", "xx...x")
    assert quality_of_cells(free, drivable=EVERYWHERE, counted=EVERYWHERE).n_fragments == 4


def test_map_without_a_free_cell_has_no_precision_and_zone_without_a_drivable_one_no_recall() -> None:
    nothing = np.zeros((4, 6), dtype=bool)
    no_map = quality_of_cells(nothing, drivable=EVERYWHERE, counted=EVERYWHERE)
    assert np.isnan(no_map.precision)
    assert (no_map.recall, no_map.iou, no_map.n_fragments) == (0, 0, 0)
    no_road = quality_of_cells(EVERYWHERE, drivable=nothing, counted=EVERYWHERE)
    assert np.isnan(no_road.recall)
    assert (no_road.precision, no_road.iou) == (0, 0)
    assert np.isnan(quality_of_cells(nothing, drivable=nothing, counted=EVERYWHERE).iou)
