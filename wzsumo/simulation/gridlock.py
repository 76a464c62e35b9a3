"""Vehicles that wait for each other without end where lanes merge, and how one of them makes way.

At the end of a lane a vehicle that straddles the line to the next lane counts, in SUMO, as hindered by a follower there that
is closer than its minimum gap. That follower waits for the part of the first vehicle that is in its way. Both then stand until
the end of the simulation (SUMO 1.28, sublane model). On a road the first vehicle goes, since the second stands and leaves it
room. So the second is content with the gap that it has until it drives again: it does not hinder the first any more, which
changes lanes by SUMO's own rules.

The first vehicle is not ordered to change lanes with others disregarded: SUMO then keeps its distance to the side from the one
that waits, and takes it back into its own lane, where the queue drives past it.
"""

from collections.abc import Collection
from typing import Any

import numpy as np

CHECK_S = 5.0  # how often SUMO is asked for such vehicles; chosen by us
PATIENCE_S = 10.0  # a vehicle has stood for so long before another makes way for it; chosen by us
STANDING_MPS = 0.1  # below it a vehicle stands; SUMO's own limit for waiting time
DRIVING_MPS = 1.0  # above it a vehicle that made way drives again; chosen by us
BESIDE_GAP_M = 1.0  # a vehicle with a smaller gap along the lane is beside: the two would touch; chosen by us
_SPARE_M = 0.05  # of a gap beyond the minimum gap of the vehicle that is content with it: any above 0 hinders nobody


class Gridlock:
    """Finds vehicles that wait for each other where lanes merge, and lets the one behind make way."""

    def __init__(self, api: Any, edges: Collection[str] = ()) -> None:
        """`edges` are those that are looked at, all where none are named."""
        self._api = api
        self._edges = [id_ for id_ in api.edge.getIDList() if id_ in edges or not edges]
        self._own_gaps: dict[str, float] = {}  # m, minimum gaps of the vehicles that are content with less

    def resolve(self) -> None:
        """Let vehicles make way for those that have stood for PATIENCE_S, and keep their own gaps again once they drive."""
        vehicle, edge = self._api.vehicle, self._api.edge
        on_road = set(vehicle.getIDList()) if self._own_gaps else set()
        for name in [name for name in self._own_gaps if name not in on_road or vehicle.getSpeed(name) > DRIVING_MPS]:
            own = self._own_gaps.pop(name)
            if name in on_road:
                vehicle.setMinGap(name, own)
        for id_ in [id_ for id_ in self._edges if edge.getLastStepHaltingNumber(id_)]:
            for name in edge.getLastStepVehicleIDs(id_):
                if vehicle.getWaitingTime(name) >= PATIENCE_S:
                    self._make_way_for(name)

    def _make_way_for(self, name: str) -> None:
        """Let followers that wait for a vehicle, in the lane that it must change to, be content with the gaps they have."""
        vehicle, side = self._api.vehicle, self._wanted_side(name)
        if not side or self._is_shut_in_ahead(name, side):
            return
        for other, spare in (vehicle.getLeftFollowers if side > 0 else vehicle.getRightFollowers)(name):
            own = vehicle.getMinGap(other)
            gap = spare + own  # SUMO tells by how much a gap is larger than the minimum gap of the vehicle behind it
            if spare < 0 and gap >= BESIDE_GAP_M and vehicle.getSpeed(other) < STANDING_MPS:
                self._own_gaps.setdefault(other, own)
                vehicle.setMinGap(other, gap - _SPARE_M)

    def _is_shut_in_ahead(self, name: str, side: int) -> bool:
        """Whether another vehicle, in the lane that it must change to, is beside its front: then it cannot change lanes."""
        vehicle = self._api.vehicle
        leaders = (vehicle.getLeftLeaders if side > 0 else vehicle.getRightLeaders)(name)
        return any(spare + vehicle.getMinGap(name) < BESIDE_GAP_M for _, spare in leaders)

    def _wanted_side(self, name: str) -> int:
        """1 where the lane that leads on is to the left, -1 to the right, 0 where the vehicle is in it."""
        vehicle = self._api.vehicle
        offsets = {lane[0]: lane[3] for lane in vehicle.getBestLanes(name)}
        return int(np.sign(offsets.get(vehicle.getLaneID(name), 0)))
