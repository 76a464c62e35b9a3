import numpy as np
import pytest
from lidar_mapping.drive_past_posts import MOUNT, POSTS, scan_of_posts

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.lidar_mapping.features import FeatureSpec, classify_points, deskew, extract_features
from wzsumo.lidar_mapping.scan_lines import EDGE, NEITHER, PLANAR, POST, SMOOTH
from wzsumo.rigid import moved, rigid, rotation_from_rpy
from wzsumo.scan import LidarScan

STEP = 2 * np.pi / 1800  # azimuth step of `line_scan`


def line_scan(range_m: FloatArray) -> LidarScan:
    """A scan of one level ring with the given ranges (columns,) at azimuths from 0 on; nan for no return."""
    column = np.flatnonzero(np.isfinite(range_m)).astype(np.int32)
    azimuth = 2 * np.pi * column / len(range_m)
    points = range_m[column, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(column))])
    none = np.zeros(len(column), dtype=np.int32)
    return LidarScan(
        start_s=0.0, period_s=0.1, points=points, ring=none, column=column, time_s=np.zeros(len(column)), object_id=none
    )


def before_wall(run: dict[int, float], *, wall: float = 20.0, gone: tuple[int, ...] = ()) -> LidarScan:
    """A round wall, and before it things at given ranges in given columns; no return in the columns `gone`."""
    range_m = np.full(1800, wall)
    range_m[list(run)] = list(run.values())
    range_m[list(gone)] = np.nan
    return line_scan(range_m)


def posts_of(scan: LidarScan) -> FloatArray:
    """Places (n, 3) of the posts of a scan whose points all stand."""
    kind, place = classify_points(scan, np.ones(len(scan.points), dtype=bool), FeatureSpec())
    return np.asarray(place[kind == POST])


def test_posts_are_found_on_their_axes_and_ground_gives_planars() -> None:
    pose = rigid(rotation_from_rpy([0, 0, 0.3]), [12.0, 0.5, 0])
    scan = scan_of_posts(pose, start_s=0.0, seed=1, noise=0.0)
    kind, place = classify_points(scan, scan.object_id > 0, FeatureSpec(edges_per_sector=0))
    post = kind == POST
    assert post.sum() > 40
    assert (scan.object_id[post] > 0).all()
    assert (scan.object_id[kind == PLANAR] == 0).mean() > 0.99
    axes = moved(place[post], pose @ MOUNT)[:, :2] - POSTS[scan.object_id[post] - 1]
    away = np.linalg.norm(scan.points[post], axis=1)
    assert np.linalg.norm(axes[away < 15], axis=1).max() < 0.08  # half an azimuth step is 5 cm at 15 m
    np.testing.assert_allclose(axes.mean(axis=0), 0.0, atol=0.02)


@pytest.mark.parametrize(("steps", "count"), [(17, 1), (18, 0)])
def test_narrow_thing_up_to_60_cm_is_a_post(steps: int, count: int) -> None:
    # At 10 m a step is 3.49 cm: 17 steps are 0.593 m, 18 are 0.628 m.
    assert len(posts_of(before_wall(dict.fromkeys(range(900, 900 + steps), 10.0)))) == count


@pytest.mark.parametrize(("steps", "width"), [(1, STEP * 10 / 2), (9, 9 * STEP * 10)])
def test_axis_of_a_post_lies_half_its_width_behind_what_is_seen(steps: int, width: float) -> None:
    (place,) = posts_of(before_wall(dict.fromkeys(range(900, 900 + steps), 10.0)))
    middle = (900 + (steps - 1) / 2) * STEP
    np.testing.assert_allclose(place, (10 + width / 2) * np.array([np.cos(middle), np.sin(middle), 0]), atol=1e-6)


@pytest.mark.parametrize(("range_m", "count"), [(19.1, 0), (19.0, 1)])
def test_post_stands_out_from_the_background_by_more_than_5_percent_of_its_range(range_m: float, count: int) -> None:
    # 1.05 x 19.05 m = 20.0 m.
    assert len(posts_of(before_wall(dict.fromkeys(range(900, 903), range_m)))) == count


@pytest.mark.parametrize(("gap", "count"), [(4, 1), (5, 2)])
def test_returns_up_to_4_azimuth_steps_apart_are_of_one_thing(gap: int, count: int) -> None:
    run = dict.fromkeys([900, 901, 901 + gap, 902 + gap], 10.0)
    assert len(posts_of(before_wall(run, gone=tuple(range(902, 901 + gap))))) == count


@pytest.mark.parametrize("nearer_column", [899, 903])
def test_thing_beside_a_nearer_one_is_no_post(nearer_column: int) -> None:
    run = dict.fromkeys(range(900, 903), 10.0) | {nearer_column: 5.0}
    places = posts_of(before_wall(run))
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), [5.0 + STEP * 5 / 4])


@pytest.mark.parametrize(("range_m", "count"), [(1.9, 0), (2.1, 1)])
def test_returns_nearer_than_2_m_are_of_the_car_itself(range_m: float, count: int) -> None:
    assert len(posts_of(before_wall(dict.fromkeys(range(900, 905), range_m)))) == count


def test_ground_returns_are_no_posts_and_no_edges() -> None:
    scan = before_wall(dict.fromkeys(range(900, 903), 10.0))
    kind, _ = classify_points(scan, np.zeros(len(scan.points), dtype=bool), FeatureSpec(edge_curvature=1e-4))
    assert not np.isin(kind, [POST, EDGE]).any()


