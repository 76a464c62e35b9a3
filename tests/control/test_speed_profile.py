import math

import numpy as np
import pytest
from control.drives import circle_path, curved_road_path, straight_path, work_zone_path
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.control.regulated_pursuit import RegulatedSpec
from wzsumo.control.speed_profile import SpeedProfile
from wzsumo.path import ReferencePath


@pytest.mark.parametrize("radius", [40.0, -120.0])
def test_speed_on_a_circle_is_the_root_of_lateral_limit_times_radius(radius: float) -> None:
    profile = SpeedProfile.of(circle_path(radius), spec=RegulatedSpec())
    assert profile.at(100.0).speed == pytest.approx(math.sqrt(2.0 * abs(radius)), rel=1e-4)


def test_speed_ahead_of_a_bend_falls_with_the_given_deceleration() -> None:
    step = 0.5
    s = np.arange(0, 400 + step, step)
    heading = np.cumsum(np.where(s > 200, step / 50.0, 0.0))
    poses = np.column_stack([np.cumsum(step * np.cos(heading)), np.cumsum(step * np.sin(heading)), heading])
    profile = SpeedProfile.of(ReferencePath(poses=poses), spec=RegulatedSpec())
    bend = 2.0 * 50.0
    for before in (20.0, 50.0, 100.0):
        assert profile.at(200.0 - before).speed == pytest.approx(math.sqrt(bend + 2 * 1.0 * before), rel=0.02)


def test_speed_behind_a_bend_rises_with_the_given_acceleration() -> None:
    step = 0.5
    s = np.arange(0, 400 + step, step)
    heading = np.cumsum(np.where(s < 200, step / 50.0, 0.0))
    poses = np.column_stack([np.cumsum(step * np.cos(heading)), np.cumsum(step * np.sin(heading)), heading])
    profile = SpeedProfile.of(ReferencePath(poses=poses), spec=RegulatedSpec())
    for behind in (20.0, 50.0, 100.0):
        assert profile.at(200.0 + behind).speed == pytest.approx(math.sqrt(2.0 * 50.0 + 2 * 0.75 * behind), rel=0.02)
        assert profile.at(200.0 + behind).acceleration == pytest.approx(0.75, rel=0.02)


def test_stop_at_goal_ends_in_standstill_with_the_given_deceleration() -> None:
    profile = SpeedProfile.of(straight_path(500.0), spec=RegulatedSpec(stop_at_goal=True))
    assert profile.at(500.0).speed == profile.at(510.0).speed == 0.0
    assert profile.at(400.0) == pytest.approx((math.sqrt(2 * 1.0 * 100), -1.0))


@given(radii=st.lists(st.floats(20, 400), min_size=6, max_size=6), slowdown=st.floats(0.5, 4))
def test_bends_are_braked_for_ahead_and_their_speed_is_kept_in_them(radii: list[float], slowdown: float) -> None:
    # Six bends of 20 m; in the middle of each the curvature is its own.
    s = np.arange(0.0, 120.0, 0.5)
    curvature = 1 / np.repeat(radii, 40)
    heading = np.concatenate([[0.0], np.cumsum(curvature[:-1] * 0.5)])
    poses = np.column_stack([np.cumsum(0.5 * np.cos(heading)), np.cumsum(0.5 * np.sin(heading)), heading])
    profile = SpeedProfile.of(ReferencePath(poses=poses), spec=RegulatedSpec(slowdown_mps2=slowdown, speedup_mps2=slowdown))
    for i in range(6):
        # Written out: from the middle of bend i, the beginning of every later bend must be reachable by braking, and the end of
        # every bend before left by speeding up.
        others = [math.sqrt(2.0 * radii[j] + 2 * slowdown * (20.0 * abs(j - i) - 10.0)) for j in range(6) if j != i]
        expected = min([math.sqrt(2.0 * radii[i]), *others])
        assert profile.at(float(s[20 + 40 * i])).speed == pytest.approx(expected, rel=0.05)


def test_heading_that_jitters_from_pose_to_pose_does_not_stop_the_car() -> None:
    s = np.arange(0, 200, 0.1)
    jitter = 0.002 * (-1.0) ** np.arange(len(s))  # between poses 0.1 m apart: curvature 0.04 1/m, 7 m/s
    path = ReferencePath(poses=np.column_stack([s, np.zeros_like(s), jitter]))
    assert SpeedProfile.of(path, spec=RegulatedSpec()).at(100.0).speed > 29.0


@pytest.mark.parametrize("path", [work_zone_path(), curved_road_path()])
def test_tapers_and_bends_of_a_freeway_need_no_slowing_at_the_zones_own_speed(path: ReferencePath) -> None:
    profile = SpeedProfile.of(path, spec=RegulatedSpec())
    assert min(profile.at(station).speed for station in range(0, 900, 5)) > 24.0
