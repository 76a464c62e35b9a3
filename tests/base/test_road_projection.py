import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.road import Bend, RoadSpec
from wzsumo.road_projection import _nearest_point, mitred_line


@given(n=st.integers(2, 90), seed=st.integers(0, 2**32 - 1), far=st.floats(0, 1e4))
def test_nearest_point_is_that_of_all_distances_wherever_the_search_starts(n: int, seed: int, far: float) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(0.1, 30, (n, 2)), axis=0)
    line = mitred_line(points, np.zeros_like(points))
    x, y = points[rng.integers(n)] + rng.normal(scale=far, size=2)
    found = _nearest_point(x, y, line, int(rng.integers(n)))
    distances = np.hypot(points[:, 0] - x, points[:, 1] - y)
    assert distances[found] == pytest.approx(distances.min(), rel=1e-12)


def test_points_in_any_order_come_back_to_the_stations_they_were_laid_out_at() -> None:
    road = RoadSpec(
        lane_count=3,
        left_shoulder_ft=10,
        right_shoulder_ft=10,
        alignment=(Bend(length_ft=900), Bend(length_ft=2400, radius_ft=-800), Bend(length_ft=1500, radius_ft=900)),
    ).build()
    rng = np.random.default_rng(3)
    s, d = rng.uniform(-50, road.length + 50, 4000), rng.uniform(-road.right_shoulder, road.left_edge, 4000)
    back_s, back_d = road.to_sd(road.to_xy(s, d))
    np.testing.assert_allclose(back_s, s, atol=1e-8)
    np.testing.assert_allclose(back_d, d, atol=1e-8)