def square_room(columns: int) -> tuple[LidarScan, FloatArray]:
    """A scan of a square room of 20 m from a place off its middle, and the curvature of its points by the formula of LOAM."""
    azimuth = 2 * np.pi * np.arange(columns) / columns
    direction = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    with np.errstate(divide="ignore"):
        reach = np.where(direction == 0, np.inf, (10 * np.sign(direction) - (1.0, 2.0)) / direction)
    scan = line_scan(reach.min(axis=1))
    curvature = np.full(columns, np.nan)
    for k in range(5, columns - 5):
        neighbours = scan.points[[*range(k - 5, k), *range(k + 1, k + 6)]]
        away = np.linalg.norm((neighbours - scan.points[k]).sum(axis=0))
        curvature[k] = away / (10 * np.linalg.norm(scan.points[k]))
    return scan, curvature


def test_smooth_points_and_edges_are_told_by_the_curvature_over_5_neighbours_on_either_side() -> None:
    scan, curvature = square_room(720)
    standing = np.ones(720, dtype=bool)
    kind, _ = classify_points(scan, standing, FeatureSpec(edges_per_sector=50))
    np.testing.assert_array_equal(np.isin(kind, [PLANAR, SMOOTH]), curvature <= 0.002)
    np.testing.assert_array_equal(kind == EDGE, curvature >= 0.02)
    assert (kind == EDGE).sum() >= 4
    assert (kind == NEITHER).sum() > 10


def test_each_of_6_sectors_gives_2_edges_and_4_planar_points_at_most() -> None:
    scan, curvature = square_room(720)
    kind, _ = classify_points(scan, np.ones(720, dtype=bool), FeatureSpec(edge_curvature=1e-9, planar_curvature=1e-9))
    assert [(kind[first : first + 120] == EDGE).sum() for first in range(0, 720, 120)] == [2] * 6
    kind, _ = classify_points(scan, np.ones(720, dtype=bool), FeatureSpec())
    assert [(kind[first : first + 120] == PLANAR).sum() for first in range(0, 720, 120)] == [4] * 6
    kind, _ = classify_points(scan, np.ones(720, dtype=bool), FeatureSpec(edge_curvature=1e-9, planar_curvature=1e-9))
    assert all(kind[first + np.nanargmax(curvature[first : first + 120])] == EDGE for first in range(120, 600, 120))


@pytest.mark.parametrize(("gap", "smooth"), [(4, True), (5, False)])
def test_points_beside_a_gap_or_a_jump_in_range_have_no_curvature(gap: int, smooth: bool) -> None:
    scan = before_wall({}, gone=tuple(range(900, 899 + gap)))
    kind, _ = classify_points(scan, np.ones(len(scan.points), dtype=bool), FeatureSpec())
    beside = np.isin(scan.column, [895, 903 + gap])  # five points from the gap: their windows reach over it
    assert beside.sum() == 2
    assert (np.isin(kind[beside], [PLANAR, SMOOTH]) == smooth).all()
    assert np.isin(kind[np.isin(scan.column, [894, 904 + gap])], [PLANAR, SMOOTH]).all()


def test_planar_points_of_a_line_are_at_most_3_a_sector_and_more_than_5_points_apart() -> None:
    scan = scan_of_posts(np.eye(4), start_s=0.0, seed=1)
    spec = FeatureSpec(sectors=4, planars_per_sector=3)
    kind, _ = classify_points(scan, np.zeros(len(scan.points), dtype=bool), spec)
    assert set(kind) <= {NEITHER, PLANAR, SMOOTH}
    for ring in range(10):
        columns = np.sort(scan.column[(kind == PLANAR) & (scan.ring == ring)])
        assert 0 < len(columns) <= 12
        assert (np.diff(columns) > 5).all()


def test_deskewed_points_equal_matrix_products_point_by_point() -> None:
    scan = scan_of_posts(np.eye(4), start_s=0.0, seed=1)
    share = np.linspace(0, 1, 900)[:, None]
    motion = rigid(rotation_from_rpy(share * (0.1, 0.2, 0.3)), share * (1.0, 2.0, 3.0))
    expected = [motion[c, :3, :3] @ p + motion[c, :3, 3] for c, p in zip(scan.column[::50], scan.points[::50], strict=True)]
    np.testing.assert_allclose(deskew(scan, motion)[::50], expected, atol=1e-12)


def test_features_are_told_apart_by_whether_they_stand() -> None:
    scan = scan_of_posts(np.eye(4), start_s=0.0, seed=1)
    standing: BoolArray = scan.object_id > 0
    still = np.tile(np.eye(4), (900, 1, 1))
    features = extract_features(scan, scan.points, standing, FeatureSpec(), motion=still)
    kind, place = classify_points(scan, standing, FeatureSpec())
    np.testing.assert_array_equal(features.edge, scan.points[kind == EDGE])
    np.testing.assert_allclose(features.posts, place[kind == POST], atol=1e-12)
    np.testing.assert_array_equal(features.ground, scan.points[(kind == PLANAR) & ~standing])
    np.testing.assert_array_equal(features.walls, scan.points[(kind == PLANAR) & standing])
    np.testing.assert_array_equal(features.smooth_ground, scan.points[np.isin(kind, [PLANAR, SMOOTH]) & ~standing])
    assert len(features) == len(features.edge) + len(features.posts) + len(features.ground) + len(features.walls)


def test_default_features_are_those_of_loam() -> None:
    assert FeatureSpec().model_dump() == {
        "sectors": 6, "edges_per_sector": 2, "planars_per_sector": 4, "edge_curvature": 0.02, "planar_curvature": 0.002,
        "min_range_m": 2.0,
    }  # fmt: skip
