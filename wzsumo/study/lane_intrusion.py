"""Which lanes the ego reaches into beside the one that SUMO counts it to."""

import numpy as np

from wzsumo.ego import EgoState
from wzsumo.frames import advance
from wzsumo.road import Road
from wzsumo.simulation.network import Edge
from wzsumo.simulation.session import Intrusion
from wzsumo.vehicle import VehicleGeometry

SIDE_CLEARANCE_M = 0.3  # that a driver keeps to what reaches into the lane; SUMO keeps none to a vehicle placed by moveToXY
LEAST_REACH_M = 0.02  # less is not an intrusion


def intrusions(state: EgoState, vehicle: VehicleGeometry, *, road: Road, edges: tuple[Edge, ...]) -> tuple[Intrusion, ...]:
    """What other drivers must see of the ego in lanes next to its own, each with SIDE_CLEARANCE_M beside it."""
    front = advance(state.pose, vehicle.axle_to_bumper_m)
    (station,), (across,) = road.to_sd(front[None, :2])
    edge = next((edge for edge in edges if edge.start <= station < edge.end), edges[-1])
    borders = [(float(lane.right(station)), float(lane.left(station))) for lane in edge.lanes]
    own = int(np.argmin([abs((right + left) / 2 - across) for right, left in borders]))
    _, offsets = road.to_sd(vehicle.outline(state.pose))
    lowest, highest = float(offsets.min()), float(offsets.max())
    found = []
    for index, (right, left) in enumerate(borders):
        if index == own or min(left, highest) - max(right, lowest) < LEAST_REACH_M:
            continue
        # From the line that the ego has crossed to its farther side, and the clearance.
        low, high = (right, min(left, highest + SIDE_CLEARANCE_M)) if index > own else (max(right, lowest - SIDE_CLEARANCE_M), left)
        x, y = road.to_xy(station, (low + high) / 2)
        found.append(Intrusion(lane=edge.lanes[index].index, front=np.array([x, y, state.heading]), width=high - low))
    return tuple(found)
