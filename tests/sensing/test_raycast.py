import numpy as np
import numpy.typing as npt
import pytest

from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.rigid import rigid, rotation_from_rpy
from wzsumo.sensing.ground import Ground, flat_ground
from wzsumo.sensing.raycast import Hits, cast_rays
from wzsumo.sensing.scene import Scene

ELEVATION = np.deg2rad(np.linspace(-25, 15, 40))
AZIMUTH = -np.pi + 2 * np.pi * np.arange(360) / 360


def scene_with(frusta: npt.ArrayLike = (), boxes: npt.ArrayLike = (), ground: Ground | None = None) -> Scene:
    cones, cuboids = np.reshape(np.array(frusta, float), (-1, 9)), np.reshape(np.array(boxes, float), (-1, 8))
    kinds = ("frustum",) * len(cones) + ("box",) * len(cuboids)
    return Scene(ground=ground or flat_ground(), frusta=cones, boxes=cuboids, kinds=kinds, device_id=np.arange(len(cones)) + 1)


def still(height: float = 1.9, rpy: tuple[float, float, float] = (0, 0, 0)) -> FloatArray:
    return np.tile(rigid(rotation_from_rpy(rpy), [0, 0, height]), (len(AZIMUTH), 1, 1))


def cast(scene: Scene, poses: FloatArray, max_range: float = 120.0) -> Hits:
    return cast_rays(scene, poses=poses, azimuth=AZIMUTH, elevation=ELEVATION, max_range=max_range)


