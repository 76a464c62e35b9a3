from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from wzsumo.simulation.gridlock import Gridlock, may_go_first

# Poses read off a run of the 3-to-1 closure on straight lanes: one stands astride the line, one waits behind it in the lane
# that stays open, and one follows it in its own lane.
OVER_LINE, WAITS, FOLLOWS = (1259.61, 3.96, -0.17), (1252.88, 1.93, 0.0), (1252.63, 4.72, 0.0)


def may_go(*others: tuple[float, float, float], side: int = -1, speeds: Sequence[float] | None = None) -> bool:
    poses = np.array([OVER_LINE, *others])
    all_speeds = np.zeros(len(poses)) if speeds is None else np.array([0.0, *speeds])
    return may_go_first(0, side, poses=poses, lengths=np.full(len(poses), 4.8), speeds=all_speeds)


def test_vehicle_for_which_another_waits_in_the_lane_that_leads_on_goes_first() -> None:
    assert may_go(WAITS, FOLLOWS)


@pytest.mark.parametrize(
    ("others", "speeds"),
    [
        ([], []),  # no vehicle waits: SUMO's drivers find their gap themselves
        ([FOLLOWS], [0.0]),  # one that waits in the lane that ends is no reason
        ([WAITS], [8.0]),  # one that drives would not stop
        ([(1240.0, 1.93, 0.0)], [0.0]),  # too far behind to wait for him
        ([WAITS, (1259.0, 1.9, 0.0)], [0.0, 0.0]),  # one is beside
    ],
    ids=["nobody", "own lane", "moves", "far", "beside"],
)
def test_vehicle_for_which_none_waits_or_that_has_one_beside_it_stays(
    others: list[tuple[float, float, float]], speeds: list[float]
) -> None:
    assert not may_go(*others, speeds=speeds)


def test_sides_are_mirror_images() -> None:
    mirrored = np.array([(x, -y, -heading) for x, y, heading in (OVER_LINE, WAITS)])
    speeds, lengths = np.zeros(2), np.full(2, 4.8)
    assert may_go_first(0, 1, poses=mirrored, lengths=lengths, speeds=speeds)
    assert not may_go_first(0, -1, poses=mirrored, lengths=lengths, speeds=speeds)


def vehicles_of_sumo(*, waited_s: float, speed: float) -> SimpleNamespace:
    """What `Gridlock` asks of SUMO, for a vehicle "over" in the left of two lanes, which ends; `told` lists its commands."""
    state = SimpleNamespace(told=[], waited_s=waited_s, speed=speed)
    return SimpleNamespace(
        state=state,
        vehicle=SimpleNamespace(
            getWaitingTime=lambda name: state.waited_s if name == "over" else 0.0,
            getSpeed=lambda _name: state.speed,
            getLaneIndex=lambda _name: 1,
            getLaneID=lambda _name: "taper_1",
            getBestLanes=lambda _name: [("taper_0", 500.0, 0.0, 0, True, ()), ("taper_1", 20.0, 0.0, -1, False, ())],
            setLaneChangeMode=lambda name, mode: state.told.append((name, "mode", mode)),
            changeLane=lambda name, lane, duration: state.told.append((name, "lane", lane, duration)),
        ),
    )


def resolve(sumo: SimpleNamespace, gridlock: Gridlock) -> list[tuple[object, ...]]:
    gridlock.resolve(("over", "waits"), np.array([OVER_LINE, WAITS]), np.full(2, 4.8), np.array([sumo.state.speed, 0.0]))
    told: list[tuple[object, ...]] = sumo.state.told
    sumo.state.told = []
    return told


def test_vehicle_is_let_go_after_ten_seconds_and_changes_lanes_as_before_once_it_drives() -> None:
    sumo = vehicles_of_sumo(waited_s=9.9, speed=0.0)
    gridlock = Gridlock(sumo)
    assert resolve(sumo, gridlock) == []
    sumo.state.waited_s = 10.1
    assert resolve(sumo, gridlock) == [("over", "mode", 1), ("over", "lane", 0, 5.0)]
    sumo.state.speed, sumo.state.waited_s = 0.9, 0.0
    assert resolve(sumo, gridlock) == []
    sumo.state.speed = 1.1
    assert resolve(sumo, gridlock) == [("over", "mode", 1621)]  # SUMO docs, TraCI lane change mode: the default
    assert resolve(sumo, gridlock) == []


def test_vehicle_that_creeps_is_not_let_go() -> None:
    for speed, told in ((0.09, [("over", "mode", 1), ("over", "lane", 0, 5.0)]), (0.11, [])):
        sumo = vehicles_of_sumo(waited_s=60.0, speed=speed)
        assert resolve(sumo, Gridlock(sumo)) == told


