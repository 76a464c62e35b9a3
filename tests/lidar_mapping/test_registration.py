import numpy as np
import pytest
from lidar_mapping.clouds import beside_rail, room, street, tunnel

from wzsumo.errors import CloudError
from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.registration import RegistrationStatus, register
from wzsumo.rigid import inverse, moved, rigid, rotation_from_vector, rpy_from_rotation, vector_from_rotation


@pytest.mark.parametrize(
    ("vector", "shift"), [((0, 0, 0.1), (0.5, 0.3, 0.1)), ((0.05, -0.05, 0.3), (1.5, -1.0, 0.3)), ((0, 0, 0), (0.02, 0, 0))]
)
@pytest.mark.parametrize("far", [0.0, 500_000.0])
def test_two_scans_of_a_room_are_registered_to_a_centimetre(
    vector: tuple[float, float, float], shift: tuple[float, float, float], far: float
) -> None:
    truth = rigid(rotation_from_vector(vector), shift)
    offset = rigid(np.eye(3), [far, -far, 0])
    truth = offset @ truth @ inverse(offset)
    result = register(moved(moved(room(2), offset), inverse(truth)), moved(room(1), offset))
    error = inverse(offset) @ result.transform @ inverse(truth) @ offset
    assert result.status == RegistrationStatus.CONVERGED
    assert np.linalg.norm(error[:3, 3]) < 0.01
    assert np.linalg.norm(vector_from_rotation(error[:3, :3])) < 1e-3
    assert result.overlap > 0.9


def test_clouds_of_a_part_of_decimetres_are_registered_to_fractions_of_a_millimetre() -> None:
    truth = rigid(rotation_from_vector([0.05, 0, 0.1]), [0.002, -0.001, 0.0])
    result = register(moved(room(2) / 100, inverse(truth)), room(1) / 100)
    np.testing.assert_allclose(result.transform, truth, atol=2e-4)


@pytest.mark.parametrize("stray", [[2e6, 0.0, 0.0], [300.0, -900.0, 40.0]])
def test_stray_point_far_off_changes_nothing(stray: list[float]) -> None:
    result = register(np.vstack([street(0.4, 2), [stray]]), street(0.0, 1))
    assert result.status == RegistrationStatus.CONVERGED
    np.testing.assert_allclose(result.transform[:2, 3], [0.4, 0.0], atol=0.06)


def test_clouds_in_centimetres_are_registered_in_centimetres() -> None:
    truth = rigid(rotation_from_vector([0.0, 0, 0.1]), [40.0, -20.0, 5.0])
    result = register(moved(100 * room(2), inverse(truth)), 100 * room(1))
    assert result.status == RegistrationStatus.CONVERGED
    np.testing.assert_allclose(result.transform[:3, 3], truth[:3, 3], atol=1.5)


@pytest.mark.parametrize("step", [0.4, 1.0])
def test_street_scans_do_not_lock_on_their_own_ground_rings(step: float) -> None:
    result = register(street(step, 2, yaw=0.01, y=0.1), street(0.0, 1))
    assert result.status == RegistrationStatus.CONVERGED
    np.testing.assert_allclose(result.transform[:2, 3], [step, 0.1], atol=0.06)
    assert rpy_from_rotation(result.transform[:3, :3])[2] == pytest.approx(0.01, abs=0.005)


@pytest.mark.parametrize("yaw", [1.2, -1.7, 2.6])
def test_scan_turned_far_about_the_vertical_is_found(yaw: float) -> None:
    result = register(street(0.4, 2, yaw=yaw, y=0.1), street(0.0, 1))
    np.testing.assert_allclose(result.transform[:2, 3], [0.4, 0.1], atol=0.06)
    assert rpy_from_rotation(result.transform[:3, :3])[2] == pytest.approx(yaw, abs=0.005)


@pytest.mark.parametrize("order", [1, -1])
def test_identical_clouds_in_any_order_are_named(order: int) -> None:
    result = register(room(1)[::order], room(1))
    assert result.status == RegistrationStatus.IDENTICAL_CLOUDS
    np.testing.assert_array_equal(result.transform, np.eye(4))
    assert result.free_directions == 6


def test_bare_plane_leaves_three_directions_free() -> None:
    rng = np.random.default_rng(1)
    floors = [np.column_stack([rng.uniform(-8, 8, (4000, 2)), 0.005 * rng.standard_normal(4000)]) for _ in range(2)]
    result = register(floors[0] + np.array([0, 0, 0.2]), floors[1])
    assert result.status == RegistrationStatus.DEGENERATE
    assert result.free_directions == 3
    assert result.transform[2, 3] == pytest.approx(-0.2, abs=0.01)