def rays(poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Origins (columns, 1, 3) and directions (columns, layers, 3) in the world."""
    across = np.cos(ELEVATION)
    forward, left = across * np.cos(AZIMUTH)[:, None], across * np.sin(AZIMUTH)[:, None]
    local = np.stack([forward, left, np.broadcast_to(np.sin(ELEVATION), forward.shape)], axis=-1)
    return poses[:, None, :3, 3], np.einsum("jab,jlb->jla", poses[:, :3, :3], local)


def slow_frustum(origin: FloatArray, direction: FloatArray, frustum: FloatArray) -> FloatArray:
    """First t on a frustum, by bisection between sign changes of the inside test on a fine ladder of t."""
    foot, axis, height, r0, r1 = frustum[:3], frustum[3:6], frustum[6], frustum[7], frustum[8]
    reach = height + r0 + r1
    to_middle = foot + axis * height / 2 - origin
    nearest = np.linalg.norm(np.cross(np.broadcast_to(to_middle, direction.shape), direction), axis=-1)
    first = np.full(direction.shape[:-1], np.inf)
    close = nearest < reach
    o, d = np.broadcast_to(origin, direction.shape)[close], direction[close]

    def inside(t: FloatArray) -> BoolArray:
        p = o + t[:, None] * d - foot
        h = p @ axis
        rho = np.linalg.norm(p - h[:, None] * axis, axis=1)
        return np.asarray((h >= 0) & (h <= height) & (rho <= r0 + (r1 - r0) * h / height) & (t > 0))

    middle = np.einsum("ri,ri->r", foot + axis * height / 2 - o, d)
    high = np.full(len(d), np.inf)
    ladder = np.linspace(-reach, reach, 800)
    for t in ladder:
        high = np.where(np.isinf(high) & inside(middle + t), middle + t, high)
    low = high - (ladder[1] - ladder[0])
    for _ in range(40):
        t = (low + high) / 2
        hit = inside(np.where(np.isfinite(t), t, -1.0))
        low, high = np.where(hit, low, t), np.where(hit, t, high)
    first[close] = high
    return first


def slow_box(origin: FloatArray, direction: FloatArray, box: FloatArray) -> FloatArray:
    """First t on a box: the nearest of its six faces' planes whose point lies within the face."""
    turn = np.array([[box[6], -box[7], 0], [box[7], box[6], 0], [0, 0, 1]])
    o, d = (origin - box[:3]) @ turn, direction @ turn
    first = np.full(d.shape[:-1], np.inf)
    for axis in range(3):
        for side in (-1, 1):
            with np.errstate(divide="ignore", invalid="ignore"):
                t = (side * box[3 + axis] - o[..., axis]) / d[..., axis]
                point = o + t[..., None] * d
            others = [i for i in range(3) if i != axis]
            on_face = (np.abs(point[..., others]) <= box[3:6][others] + 1e-12).all(axis=-1) & (t > 0)
            first = np.where(on_face & (t < first), t, first)
    return first


def slow_cast(scene: Scene, poses: FloatArray, max_range: float) -> tuple[FloatArray, IntArray]:
    """All solids against all rays, and the plane."""
    origin, direction = rays(poses)
    normal = np.array([-scene.ground.slope[0], -scene.ground.slope[1], 1.0])
    with np.errstate(divide="ignore"):
        ground = -(origin @ normal - scene.ground.level) / (direction @ normal)
    best, which = np.where(ground > 0, ground, np.inf), np.where(ground > 0, 0, -1)
    for number, solid in enumerate([*scene.frusta, *scene.boxes], start=1):
        slow = slow_frustum if len(solid) == 9 else slow_box
        t = slow(origin, direction, solid)
        best, which = np.where(t < best, t, best), np.where(t < best, number, which)
    far = best > max_range
    return np.where(far, np.inf, best), np.where(far, -1, which)


def random_scene(seed: int) -> Scene:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-25, 25, (30, 2))
    xy += 3 * xy / np.linalg.norm(xy, axis=1, keepdims=True)
    axis = rng.normal([0, 0, 2], 0.5, (15, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    size = np.column_stack([rng.uniform(0.6, 2, 15), rng.uniform(0.1, 0.5, 15), rng.uniform(0.03, 0.6, 15)])
    frusta = np.column_stack([xy[:15], rng.uniform(-0.2, 0.5, 15), axis, size])
    turn = rng.uniform(-np.pi, np.pi, 15)
    half = rng.uniform(0.1, 2.5, (15, 3))
    boxes = np.column_stack([xy[15:], half[:, 2], half, np.cos(turn), np.sin(turn)])
    return scene_with(frusta, boxes, flat_ground(slope=(0.02, -0.03)))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("moving", [False, True])
def test_cast_equals_every_ray_against_every_solid(seed: int, moving: bool) -> None:
    scene, poses = random_scene(seed), still(rpy=(0.02, -0.03, 0.5))
    if moving:
        share = np.linspace(0, 1, len(AZIMUTH))[:, None]
        poses = rigid(rotation_from_rpy(share * (0.02, 0.01, 0.1)), share * (3.0, 0.4, 0.1) + (0.0, 0.0, 1.9))
    hits = cast(scene, poses, max_range=60.0)
    distance, object_id = slow_cast(scene, poses, 60.0)
    same = hits.object_id == object_id
    assert same.mean() > 0.9995  # the twin's ladder may step over a grazing chord of a few millimetres
    assert (object_id > 0).sum() > 500
    np.testing.assert_allclose(hits.distance[same], distance[same], atol=1e-5)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.03, -0.02)])
def test_distance_to_a_plane_is_its_closed_form(slope: tuple[float, float]) -> None:
    poses = still(height=2.5, rpy=(0.01, 0.02, 1.0))
    hits = cast(scene_with(ground=flat_ground(level=0.4, slope=slope)), poses)
    origin, direction = rays(poses)
    normal = np.array([-slope[0], -slope[1], 1.0])
    expected = (0.4 - origin @ normal) / (direction @ normal)
    met = (expected > 0) & (expected < 120)
    np.testing.assert_array_equal(hits.object_id == 0, met)
    np.testing.assert_allclose(hits.distance[met], expected[met], rtol=1e-9)