def test_vehicle_in_the_lane_that_leads_on_is_not_let_go() -> None:
    sumo = vehicles_of_sumo(waited_s=60.0, speed=0.0)
    sumo.vehicle.getLaneID = lambda _name: "taper_0"
    assert resolve(sumo, Gridlock(sumo)) == []


def test_vehicle_for_which_none_waits_is_not_let_go() -> None:
    sumo = vehicles_of_sumo(waited_s=60.0, speed=0.0)
    Gridlock(sumo).resolve(("over", "waits"), np.array([OVER_LINE, (1200.0, 1.93, 0.0)]), np.full(2, 4.8), np.zeros(2))
    assert sumo.state.told == []


def test_vehicle_that_has_left_the_road_is_forgotten() -> None:
    sumo = vehicles_of_sumo(waited_s=60.0, speed=0.0)
    gridlock = Gridlock(sumo)
    assert resolve(sumo, gridlock)
    gridlock.resolve(("waits",), np.array([WAITS]), np.full(1, 4.8), np.zeros(1))
    sumo.state.speed, sumo.state.waited_s = 2.0, 0.0
    assert resolve(sumo, gridlock) == []


def at(ahead_m: float, aside_m: float) -> tuple[float, float, float]:
    """Pose of a vehicle so far ahead of and to the left of one at the origin that heads along +x."""
    return ahead_m, aside_m, 0.0


def goes_first(*others: tuple[float, float, float], speeds: Sequence[float]) -> bool:
    """Whether a vehicle 5 m long at the origin may change to the left among others 5 m long."""
    poses = np.array([(0.0, 0.0, 0.0), *others])
    return may_go_first(0, 1, poses=poses, lengths=np.full(len(poses), 5.0), speeds=np.array([0.0, *speeds]))


@pytest.mark.parametrize(
    ("gap_m", "goes"), [(0.9, False), (1.1, True), (5.9, True), (6.1, False)], ids=["beside", "near", "6 m", "beyond 6 m"]
)
def test_vehicle_goes_first_where_another_stands_1_to_6_m_behind_it_in_the_next_lane(gap_m: float, goes: bool) -> None:
    assert goes_first(at(-5 - gap_m, 3.0), speeds=[0.0]) == goes
    assert not goes_first(at(5 + gap_m, 3.0), speeds=[0.0])  # one ahead waits for others


@pytest.mark.parametrize(("aside_m", "goes"), [(0.9, False), (1.1, True), (4.4, True), (4.6, False)])
def test_vehicle_waits_in_the_next_lane_where_its_middle_is_1_to_4_5_m_aside(aside_m: float, goes: bool) -> None:
    assert goes_first(at(-8, aside_m), speeds=[0.0]) == goes
    assert not goes_first(at(-8, -aside_m), speeds=[0.0])


@pytest.mark.parametrize(("speed", "goes"), [(0.09, True), (0.11, False)])
def test_vehicle_that_drives_faster_than_0_1_mps_does_not_wait(speed: float, goes: bool) -> None:
    assert goes_first(at(-8, 3.0), speeds=[speed]) == goes


@pytest.mark.parametrize(
    ("beside", "goes"),
    [
        (at(5.9, 3.0), False),
        (at(6.1, 3.0), True),
        (at(0, 0.1), False),
        (at(0, -0.1), True),
        (at(0, 4.4), False),
        (at(0, 4.6), True),
    ],
    ids=["0.9 m ahead", "1.1 m ahead", "left of it", "right of it", "4.4 m aside", "4.6 m aside"],
)
def test_vehicle_does_not_go_first_where_another_is_beside_it_on_that_side(
    beside: tuple[float, float, float], goes: bool
) -> None:
    assert goes_first(at(-8, 3.0), beside, speeds=[0.0, 8.0]) == goes


def test_lengths_of_both_vehicles_count_for_the_gap_between_them() -> None:
    poses, speeds = np.array([(0.0, 0.0, 0.0), (-12.0, 3.0, 0.0)]), np.zeros(2)
    for lengths, goes in (([5.0, 12.0], True), ([12.0, 5.0], True), ([5.0, 5.0], False), ([12.0, 12.0], False)):
        assert may_go_first(0, 1, poses=poses, lengths=np.array(lengths), speeds=speeds) == goes


@pytest.mark.parametrize("turn", [0.6, 1.9, -2.5])
def test_direction_of_the_road_does_not_matter(turn: float) -> None:
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    waits, far, beside = (-8.0, 3.0), (-12.0, 3.0), (2.0, 3.0)
    for others, goes in (([waits], True), ([far], False), ([waits, beside], False)):
        xy = np.array([(0.0, 0.0), *others]) @ rotation.T + (300.0, -200.0)
        poses = np.column_stack([xy, np.full(len(xy), turn)])
        assert may_go_first(0, 1, poses=poses, lengths=np.full(len(xy), 5.0), speeds=np.zeros(len(xy))) == goes
