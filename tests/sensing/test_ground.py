import numpy as np
import pytest
from sensing.roadside import SMOOTH, straight_road

from wzsumo.road import Bend, RoadSpec
from wzsumo.sensing.ground import Ground, GroundSpec, ground_of


def test_ground_of_straight_road_rises_along_itself_and_falls_to_the_right() -> None:
    ground = ground_of(straight_road(), SMOOTH, seed=1)
    np.testing.assert_allclose(ground.height([[0, 0], [100, 0], [100, 5]]), [0, 2.0, 2.1], atol=1e-3)


def test_superelevation_of_a_curve_turns_with_the_road() -> None:
    spec = RoadSpec(lane_count=2, left_shoulder_ft=6, right_shoulder_ft=10, alignment=(Bend(length_ft=1500, radius_ft=1500),))
    road = spec.build()
    ground = ground_of(road, SMOOTH, seed=1)
    s = np.linspace(20, 430, 9)
    for d in (0.0, 6.0):
        np.testing.assert_allclose(ground.height(road.to_xy(s, np.full_like(s, d))), 0.02 * (s + d), atol=0.02)


def test_verge_is_rough_and_road_nearly_even_by_their_rms() -> None:
    ground = ground_of(straight_road(), GroundSpec(grade_pct=0, cross_slope_pct=0), seed=3)
    x = np.random.default_rng(0).uniform(10, 200, 4000)
    road, verge = (ground.height(np.column_stack([x, np.full_like(x, y)])) for y in (3.0, 20.0))
    # Bilinear interpolation between independent neighbours keeps at least 2/3 x 2/3 of the variance.
    assert 0.003 * 0.6 < road.std() < 0.003 * 1.1
    assert 0.05 * 0.6 < verge.std() < 0.05 * 1.1


def test_verge_grows_rough_within_a_metre_beside_the_pavement() -> None:
    ground = ground_of(straight_road(), GroundSpec(grade_pct=0, cross_slope_pct=0, road_roughness_m=0), seed=3)
    x = np.arange(10, 200, 0.05)
    # The left edge of the pavement is at y = 9.144 m.
    edge, half, full = (ground.height(np.column_stack([x, np.full_like(x, 9.144 + aside)])).std() for aside in (0, 0.5, 1.2))
    assert edge < 0.25 * full
    assert half == pytest.approx(0.5 * full, rel=0.35)


def test_relief_is_bilinear_between_its_nodes_and_constant_beyond_them() -> None:
    relief = np.array([[0.0, 1.0], [2.0, 5.0]], dtype=np.float32)
    ground = Ground(level=10.0, slope=(0.1, 0.0), relief=relief, node=2.0, origin=(4.0, 6.0))
    np.testing.assert_allclose(ground.height([[4, 6], [6, 8], [5, 7], [9, 11]]), [10.4, 15.6, 12.5, 15.9], atol=1e-6)


def test_default_ground_has_the_slopes_and_roughness_of_its_sources() -> None:
    assert GroundSpec().model_dump() == {
        "grade_pct": 1.0, "cross_slope_pct": 2.0, "road_roughness_m": 0.003, "road_bump_length_m": 0.5,
        "verge_roughness_m": 0.05, "verge_bump_length_m": 0.3, "verge_width_m": 30.0, "node_m": 0.25,
    }  # fmt: skip
