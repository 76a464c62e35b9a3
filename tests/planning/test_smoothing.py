import numpy as np
import pytest
from planning.terrains import BODY, LANE_CHANGE, terrain

from wzsumo.frames import FloatArray
from wzsumo.path import ReferencePath
from wzsumo.planning import smoothing
from wzsumo.planning.lattice import poses_along
from wzsumo.planning.path_check import cost_along
from wzsumo.planning.smoothing import smoothed_poses


def test_smoothed_poses_keep_both_end_poses_and_the_limits_of_curvature() -> None:
    poses = poses_along(np.array([15.0, 15.0, 0.1]), LANE_CHANGE, max_step_m=0.48)
    found = smoothed_poses(
        poses, terrain=terrain(), body=BODY, preferred_clearance_m=1.0, max_curvature=0.02, max_curvature_jump=0.002
    )
    np.testing.assert_allclose(found[[0, -1]], poses[[0, -1]], atol=1e-12)
    curvature = ReferencePath(poses=found).curvature
    assert np.abs(curvature).max() <= 0.02
    assert np.abs(np.diff(curvature)).max() <= 0.002
    assert np.abs(np.diff(ReferencePath(poses=poses).curvature)).max() > 0.008


def test_place_where_clearance_would_take_too_sharp_a_bend_costs_none_elsewhere() -> None:
    p = np.zeros((160, 800))
    p[:74, 120:320] = 1  # up to y = 18.5 m, for 50 m: 0.57 m beside a body at y = 20 m
    p[:76, 500:504] = 1  # up to y = 19.0 m, for 1 m: 0.07 m
    poses = poses_along(np.array([10.0, 20.0, 0.0]), np.array([(180.0, 0.0)]), max_step_m=0.48)
    found = smoothed_poses(
        poses, terrain=terrain(p), body=BODY, preferred_clearance_m=1.0, max_curvature=0.001, max_curvature_jump=0.002
    )
    beside = (found[:, 0] > 40) & (found[:, 0] < 70)
    assert found[beside, 1].min() - BODY.half_width - 18.5 > 0.65
    assert np.abs(ReferencePath(poses=found).curvature).max() <= 0.001


@pytest.mark.parametrize(("n", "smoothed"), [(8, False), (9, True)])
def test_path_of_fewer_than_9_poses_is_not_smoothed(n: int, smoothed: bool) -> None:
    poses = poses_along(np.array([15.0, 15.0, 0.1]), np.array([(0.24 * (n - 1), 0.1), (0.24 * (n - 1), -0.1)]), max_step_m=0.48)
    assert len(poses) == n
    found = smoothed_poses(
        poses, terrain=terrain(), body=BODY, preferred_clearance_m=1.0, max_curvature=0.2, max_curvature_jump=0.002
    )
    assert np.array_equal(found, poses) != smoothed


def test_poses_that_no_smoothing_can_better_come_back_as_they_are() -> None:
    p = np.ones((160, 400))
    p[76:84] = 0  # a slot of 2 m: 7 cm on either side
    poses = poses_along(np.array([10.0, 20.0, 0.0]), np.array([(75.0, 0.0)]), max_step_m=0.48)
    found = smoothed_poses(
        poses, terrain=terrain(p), body=BODY, preferred_clearance_m=1.0, max_curvature=0.02, max_curvature_jump=0.002
    )
    np.testing.assert_allclose(found, poses, atol=0.03)


def test_smoothing_takes_no_short_cut_through_what_costs_more_than_a_fifth() -> None:
    # A bulge of 2 m round doubtful ground on the straight line: every strong smoothing would lead over that ground.
    p = np.zeros((160, 800))
    p[76:84, 380:420] = 0.19  # 10 m long, costs 1 + 10 x 0.19 = 2.9 a metre
    arcs = np.array([(20.0, 0.0), (17.0, 0.012), (34.0, -0.012), (17.0, 0.012), (20.0, 0.0)])
    poses = poses_along(np.array([46.0, 17.0, 0.0]), arcs, max_step_m=0.48)
    searched = cost_along(poses, terrain(p))
    found = smoothed_poses(
        poses, terrain=terrain(p), body=BODY, preferred_clearance_m=1.0, max_curvature=0.02, max_curvature_jump=0.002
    )
    assert cost_along(found, terrain(p)) <= 1.05 * searched


