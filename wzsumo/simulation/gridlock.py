"""Vehicles that wait for each other without end where lanes merge, and how one of them is let go.

At the end of a lane a vehicle that straddles the line to the next lane counts, in SUMO, as hindered by a follower there that
is closer than its minimum gap. That follower waits for the part of the first vehicle that is in its way. Both then stand until
the end of the simulation (SUMO 1.28, sublane model). On a road the first vehicle goes; here it is told to.
"""

from collections.abc import Collection
from typing import Any

import numpy as np

CHECK_S = 5.0  # how often SUMO is asked for such vehicles; chosen by us
PATIENCE_S = 10.0  # a vehicle has stood for so long before it is let go; chosen by us
STANDING_MPS = 0.1  # below it a vehicle stands; SUMO's own limit for waiting time
DRIVING_MPS = 1.0  # above it a vehicle that was let go drives again; chosen by us
BESIDE_GAP_M = 1.0  # a vehicle with a smaller gap along the lane is beside: the two would touch; chosen by us
_CHANGE_REGARDLESS = 0b0000_0000_0001  # lane change mode: strategic changes, others not respected (SUMO docs, TraCI)
_DEFAULT_CHANGE_MODE = 0b0110_0101_0101  # ibid.
_CHANGE_S = 10.0  # the time for which SUMO keeps trying the change; chosen by us
# How fast a vehicle that is let go moves aside from a stand [m/s]: SUMO gives it no room ahead. Chosen by us
_STANDING_LATERAL_MPS = 0.5
_STANDING_LATERAL = "laneChangeModel.lcMaxSpeedLatStanding"


class Gridlock:
    """Finds vehicles that wait for each other where lanes merge, and lets one of them change lanes first."""

    def __init__(self, api: Any, edges: Collection[str] = ()) -> None:
        """`edges` are those that are looked at, all where none are named."""
        self._api = api
        self._edges = [id_ for id_ in api.edge.getIDList() if id_ in edges or not edges]
        self._let_go: dict[str, str] = {}  # how fast each moves aside from a stand by itself

    def resolve(self) -> None:
        """Let go those vehicles that have stood for PATIENCE_S and may go first."""
        vehicle, edge = self._api.vehicle, self._api.edge
        on_road = set(vehicle.getIDList()) if self._let_go else set()
        for name in [name for name in self._let_go if name not in on_road or vehicle.getSpeed(name) > DRIVING_MPS]:
            own = self._let_go.pop(name)
            if name in on_road:
                vehicle.setLaneChangeMode(name, _DEFAULT_CHANGE_MODE)
                vehicle.setParameter(name, _STANDING_LATERAL, own)
        for id_ in [id_ for id_ in self._edges if edge.getLastStepHaltingNumber(id_)]:
            for name in edge.getLastStepVehicleIDs(id_):
                if vehicle.getWaitingTime(name) < PATIENCE_S:
                    continue
                side = self._wanted_side(name)
                if side and self._may_go_first(name, side):
                    vehicle.setLaneChangeMode(name, _CHANGE_REGARDLESS)
                    vehicle.changeLane(name, vehicle.getLaneIndex(name) + side, _CHANGE_S)
                    self._let_go.setdefault(name, vehicle.getParameter(name, _STANDING_LATERAL))
                    vehicle.setParameter(name, _STANDING_LATERAL, f"{_STANDING_LATERAL_MPS:g}")

    def _wanted_side(self, name: str) -> int:
        """1 where the lane that leads on is to the left, -1 to the right, 0 where the vehicle is in it."""
        vehicle = self._api.vehicle
        offsets = {lane[0]: lane[3] for lane in vehicle.getBestLanes(name)}
        return int(np.sign(offsets.get(vehicle.getLaneID(name), 0)))

    def _may_go_first(self, name: str, side: int) -> bool:
        """Whether a vehicle in the next lane on a side (1: left) waits for this one, and none is beside it."""
        vehicle = self._api.vehicle
        left = side > 0
        followers = (vehicle.getLeftFollowers if left else vehicle.getRightFollowers)(name)
        leaders = (vehicle.getLeftLeaders if left else vehicle.getRightLeaders)(name)
        # SUMO tells by how much a gap is larger than the minimum gap of the vehicle behind it.
        behind = [(other, spare + vehicle.getMinGap(other)) for other, spare in followers]
        ahead = [spare + vehicle.getMinGap(name) for _, spare in leaders]
        waits = any(spare < 0 and vehicle.getSpeed(other) < STANDING_MPS for other, spare in followers)
        return waits and min(*ahead, *(gap for _, gap in behind), np.inf, np.inf) >= BESIDE_GAP_M
