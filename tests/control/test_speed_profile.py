import math

import numpy as np
import pytest
from control.drives import circle_path, curved_road_path, straight_path, work_zone_path
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.control.regulated_pursuit import RegulatedSpec
from wzsumo.control.speed_profile import SpeedProfile, clearance_speed_limits
from wzsumo.errors import InputError
from wzsumo.path import ReferencePath


@pytest.mark.parametrize("radius", [40.0, -120.0])
def test_speed_on_a_circle_is_the_root_of_lateral_limit_times_radius(radius: float) -> None:
    profile = SpeedProfile.of(circle_path(radius), spec=RegulatedSpec(), speed_limits=None)
    assert profile.at(100.0).speed == pytest.approx(math.sqrt(2.0 * abs(radius)), rel=1e-4)


def test_speed_ahead_of_a_bend_falls_with_the_given_deceleration() -> None:
    step = 0.5
    s = np.arange(0, 400 + step, step)
    heading = np.cumsum(np.where(s > 200, step / 50.0, 0.0))
    poses = np.column_stack([np.cumsum(step * np.cos(heading)), np.cumsum(step * np.sin(heading)), heading])
    profile = SpeedProfile.of(ReferencePath(poses=poses), spec=RegulatedSpec(), speed_limits=None)
    bend = 2.0 * 50.0
    for before in (20.0, 50.0, 100.0):
        assert profile.at(200.0 - before).speed == pytest.approx(math.sqrt(bend + 2 * 1.5 * before), rel=0.02)


def test_stop_at_goal_ends_in_standstill_with_the_given_deceleration() -> None:
    profile = SpeedProfile.of(straight_path(500.0), spec=RegulatedSpec(stop_at_goal=True), speed_limits=None)
    assert profile.at(500.0).speed == profile.at(510.0).speed == 0.0
    assert profile.at(400.0) == pytest.approx((math.sqrt(2 * 1.5 * 100), -1.5))


@given(limits=st.lists(st.floats(0, 40), min_size=6, max_size=6), slowdown=st.floats(0.5, 4))
def test_limits_are_kept_where_they_are_given_and_braked_for_ahead(limits, slowdown: float) -> None:
    path = ReferencePath(poses=np.column_stack([20.0 * np.arange(6), np.zeros(6), np.zeros(6)]))
    profile = SpeedProfile.of(path, spec=RegulatedSpec(slowdown_mps2=slowdown), speed_limits=limits)
    for i in range(6):
        # Written out: from i, every later limit must be reachable by braking.
        expected = min(math.sqrt(limits[j] ** 2 + 2 * slowdown * 20.0 * (j - i)) for j in range(i, 6))
        assert profile.at(20.0 * i).speed == pytest.approx(expected, abs=1e-6)


def test_heading_that_jitters_from_pose_to_pose_does_not_stop_the_car() -> None:
    s = np.arange(0, 200, 0.1)
    jitter = 0.002 * (-1.0) ** np.arange(len(s))  # between poses 0.1 m apart: curvature 0.04 1/m, 7 m/s
    path = ReferencePath(poses=np.column_stack([s, np.zeros_like(s), jitter]))
    assert SpeedProfile.of(path, spec=RegulatedSpec(), speed_limits=None).at(100.0).speed > 30.0


@pytest.mark.parametrize("path", [work_zone_path(), curved_road_path()])
def test_tapers_and_bends_of_a_freeway_need_no_slowing_at_the_zones_own_speed(path) -> None:
    profile = SpeedProfile.of(path, spec=RegulatedSpec(), speed_limits=None)
    assert min(profile.at(station).speed for station in range(0, 900, 5)) > 24.0


def test_speed_by_clearance_is_in_proportion_between_its_ends() -> None:
    limits = clearance_speed_limits(
        [0.0, 0.2, 0.6, 1.0, 3.0], target_speed_mps=20.0, full_speed_clearance_m=1.0, min_speed_mps=4.0
    )
    assert limits.tolist() == [4.0, 4.0, 12.0, 20.0, 20.0]


@pytest.mark.parametrize("limits", [[10.0], [10.0, -1.0], [10.0, math.nan], [10.0, math.inf]])
def test_speed_limits_that_do_not_fit_the_path_are_refused(limits) -> None:
    with pytest.raises(InputError, match=r"speed_limits of shape .* must be \(2,\)"):
        SpeedProfile.of(straight_path(10.0), spec=RegulatedSpec(), speed_limits=limits)
