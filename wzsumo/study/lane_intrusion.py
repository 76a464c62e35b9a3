"""What the other drivers are shown of the ego: its width in the lane that SUMO counts it to, and what reaches into others."""

from typing import NamedTuple

import numpy as np

from wzsumo.ego import EgoState
from wzsumo.frames import advance
from wzsumo.grid import BoolArray
from wzsumo.road import Road
from wzsumo.simulation.edges import Edge
from wzsumo.simulation.session import SIDE_CLEARANCE_M, Intrusion
from wzsumo.simulation.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

LEAST_REACH_M = 0.02  # less is not an intrusion
BLOCKING_REACH_M = 0.5  # who reaches farther into a lane takes all of it: SUMO's drivers would squeeze past and be shut in
TIE_M = 0.1  # so near the line between two lanes nobody knows to which one SUMO counts the ego: it is shown in both


class Seen(NamedTuple):
    """What drivers see of the ego: its width [m] in its own lane, and what reaches into others, each with its clearance.

    SUMO lays the ego along its lane, its front in the middle, however it is turned: it is so wide that its outline lies within.
    With the width of the car alone drivers who creep around an ego that waits askew between two lanes run into its rear corner.
    """

    width: float
    intrusions: tuple[Intrusion, ...]


def seen_by_others(state: EgoState, vehicle: VehicleGeometry, traffic: Traffic, *, road: Road, edges: tuple[Edge, ...]) -> Seen:
    """What other drivers must see of the ego in its own lane and in those next to it, with SIDE_CLEARANCE_M beside it.

    A lane where somebody is beside the ego is left out: shown to that driver it would be a leader whom he has run into, and he
    would stop there for good. He drives on; who follows him sees the ego afterwards.
    """
    front = advance(state.pose, vehicle.axle_to_bumper_m)
    stations, offsets = road.to_sd(np.vstack([front[:2], vehicle.outline(state.pose)]))
    station, across, lowest, highest = stations[0], offsets[0], float(offsets[1:].min()), float(offsets[1:].max())
    edge = next((edge for edge in edges if edge.start <= station < edge.end), edges[-1])
    borders = [(float(lane.right(station)), float(lane.left(station))) for lane in edge.through]
    from_centre = np.array([abs((right + left) / 2 - across) for right, left in borders])
    nearest = int(np.argmin(from_centre))
    own = None if (np.delete(from_centre, nearest) < from_centre[nearest] + TIE_M).any() else nearest
    beside = _beside(state, vehicle, traffic)
    _, theirs = road.to_sd(traffic.poses[beside, :2]) if beside.any() else (None, np.empty(0))
    found = []
    for index, (right, left) in enumerate(borders):
        if index == own or min(left, highest) - max(right, lowest) < LEAST_REACH_M:
            continue
        if ((theirs > right) & (theirs < left)).any():
            continue
        found.append(_stand_in(edge.through[index].index, _taken(right, left, lowest, highest), station, state, road))
    reach = max(highest - across, across - lowest)
    return Seen(width=2 * (float(reach) + SIDE_CLEARANCE_M), intrusions=tuple(found))


def _taken(right: float, left: float, lowest: float, highest: float) -> tuple[float, float]:
    """The offsets between which a lane from `right` to `left` is taken by an ego from `lowest` to `highest`."""
    reach = min(left, highest) - max(right, lowest)
    if reach > BLOCKING_REACH_M:
        return right, left
    from_right = lowest < right
    return (right, highest + SIDE_CLEARANCE_M) if from_right else (lowest - SIDE_CLEARANCE_M, left)


def _stand_in(lane: int, taken: tuple[float, float], station: float, state: EgoState, road: Road) -> Intrusion:
    x, y = road.to_xy(station, (taken[0] + taken[1]) / 2)
    return Intrusion(lane=lane, front=np.array([x, y, state.heading]), width=taken[1] - taken[0])


def _beside(state: EgoState, vehicle: VehicleGeometry, traffic: Traffic) -> BoolArray:
    """Which vehicles (n,) have any part of their length beside the ego's."""
    centre = advance(state.pose, vehicle.axle_to_centre_m)
    along = (traffic.poses[:, :2] - centre[:2]) @ np.array([np.cos(state.heading), np.sin(state.heading)])
    return np.asarray(np.abs(along) < (traffic.lengths + vehicle.length_m) / 2)