def detour(ratio: float, *, jump: float = 0.001, strong: bool = True, fails: bool = False) -> smoothing._Candidate:
    """A candidate from (10, 5) by way of a peak to (50, 5), so much longer than the straight line."""
    x = np.linspace(10.0, 50.0, 81)
    height = 20 * np.sqrt(ratio**2 - 1)
    y = 5 + height * (1 - np.abs(x - 30) / 20)
    failing = np.full(81, fails)
    return smoothing._Candidate(strong, np.column_stack([x, y, np.zeros(81)]), jump, failing)


@pytest.mark.parametrize(
    ("candidates", "chosen"),
    [
        ([detour(1.04), detour(1.0)], 0),  # costs little more: the first such is taken
        ([detour(1.06), detour(1.03), detour(1.0)], 1),  # costs more: a later one may be better
        ([detour(1.19), detour(1.15), detour(1.17)], 1),  # the cheapest where all cost more
        ([detour(1.21)], None),  # costs too much
        ([detour(1.0, fails=True), detour(1.1)], 1),
        ([detour(1.0, jump=0.004), detour(1.1, jump=0.003)], 1),  # the least jump where none keeps the limit of 0.002
        ([detour(1.1, jump=0.0001), detour(1.06, jump=0.0019)], 1),  # jumps within the limit do not count
        ([detour(1.1), detour(1.0, strong=False)], 0),  # no weak one where a strong one keeps the limits
        ([detour(1.1, jump=0.003), detour(1.0, strong=False)], 1),
        ([detour(1.3), detour(1.1, strong=False), detour(1.06, strong=False)], 1),
        ([], None),
    ],
)
def test_smoothing_is_chosen_by_its_failures_its_jumps_and_its_cost(
    monkeypatch: pytest.MonkeyPatch, candidates: list[smoothing._Candidate], chosen: int | None
) -> None:
    monkeypatch.setattr(smoothing, "_candidates", lambda *_: iter(candidates))
    searched = detour(1.0).poses.copy()
    found = smoothed_poses(
        searched, terrain=terrain(), body=BODY, preferred_clearance_m=1.0, max_curvature=0.02, max_curvature_jump=0.002
    )
    assert found is (searched if chosen is None else candidates[chosen].poses)


def test_strong_smoothings_are_tried_8_times_with_less_clearance_where_they_fail_then_weak_ones_then_eased_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    poses = poses_along(np.array([10.0, 20.0, 0.0]), np.array([(30.0, 0.0), (0.5, 0.05), (30.0, 0.0)]), max_step_m=0.5)
    asked: list[tuple[float, FloatArray]] = []
    eased: list[float] = []

    def unchanged(points: FloatArray, *, wavelength_m: float, clearances_m: FloatArray, **_: object) -> FloatArray:
        asked.append((wavelength_m, clearances_m))
        return points

    def not_eased(given: FloatArray, *, wavelength_m: float, **_: object) -> FloatArray:
        eased.append(wavelength_m)
        return given[:, :2]

    monkeypatch.setattr(smoothing, "smooth", unchanged)
    monkeypatch.setattr(smoothing, "eased_points", not_eased)
    smoothed_poses(poses, terrain=terrain(), body=BODY, preferred_clearance_m=2.0, max_curvature=0.01, max_curvature_jump=0.002)
    assert [wavelength for wavelength, _ in asked] == [90.0] * 8 + [60.0] * 8 + [40.0] * 8 + [60.0, 40.0, 25.0, 15.0, 8.0, 4.0]
    assert eased == [25.0, 18.0, 13.0]
    bend = 30.0  # the line fails in the bend 30 m from its start
    along = np.hypot(*(poses[:, :2] - poses[0, :2]).T)
    for number in range(8):
        clearances = asked[number][1]
        assert clearances[np.abs(along - bend) < 20] == pytest.approx(1.4 * 0.8**number)  # 70 % of 2 m, a fifth less each time
        assert clearances[np.abs(along - bend) > 25] == pytest.approx(1.4)  # a quarter of the wavelength of 90 m is 22.5 m
    assert [clearances.max() for _, clearances in asked[24:]] == pytest.approx([0.7, 0.7, 0.7, 0.4, 0.2, 0.02])
