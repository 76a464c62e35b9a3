import numpy as np
import pytest
from scipy.linalg import sqrtm

from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.alignment import align
from wzsumo.lidar_mapping.post_map import PostMap, PostMatcher, sighting_covariance
from wzsumo.rigid import inverse, moved, rigid, rotation_from_rpy, rpy_from_rotation

STEP = np.deg2rad(0.2)
ROW = np.column_stack([np.arange(-60.0, 260.0, 2.0), np.full(160, -8.0), np.full(160, 0.5)])


def sighted(posts: FloatArray, sensor: FloatArray, *, depth_error: float) -> FloatArray:
    """Posts (n, 3) as seen from a sensor: farther along the ray by an error that is most where the row is seen endways."""
    away = posts[:, :2] - sensor[:2]
    reach = np.hypot(*away.T)[:, None]
    endways = (away[:, :1] / reach) ** 2
    return np.column_stack([posts[:, :2] + depth_error * endways * away / reach, posts[:, 2]])


def driven_past(posts: FloatArray, *, depth_error: float, every: float = 2.0, metres: float = 40.0) -> PostMap:
    held = PostMap(apart=0.6)
    for x in np.arange(0.0, metres, every):
        sensor = np.array([x, 0.0, 1.9])
        held.insert(sighted(posts, sensor, depth_error=depth_error), sensor=sensor, step=STEP)
    return held


def test_post_is_where_its_bearings_meet_although_its_depths_are_off() -> None:
    post = np.array([[25.0, -8.0, 0.5]])
    held = driven_past(post, depth_error=0.05, every=0.5, metres=15.0)
    np.testing.assert_allclose(held.places, post[:, :2], atol=0.006)


def test_places_equal_weighted_least_squares_over_all_sightings() -> None:
    rng = np.random.default_rng(1)
    posts, held, rows = np.array([[20.0, -8.0, 0.5], [31.0, 6.0, 0.5]]), PostMap(apart=0.6), []
    for x in np.arange(0.0, 30.0, 3.0):
        sensor = np.array([x, 0.0, 1.9])
        seen = np.repeat(posts, [1, 3], axis=0) + 0.02 * rng.standard_normal((4, 3))  # three layers of the second one
        held.insert(seen, sensor=sensor, step=STEP)
        for post, point in zip([0, 1, 1, 1], seen, strict=True):
            ray = (point - sensor)[:2] / np.hypot(*(point - sensor)[:2])
            sideways = np.hypot(0.01, STEP * np.hypot(*(point - sensor)[:2]) / np.sqrt(12))
            weight = 1.0 if post == 0 else 1 / 3
            for direction, deviation in ((ray, 3.0), (np.array([-ray[1], ray[0]]), sideways)):
                rows.append((post, np.sqrt(weight) / deviation * direction, point[:2]))
    for post in (0, 1):
        a = np.array([direction for number, direction, _ in rows if number == post])
        b = np.array([direction @ place for number, direction, place in rows if number == post])
        # The weight of a sighting is taken where it lies: a step later, by some mm.
        np.testing.assert_allclose(held.places[post], np.linalg.lstsq(a, b, rcond=None)[0], atol=1e-6)
        np.testing.assert_allclose(held.information[post], a.T @ a, rtol=1e-9)


def test_patch_weighs_a_post_by_the_covariances_of_sighting_and_map() -> None:
    post = np.array([[25.0, -8.0, 0.5]])
    held = driven_past(post, depth_error=0.0)
    pose = rigid(rotation_from_rpy([0, 0, 0.3]), [5.0, 1.0, 0.0])
    inside = inverse(pose)
    matcher = PostMatcher(features=moved(post, inside) + 0.01, sensor=np.array([1.4, 0.0, 1.9]), step=STEP, target=held)
    patches = matcher.patches(pose, 0.6)
    point, sensor = moved(matcher.features, pose), moved(matcher.sensor[None], pose)[0]
    both = sighting_covariance(point, sensor=sensor, step=STEP, depth_sd=0.05)[0] + np.linalg.inv(held.information[0])
    np.testing.assert_allclose(patches.projector[0, :2, :2], 0.01 * np.linalg.inv(sqrtm(both)), atol=1e-9)
    assert not patches.projector[0, 2].any()  # a post says nothing of the height
    assert patches.dimension.tolist() == [2]


@pytest.mark.parametrize("scans", [2, 3])
def test_nothing_is_matched_to_a_post_before_it_was_seen_in_three_scans(scans: int) -> None:
    post = np.array([[25.0, -8.0, 0.5]])
    held = driven_past(post, depth_error=0.0, metres=2.0 * scans)
    assert held.nearest(post, within=0.5).tolist() == [0 if scans == 3 else -1]
    assert held.nearest(post + 0.6, within=0.5).tolist() == [-1]


def test_row_of_posts_whose_depth_is_off_does_not_turn_the_car() -> None:
    held, pose, trust = PostMap(apart=0.6), np.eye(4), np.diag(1 / np.square([0.02, 0.01, 0.01, 1e-4, 1e-4, 5e-4]))
    for x in np.arange(0.0, 120.0, 1.0):
        truth = rigid(np.eye(3), [x, 0.0, 0.0])
        sensor = np.array([0.0, 0.0, 1.9])
        near = ROW[np.abs(ROW[:, 0] - x) < 40]
        features = sighted(near - truth[:3, 3], sensor, depth_error=0.04)
        if x > 0:
            pose = pose @ rigid(np.eye(3), [1.0, 0.0, 0.0])
        if x > 3:
            matcher = PostMatcher(features=features, sensor=sensor, step=STEP, target=held)
            pose = align((matcher,), pose, prior_information=trust, radii=(0.6,)).pose
        held.insert(moved(features, pose), sensor=moved(sensor[None], pose)[0], step=STEP)
    # With standard deviations of 1 cm along the rays, here and in the map, it turns by 0.075 degrees.
    assert abs(np.rad2deg(rpy_from_rotation(pose[:3, :3])[2])) < 0.03
    assert abs(pose[1, 3]) < 0.03


@pytest.mark.parametrize(("apart", "count"), [(0.59, 1), (0.61, 2)])
def test_sighting_within_the_maps_distance_is_of_the_same_post(apart: float, count: int) -> None:
    held, sensor = PostMap(apart=0.6), np.array([0.0, 0.0, 1.9])
    held.insert(np.array([[10.0, 3.0, 0.5]]), sensor=sensor, step=STEP)
    held.insert(np.array([[10.0, 3.0 + apart, 0.5]]), sensor=sensor, step=STEP)
    assert len(held.places) == count


def test_sighting_is_sure_across_its_ray_and_unsure_along_it() -> None:
    covariance = sighting_covariance(np.array([[30.0, 0.0, 1.0]]), sensor=np.zeros(3), step=0.002, depth_sd=0.5)
    # Across: 1 cm, and a uniform distribution over an azimuth step of 6 cm.
    np.testing.assert_allclose(covariance[0], np.diag([0.5**2, 0.01**2 + 0.06**2 / 12]), atol=1e-12)
