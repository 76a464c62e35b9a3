"""Drivers who wait for each other where lanes merge, and how one of them is let go."""

from typing import Any

import numpy as np

from wzsumo.frames import FloatArray

PATIENCE_S = 10.0  # of standing before the one ahead goes on; an assumption
STANDING_MPS = 0.1  # SUMO's own limit for waiting
ROOM_M = 1.0  # to who is beside: less and their bodies would meet
WAITING_BEHIND_M = 6.0  # who stands as near behind as this waits for nobody else: SUMO's minimum gap is 2.5 m
LANE_APART_M = (1.0, 4.5)  # sideways from the middle of one vehicle to the next one's in the lane beside, either over the line
_WITHOUT_ASKING = 0b0000_0000_0001  # SUMO's lane change mode: strategic changes, others not respected (SUMO docs, TraCI)
_AS_BEFORE = 0b0110_0101_0101  # SUMO's default mode
_CHANGE_S = 5.0  # how long the change is insisted on


class Gridlock:
    """Lets go on those who would wait for each other for good.

    A driver at the end of his lane, half over the line, counts as hindered by who follows in the next lane closer than SUMO's
    minimum gap; that one waits for the part that is in his way. Both stand until the end of the simulation (SUMO 1.28, sublane
    model). On a road the first goes on: so he is told to, if the other stands and nobody is beside him.
    """

    def __init__(self, api: Any) -> None:
        self._api = api
        self._let_go: set[str] = set()

    def resolve(self, ids: tuple[str, ...], poses: FloatArray, lengths: FloatArray, speeds: FloatArray) -> None:
        """Let go who has stood for PATIENCE_S, of vehicles (n,): `poses` (n, 3) are of their centres."""
        vehicle = self._api.vehicle
        for name in [name for name in self._let_go if name not in ids or vehicle.getSpeed(name) > 1.0]:
            self._let_go.remove(name)
            if name in ids:
                vehicle.setLaneChangeMode(name, _AS_BEFORE)
        for index in np.flatnonzero(speeds < STANDING_MPS):
            name = ids[index]
            if vehicle.getWaitingTime(name) < PATIENCE_S:
                continue
            side = self._wanted_side(name)
            if side and may_go_first(int(index), side, poses=poses, lengths=lengths, speeds=speeds):
                vehicle.setLaneChangeMode(name, _WITHOUT_ASKING)
                vehicle.changeLane(name, vehicle.getLaneIndex(name) + side, _CHANGE_S)
                self._let_go.add(name)

    def _wanted_side(self, name: str) -> int:
        """1 where the lane that leads on is to the left, -1 to the right, 0 where the vehicle is in it."""
        vehicle = self._api.vehicle
        offsets = {lane[0]: lane[3] for lane in vehicle.getBestLanes(name)}
        return int(np.sign(offsets.get(vehicle.getLaneID(name), 0)))


def may_go_first(index: int, side: int, *, poses: FloatArray, lengths: FloatArray, speeds: FloatArray) -> bool:
    """Whether one of the vehicles (n,) may come over to a side (1: left): somebody there waits for it, nobody is beside it."""
    x, y, heading = poses[index]
    along = (poses[:, 0] - x) * np.cos(heading) + (poses[:, 1] - y) * np.sin(heading)
    across = side * ((poses[:, 1] - y) * np.cos(heading) - (poses[:, 0] - x) * np.sin(heading))
    gap = np.abs(along) - (lengths + lengths[index]) / 2
    nearest, farthest = LANE_APART_M
    over_there = (across > nearest) & (across < farthest)
    waits = over_there & (along < 0) & (gap >= ROOM_M) & (gap < WAITING_BEHIND_M) & (speeds < STANDING_MPS)
    beside = (across > 0) & (across < farthest) & (gap < ROOM_M)
    return bool(waits.any() and not beside.any())