@pytest.mark.parametrize("seed", [1, 2])
def test_way_along_a_rail_is_named_as_the_direction_that_two_scans_leave_free(seed: int) -> None:
    truth = rigid(rotation_from_vector([0.0, 0.0, 0.03]), [2.0, 0.1, 0.0])
    result = register(moved(beside_rail(2.0, seed), inverse(truth) @ rigid(np.eye(3), [2.0, 0.0, 0.0])), beside_rail(0.0, 7))
    assert (result.status, result.free_directions) == (RegistrationStatus.DEGENERATE, 1)
    np.testing.assert_allclose(np.abs(result.free_motions[0]), [1, 0, 0, 0, 0, 0], atol=0.05)
    np.testing.assert_allclose(result.transform[1:3, 3], [0.1, 0.0], atol=0.03)  # across it the scans tell
    assert rpy_from_rotation(result.transform[:3, :3])[2] == pytest.approx(0.03, abs=0.005)


def test_way_along_a_tunnel_and_the_turn_about_it_are_free() -> None:
    result = register(tunnel(1) + np.array([1.0, 0.2, 0.1]), tunnel(2), start=np.eye(4))
    assert (result.status, result.free_directions) == (RegistrationStatus.DEGENERATE, 2)
    along, about = np.abs(result.free_motions[:, 0]), np.abs(result.free_motions[:, 3])
    np.testing.assert_allclose(along**2 + about**2, 1.0, atol=0.05)
    np.testing.assert_allclose(result.transform[1:3, 3], [-0.2, -0.1], atol=0.03)


def test_post_beside_a_rail_ends_its_freedom() -> None:
    def scan(x: float, seed: int) -> FloatArray:
        rng = np.random.default_rng(seed)
        face = np.linspace(-np.pi, 0, 12)
        face, z = (each.ravel() for each in np.meshgrid(np.linspace(-np.pi, 0, 12), np.linspace(-1.2, 1.0, 20)))
        post = np.vstack([
            np.column_stack([at - x + 0.1 * np.cos(face), side + 0.1 * np.sin(face), z])
            for at, side in ((4.0, 5.0), (-6.0, 7.0), (15.0, 6.0))
        ])  # fmt: skip
        return np.vstack([beside_rail(x, seed), post + 0.01 * rng.standard_normal(post.shape)])

    result = register(scan(0.8, 3), scan(0.0, 4))
    assert (result.status, result.free_directions) == (RegistrationStatus.CONVERGED, 0)
    np.testing.assert_allclose(result.transform[:2, 3], [0.8, 0.0], atol=0.03)


def test_handful_of_points_is_too_few() -> None:
    result = register(room(1, n=8), room(2))
    assert result.status == RegistrationStatus.TOO_FEW_FEATURES


def test_clouds_of_different_places_overlap_poorly() -> None:
    elsewhere = np.random.default_rng(4).uniform(-1, 1, (4000, 3)) * (90, 90, 3) + (200, 0, 0)
    result = register(np.vstack([room(1, n=800), elsewhere]), room(2, n=3000), start=np.eye(4))
    assert result.status == RegistrationStatus.POOR_OVERLAP
    assert result.overlap < 0.3


@pytest.mark.parametrize(
    ("source", "target", "part"),
    [
        (np.zeros((1, 3)), room(1, n=50), "source: 1 point"),
        (room(1, n=50), np.full((10, 3), np.nan), "target: point 0"),
        (room(1, n=50), np.zeros((10, 3)), "extent"),
    ],
)
def test_clouds_that_cannot_be_registered_are_refused_with_reason(source: FloatArray, target: FloatArray, part: str) -> None:
    with pytest.raises(CloudError, match=part):
        register(source, target)


@pytest.mark.parametrize(("share", "status"), [(0.27, "poor_overlap"), (0.33, "converged")])
def test_registration_needs_30_percent_of_the_source_near_the_target(share: float, status: str) -> None:
    inside, target = room(1, n=1500), room(2, n=3000)
    x, y = np.meshgrid(3.0 * np.arange(40), 3.0 * np.arange(40))
    elsewhere = np.column_stack([200 + x.ravel(), y.ravel(), np.zeros(1600)])
    # The overlap counts thinned points; those elsewhere are too far apart to be thinned.
    half = register(np.vstack([inside, elsewhere]), target, start=np.eye(4)).overlap
    count = 1600 * half / (1 - half)  # of thinned points inside
    result = register(np.vstack([inside, elsewhere[: int(count * (1 - share) / share)]]), target, start=np.eye(4))
    assert result.status == status
    assert result.overlap == pytest.approx(share, abs=0.02)