def test_ring_on_a_drum_is_at_its_radius_and_on_its_lid_at_its_height() -> None:
    scene = scene_with(frusta=[[5, 0, 0, 0, 0, 1, 1.0, 0.3, 0.3]])
    poses = still(height=3.0)
    hits = cast(scene, poses)
    origin, direction = rays(poses)
    points = (origin + np.where(np.isfinite(hits.distance), hits.distance, 0)[..., None] * direction)[hits.object_id == 1]
    radius = np.hypot(points[:, 0] - 5, points[:, 1])
    on_lid = points[:, 2] > 1 - 1e-9
    assert on_lid.any()
    assert (~on_lid).any()
    np.testing.assert_allclose(radius[~on_lid], 0.3, atol=1e-9)
    assert (radius[on_lid] <= 0.3).all()


def test_nearer_of_two_boxes_in_line_is_seen() -> None:
    boxes = [[20, 0, 1, 1, 1, 1, 1, 0], [10, 0, 1, 1, 1, 1, 1, 0]]
    hits = cast(scene_with(boxes=boxes), still(height=1.0))
    ahead = np.argmin(np.abs(AZIMUTH))
    level = np.argmin(np.abs(ELEVATION))
    assert hits.object_id[ahead, level] == 2
    assert hits.distance[ahead, level] == pytest.approx(9.0 / np.cos(ELEVATION[level]))


def test_nothing_beyond_range_is_seen() -> None:
    hits = cast(scene_with(boxes=[[10, 0, 1, 1, 1, 1, 1, 0]]), still(), max_range=3.0)
    assert (hits.object_id == -1).all()
    assert np.isinf(hits.distance).all()


def test_hits_on_relief_lie_on_it_and_no_relief_stands_before_them() -> None:
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(400) * 0.25, np.arange(400) * 0.25)
    relief = 0.1 * np.sin(x / 3) * np.cos(y / 2) + rng.normal(0, 0.003, x.shape)
    ground = Ground(level=1.0, slope=(0.02, 0.01), relief=relief.astype(np.float32), node=0.25, origin=(-50.0, -50.0))
    poses = still(height=3.5)
    hits = cast(scene_with(ground=ground), poses, max_range=40.0)
    _, direction = rays(poses)
    met = hits.object_id == 0
    assert met.sum() > 3000
    direction, distance = direction[met], hits.distance[met]
    height = poses[0, :3, 3] + distance[:, None] * direction
    assert np.abs(height[:, 2] - ground.height(height[:, :2])).max() < 6e-4  # half a millimetre, and rounding
    hidden = 0
    for share in np.linspace(0.2, 0.99, 80):
        before = poses[0, :3, 3] + share * distance[:, None] * direction
        hidden += (before[:, 2] < ground.height(before[:, :2]) - 5e-3).sum()
    assert hidden < 0.001 * 80 * met.sum()  # steps of 0.7 of the gap may skip a grazed crest


@pytest.mark.parametrize("speed_mps", [0.0, 40.0])
def test_cast_close_to_solids_equals_every_ray_against_every_solid(speed_mps: float) -> None:
    wall = [0, 3, 0.4, 60, 0.3, 0.4, 1, 0]  # its bounding sphere encloses the sensor
    cones = [[x, y, 0, 0, 0, 1, 1.2, 0.3, 0.1] for x, y in ((-1.5, -0.9), (0.5, 0.8), (2.0, -0.7), (-2.5, 0.1))]
    share = np.linspace(0, 1, len(AZIMUTH))[:, None]
    poses = rigid(rotation_from_rpy(share * (0, 0, 0.02)), share * (0.1 * speed_mps, 0, 0) + (0, 0, 1.4))
    scene = scene_with(cones, [wall])
    hits, (distance, object_id) = cast(scene, poses), slow_cast(scene, poses, 120.0)
    same = hits.object_id == object_id
    assert same.mean() > 0.9995
    assert {number for number in np.unique(object_id) if number > 0} == {1, 2, 3, 4, 5}
    np.testing.assert_allclose(hits.distance[same], distance[same], atol=1e-5)
