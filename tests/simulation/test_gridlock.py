from types import SimpleNamespace

import numpy as np
import pytest

from wzsumo.simulation.gridlock import Gridlock, may_go_first

# Read off a run of the 3-to-1 closure on straight lanes: who stands half over the line, who waits behind him in the lane that
# stays open, and who follows him in his own.
OVER_LINE, WAITS, FOLLOWS = (1259.61, 3.96, -0.17), (1252.88, 1.93, 0.0), (1252.63, 4.72, 0.0)


def may_go(*others, side=-1, speeds=None):
    poses = np.array([OVER_LINE, *others])
    speeds = np.zeros(len(poses)) if speeds is None else np.array([0.0, *speeds])
    return may_go_first(0, side, poses=poses, lengths=np.full(len(poses), 4.8), speeds=speeds)


def test_who_is_waited_for_in_the_lane_that_leads_on_goes_first() -> None:
    assert may_go(WAITS, FOLLOWS)


@pytest.mark.parametrize(
    ("others", "speeds"),
    [
        ([], []),  # nobody waits: SUMO's drivers find their gap themselves
        ([FOLLOWS], [0.0]),  # who waits in the lane that ends is no reason
        ([WAITS], [8.0]),  # he comes on and would not stop
        ([(1240.0, 1.93, 0.0)], [0.0]),  # too far behind to wait for him
        ([WAITS, (1259.0, 1.9, 0.0)], [0.0, 0.0]),  # somebody is beside
    ],
    ids=["nobody", "own lane", "moves", "far", "beside"],
)
def test_who_is_not_waited_for_or_has_no_room_stays(others, speeds) -> None:
    assert not may_go(*others, speeds=speeds)


def test_sides_are_mirror_images() -> None:
    mirrored = np.array([(x, -y, -heading) for x, y, heading in (OVER_LINE, WAITS)])
    speeds, lengths = np.zeros(2), np.full(2, 4.8)
    assert may_go_first(0, 1, poses=mirrored, lengths=lengths, speeds=speeds)
    assert not may_go_first(0, -1, poses=mirrored, lengths=lengths, speeds=speeds)


def vehicles_of_sumo(**state):
    """What `Gridlock` asks of SUMO, for a vehicle "over" in the left of two lanes, which ends; `told` is what it was told."""
    state = SimpleNamespace(told=[], **state)
    return SimpleNamespace(
        state=state,
        vehicle=SimpleNamespace(
            getWaitingTime=lambda name: state.waited_s if name == "over" else 0.0,
            getSpeed=lambda _name: state.speed,
            getLaneIndex=lambda _name: 1,
            getLaneID=lambda _name: "taper_1",
            getBestLanes=lambda _name: [("taper_0", 500.0, 0.0, 0, True, ()), ("taper_1", 20.0, 0.0, -1, False, ())],
            setLaneChangeMode=lambda name, mode: state.told.append((name, "mode", mode)),
            changeLane=lambda name, lane, _duration: state.told.append((name, "lane", lane)),
        ),
    )


def resolve(sumo, gridlock):
    gridlock.resolve(("over", "waits"), np.array([OVER_LINE, WAITS]), np.full(2, 4.8), np.array([sumo.state.speed, 0.0]))
    told, sumo.state.told = sumo.state.told, []
    return told


def test_driver_is_let_go_only_when_he_has_stood_for_long_and_drives_as_before_once_he_moves() -> None:
    sumo = vehicles_of_sumo(waited_s=9.9, speed=0.0)
    gridlock = Gridlock(sumo)
    assert resolve(sumo, gridlock) == []
    sumo.state.waited_s = 10.1
    assert resolve(sumo, gridlock) == [("over", "mode", 1), ("over", "lane", 0)]
    sumo.state.speed, sumo.state.waited_s = 2.0, 0.0
    assert resolve(sumo, gridlock) == [("over", "mode", 1621)]  # SUMO docs, TraCI lane change mode: the default
    assert resolve(sumo, gridlock) == []
