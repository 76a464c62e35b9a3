"""Vehicles that wait for each other without end where lanes merge, and how one of them is let go.

At the end of a lane a vehicle that straddles the line to the next lane counts, in SUMO, as hindered by a follower there that
is closer than its minimum gap. That follower waits for the part of the first vehicle that is in its way. Both then stand until
the end of the simulation (SUMO 1.28, sublane model). On a road the first vehicle goes; here it is told to.
"""

from typing import Any

import numpy as np

from wzsumo.frames import FloatArray

PATIENCE_S = 10.0  # a vehicle has stood for so long before it is let go; chosen by us
STANDING_MPS = 0.1  # below it a vehicle stands; SUMO's own limit for waiting time
DRIVING_MPS = 1.0  # above it a vehicle that was let go drives again; chosen by us
BESIDE_GAP_M = 1.0  # a vehicle with a smaller gap along the lane is beside: the two would touch; chosen by us
WAITING_GAP_M = 6.0  # a vehicle that stands this close behind waits for the first; SUMO's minimum gap is 2.5 m
# From the middle of a vehicle to the middle of one in the next lane, when either may straddle the line; chosen by us
NEXT_LANE_OFFSETS_M = (1.0, 4.5)
_CHANGE_REGARDLESS = 0b0000_0000_0001  # lane change mode: strategic changes, others not respected (SUMO docs, TraCI)
_DEFAULT_CHANGE_MODE = 0b0110_0101_0101  # ibid.
_CHANGE_S = 5.0  # the time for which SUMO keeps trying the change; chosen by us


class Gridlock:
    """Finds vehicles that wait for each other where lanes merge, and lets one of them change lanes first."""

    def __init__(self, api: Any) -> None:
        self._api = api
        self._let_go: set[str] = set()

    def resolve(self, ids: tuple[str, ...], poses: FloatArray, lengths: FloatArray, speeds: FloatArray) -> None:
        """Let go those of the vehicles (n,) that have stood for PATIENCE_S; `poses` (n, 3) are of their centres."""
        vehicle = self._api.vehicle
        for name in [name for name in self._let_go if name not in ids or vehicle.getSpeed(name) > DRIVING_MPS]:
            self._let_go.remove(name)
            if name in ids:
                vehicle.setLaneChangeMode(name, _DEFAULT_CHANGE_MODE)
        for index in np.flatnonzero(speeds < STANDING_MPS):
            name = ids[index]
            if vehicle.getWaitingTime(name) < PATIENCE_S:
                continue
            side = self._wanted_side(name)
            if side and may_go_first(int(index), side, poses=poses, lengths=lengths, speeds=speeds):
                vehicle.setLaneChangeMode(name, _CHANGE_REGARDLESS)
                vehicle.changeLane(name, vehicle.getLaneIndex(name) + side, _CHANGE_S)
                self._let_go.add(name)

    def _wanted_side(self, name: str) -> int:
        """1 where the lane that leads on is to the left, -1 to the right, 0 where the vehicle is in it."""
        vehicle = self._api.vehicle
        offsets = {lane[0]: lane[3] for lane in vehicle.getBestLanes(name)}
        return int(np.sign(offsets.get(vehicle.getLaneID(name), 0)))


def may_go_first(index: int, side: int, *, poses: FloatArray, lengths: FloatArray, speeds: FloatArray) -> bool:
    """Whether one of the vehicles (n,) may change to a side (1: left): a vehicle there waits for it, and none is beside it."""
    x, y, heading = poses[index]
    along = (poses[:, 0] - x) * np.cos(heading) + (poses[:, 1] - y) * np.sin(heading)
    across = side * ((poses[:, 1] - y) * np.cos(heading) - (poses[:, 0] - x) * np.sin(heading))
    gap = np.abs(along) - (lengths + lengths[index]) / 2
    nearest, farthest = NEXT_LANE_OFFSETS_M
    in_next_lane = (across > nearest) & (across < farthest)
    waits = in_next_lane & (along < 0) & (gap >= BESIDE_GAP_M) & (gap < WAITING_GAP_M) & (speeds < STANDING_MPS)
    beside = (across > 0) & (across < farthest) & (gap < BESIDE_GAP_M)
    return bool(waits.any() and not beside.any())
