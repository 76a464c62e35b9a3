"""What the other drivers are shown of the ego: in each lane that it reaches into the part that it takes of it."""

import numpy as np

from wzsumo.ego import EgoState
from wzsumo.frames import BoolArray, FloatArray, advance
from wzsumo.road import Road
from wzsumo.simulation.edges import Edge
from wzsumo.simulation.session import SIDE_CLEARANCE_M, Part
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

LEAST_REACH_M = 0.02  # less is not shown
# Who reaches farther into a lane than the first and leaves the second of it free takes all of it: SUMO's drivers would squeeze
# past and be shut in. Where less is free nobody fits in.
BLOCKING_REACH_M, PASSABLE_M = 0.5, 1.5
# From a lane's line to what is shown in it. SUMO's lanes end 0.1 m before it, on bends of 300 m 0.06 m more, where one turns by
# 1 : 10 0.2 m more, and those of the next edge may be narrower by 0.1 m on each side.
WITHIN_LANE_M = 0.4
LEAST_WIDTH_M = 0.1


def seen_by_others(
    state: EgoState, vehicle: VehicleGeometry, traffic: Traffic, *, road: Road, edges: tuple[Edge, ...]
) -> tuple[Part, ...]:
    """What other drivers must see of the ego, with SIDE_CLEARANCE_M beside it; first the part in the lane nearest to its front.

    SUMO lays a body along its lane, however the ego is turned: it takes what the outline takes, from one side to the other.
    With the width of the car alone drivers who creep around an ego that waits askew between two lanes run into its rear corner.

    Another lane where somebody is beside the ego is left out: shown to that driver it would be a leader whom he has run into,
    and he would stop there for good. He drives on; who follows him sees the ego afterwards.
    """
    front = advance(state.pose, vehicle.axle_to_bumper_m)
    stations, offsets = road.to_sd(np.vstack([front[:2], vehicle.outline(state.pose)]))
    station, across, lowest, highest = stations[0], offsets[0], float(offsets[1:].min()), float(offsets[1:].max())
    edge = next((edge for edge in edges if edge.start <= station < edge.end), edges[-1])
    borders = [(float(lane.right(station)), float(lane.left(station))) for lane in edge.through]
    nearest = int(np.argmin([abs((right + left) / 2 - across) for right, left in borders]))
    theirs = _offsets_beside(state, vehicle, traffic, road=road)
    parts: list[Part] = []
    for lane, (right, left) in zip(edge.through, borders, strict=True):
        reach = min(left, highest + SIDE_CLEARANCE_M) - max(right, lowest - SIDE_CLEARANCE_M)
        somebody_beside = ((theirs > right) & (theirs < left)).any()
        if lane is edge.through[nearest] or (reach >= LEAST_REACH_M and not somebody_beside):
            from_right, to_left = _taken(right, left, lowest, highest)
            x, y = road.to_xy(station, (from_right + to_left) / 2)
            part = Part(
                lane=lane.index, edge=edge.id, index=edge.lanes.index(lane), front=np.array([x, y, state.heading]),
                width=to_left - from_right,
            )  # fmt: skip
            parts.insert(0 if lane is edge.through[nearest] else len(parts), part)
    return tuple(parts)


def _taken(right: float, left: float, lowest: float, highest: float) -> tuple[float, float]:
    """The offsets, within a lane from `right` to `left`, between which an ego from `lowest` to `highest` takes it."""
    taken_right, taken_left = lowest - SIDE_CLEARANCE_M, highest + SIDE_CLEARANCE_M
    reach = min(left, highest) - max(right, lowest)
    if reach > BLOCKING_REACH_M and max(taken_right - right, left - taken_left) > PASSABLE_M:
        taken_right, taken_left = right, left
    within_right, within_left = right + WITHIN_LANE_M, left - WITHIN_LANE_M
    taken_right = min(max(taken_right, within_right), within_left - LEAST_WIDTH_M)
    return taken_right, max(min(taken_left, within_left), taken_right + LEAST_WIDTH_M)


def _offsets_beside(state: EgoState, vehicle: VehicleGeometry, traffic: Traffic, *, road: Road) -> FloatArray:
    """Lateral offsets (n,) on the road of the vehicles that have any part of their length beside the ego's."""
    beside = _beside(state, vehicle, traffic)
    return road.to_sd(traffic.poses[beside, :2])[1] if beside.any() else np.empty(0)


def _beside(state: EgoState, vehicle: VehicleGeometry, traffic: Traffic) -> BoolArray:
    """Which vehicles (n,) have any part of their length beside the ego's."""
    centre = advance(state.pose, vehicle.axle_to_centre_m)
    along = (traffic.poses[:, :2] - centre[:2]) @ np.array([np.cos(state.heading), np.sin(state.heading)])
    return np.asarray(np.abs(along) < (traffic.lengths + vehicle.length_m) / 2)
