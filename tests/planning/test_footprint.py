import numpy as np
import pytest
import shapely
from shapely.geometry.base import BaseGeometry

from wzsumo.path import swept_pieces
from wzsumo.planning.distance_field import FieldArray, distance_field
from wzsumo.planning.footprint import POINT_BODY, inscribed_radius, outline_body, pose_is_free, sweep_margin
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
RESOLUTION = 0.25


def random_map(seed: int) -> tuple[FieldArray, BaseGeometry]:
    p = (np.random.default_rng(seed).random((80, 80)) < 0.004).astype(np.float32)
    row, col = np.nonzero(p)
    cells = shapely.union_all(shapely.box(*(RESOLUTION * np.array([col, row, col + 1, row + 1]))))
    return distance_field(p, max_p_occupied=0.5, resolution=RESOLUTION, limit_m=3.0), cells


@pytest.mark.parametrize("seed", range(3))
def test_outline_is_free_exactly_where_shapely_finds_no_contact(seed: int) -> None:
    field, cells = random_map(seed)
    body, rng = outline_body(CAR), np.random.default_rng(100 + seed)
    inside = shapely.box(0, 0, 20, 20)
    checked = {True: 0, False: 0}
    for _ in range(400):
        pose = rng.uniform([0, 0, -7], [20, 20, 7])
        outline = shapely.Polygon(CAR.outline(pose))
        if abs(outline.distance(cells)) < 1e-9 and outline.intersection(cells).area < 1e-9:
            continue  # on the very edge rounding decides
        free = not outline.intersects(cells) and inside.contains(outline)
        checked[free] += 1
        assert pose_is_free(field, RESOLUTION, body, *pose, 0.0) == free
    assert min(checked.values()) > 30


def test_margin_widens_the_outline_by_its_width_on_both_sides() -> None:
    p = np.zeros((40, 80), dtype=np.float32)
    p[24:] = 1  # blocked from y = 6 m on
    field, body = distance_field(p, max_p_occupied=0.5, resolution=RESOLUTION, limit_m=3.0), outline_body(CAR)
    assert pose_is_free(field, RESOLUTION, body, 5.0, 6 - 0.93 - 0.101, 0.0, 0.1)
    assert not pose_is_free(field, RESOLUTION, body, 5.0, 6 - 0.93 - 0.099, 0.0, 0.1)


def test_point_is_free_in_a_free_cell_and_not_in_a_blocked_one_or_off_the_map() -> None:
    field, cells = random_map(5)
    rng = np.random.default_rng(9)
    for x, y in rng.uniform(-1, 21, (300, 2)):
        free = 0 <= x < 20 and 0 <= y < 20 and not cells.contains(shapely.Point(x, y))
        assert pose_is_free(field, RESOLUTION, POINT_BODY, x, y, 0.3, 0.0) == free


@pytest.mark.parametrize(("x", "y"), [(5.0, 20.01), (20.01, 5.0), (5.0, -0.01), (-0.01, 5.0)])
def test_point_a_centimetre_beyond_the_edge_of_a_free_map_is_not_free(x: float, y: float) -> None:
    field = np.full((80, 80), 9.0, dtype=np.float32)  # 20 m x 20 m in cells of 0.25 m
    assert not pose_is_free(field, 0.25, POINT_BODY, x, y, 0.0, 0.0)


def test_discs_cover_the_outline_and_the_inscribed_disc_lies_inside_it() -> None:
    body, outline = outline_body(CAR), shapely.Polygon(CAR.outline((0, 0, 0)))
    discs = shapely.union_all([shapely.Point(x, 0).buffer(body.disc_radius + 1e-3, quad_segs=64) for x in body.disc_offsets])
    assert discs.contains(outline)
    assert outline.buffer(1e-6).contains(shapely.Point(0, 0).buffer(inscribed_radius(body)))


@pytest.mark.parametrize(("curvature", "step_m"), [(0.02, 1.0), (0.02, 0.48), (0.18, 0.25), (-0.1, 0.5)])
def test_swept_hull_of_two_outlines_stays_within_the_sweep_margin(curvature: float, step_m: float) -> None:
    poses = [(np.sin(curvature * s) / curvature, (1 - np.cos(curvature * s)) / curvature, curvature * s) for s in (0, step_m)]
    margin = sweep_margin(outline_body(CAR), step_m=step_m) * abs(curvature)
    wide = VehicleGeometry(width_m=CAR.width_m + 2 * margin)
    covered = shapely.union_all([shapely.Polygon(wide.outline(pose)) for pose in poses])
    assert shapely.union_all(swept_pieces(poses, CAR)).difference(covered.buffer(1e-9)).area < 1e-4
