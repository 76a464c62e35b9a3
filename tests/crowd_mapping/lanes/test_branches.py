from typing import Any

import numpy as np
import pytest
from crowd_mapping.lanes.fits import always_in, fit_of, seen

from wzsumo.crowd_mapping.lanes.branches import find_branches
from wzsumo.frames import FloatArray
from wzsumo.lane_map import MappedBranch

M = 40


def branches_of(offsets: FloatArray, *, sigma: float = 0.3, slow: bool = False) -> tuple[MappedBranch, ...]:
    """Branches of vehicles beside two lanes, whose lines are at -1.8 m and 5.4 m; those in the right lane are at 0 m."""
    offset = np.vstack([offsets, np.zeros((8, M))])
    n = len(offset)
    beside = (offset < -1.8) | (offset > 5.4)
    in_lane = always_in([0] * n, n_stations=M) * ~beside[:, :, None]
    return find_branches(
        fit_of(in_lane, burst=beside.astype(float), sigma=sigma), seen(offset), slow=np.full((n, M), slow), removed_shift=0.0,
        width=3.2,
    )  # fmt: skip


def exit_of(n: int, *, at: float = -6.0, first: int = 10, last: int = 30) -> FloatArray:
    """Vehicles that drive beside the lanes between two stations, some decimetres from each other."""
    offset = np.zeros((n, M))
    offset[:, first:last] = at + 0.2 * np.arange(n)[:, None]
    return offset


@pytest.mark.parametrize("at", [-6.0, 9.0])
def test_strip_beside_the_lanes_that_four_drove_is_one_branch_along_their_middle(at: float) -> None:
    (branch,) = branches_of(exit_of(4, at=at))
    assert branch.n_traces == 4
    assert branch.line[[0, -1], 0] == pytest.approx([200, 580])
    assert branch.line[:, 1] == pytest.approx(at + 0.3, abs=0.01)
    assert branch.width == pytest.approx(3.2)
    assert branch.p_open > 0.804


def test_one_vehicle_beside_the_lanes_makes_no_branch() -> None:
    assert branches_of(exit_of(1)) == ()


def test_two_vehicles_on_an_exit_make_a_branch() -> None:
    assert len(branches_of(exit_of(2))) == 1


@pytest.mark.parametrize("how", [{"sigma": 3.0}, {"slow": True}])
def test_poor_receivers_and_creeping_vehicles_make_no_branch(how: dict[str, Any]) -> None:
    assert branches_of(exit_of(4), **how) == ()


def test_strip_that_receivers_in_error_may_explain_is_no_branch_where_a_ramp_joins_it() -> None:
    """Of 60 receivers of 1.1 m, two or three seem to be beside the lanes for long; ten drive the ramp ahead of that."""
    ramp = exit_of(10, at=-6.0, first=2, last=12)
    (branch,) = branches_of(np.vstack([ramp, exit_of(2, at=-5.0, first=12, last=38), np.zeros((48, M))]), sigma=1.1)
    assert branch.line[-1, 0] <= 240
    assert branches_of(np.vstack([exit_of(2, at=-5.0, first=12, last=38), np.zeros((58, M))]), sigma=1.1) == ()


def test_vehicles_beside_the_lanes_for_20_m_make_no_branch() -> None:
    assert branches_of(exit_of(4, first=10, last=12)) == ()


def test_exits_on_both_sides_are_two_branches() -> None:
    found = branches_of(np.vstack([exit_of(3, at=-6.0), exit_of(3, at=9.0)]))
    assert sorted(round(float(branch.line[:, 1].mean())) for branch in found) == [-6, 9]


def test_branch_follows_an_exit_that_leads_away() -> None:
    offset = np.zeros((4, M))
    offset[:, 10:30] = -4.0 - 0.8 * np.arange(20) + 0.1 * np.arange(4)[:, None]
    (branch,) = branches_of(offset)
    assert branch.line[-1, 1] - branch.line[0, 1] == pytest.approx(-0.8 * 19, abs=0.1)
