"""The ego in SUMO: one body in each lane that the ego reaches into, as wide as the part that it takes of that lane."""

import numpy as np

from wzsumo.ego import EgoState
from wzsumo.frames import BoolArray, FloatArray, advance
from wzsumo.road import Road
from wzsumo.simulation.edges import Edge, edge_at
from wzsumo.simulation.session import SIDE_CLEARANCE_M, LaneBody
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

MIN_REACH_M = 0.02  # an ego that reaches less far into another lane has no body there; chosen by us
# An ego that reaches farther into a lane than BLOCKING_REACH_M, and leaves more than PASSABLE_M of it free, takes all of it:
# SUMO's drivers would squeeze past and be shut in. Where less is free no vehicle fits in. Set on our simulated traffic.
BLOCKING_REACH_M, PASSABLE_M = 0.5, 1.5
BODY_TO_LINE_M = 0.15  # from the line of a lane in SUMO to the body in it: after a node the line may lie 0.1 m nearer
MIN_BODY_WIDTH_M = 0.1  # of a body whose part of the lane is narrower; chosen by us


def bodies_in_lanes(
    state: EgoState, vehicle: VehicleGeometry, traffic: Traffic, *, road: Road, edges: tuple[Edge, ...]
) -> tuple[LaneBody, ...]:
    """The bodies that stand for the ego in SUMO, one in each lane that it reaches into.

    The first is in the lane whose middle is nearest to the middle of the ego's front.

    SUMO lays a body along its lane, however the ego is turned. A body is therefore as wide as what the ego's outline takes of
    the lane, and SIDE_CLEARANCE_M on either side. With the width of the car alone, drivers who creep around an ego that waits
    at an angle between two lanes run into its rear corner.

    Another lane in which a vehicle is beside the ego gets no body. SUMO would take that body for a leader that the vehicle has
    run into, and the vehicle would never drive on. Without the body it drives on; the vehicles behind it meet the body later.
    """
    front = advance(state.pose, vehicle.axle_to_bumper_m)
    stations, offsets = road.to_sd(np.vstack([front[:2], vehicle.outline(state.pose)]))
    station, front_offset, ego_right, ego_left = stations[0], offsets[0], float(offsets[1:].min()), float(offsets[1:].max())
    edge = edge_at(edges, station)
    nearest = edge.lane_at(station, front_offset)
    offsets_beside = _offsets_beside(state, vehicle, traffic, road=road)
    bodies: list[LaneBody] = []
    for index, lane in enumerate(edge.lanes):
        if lane.of is None:
            continue
        right, left = lane.lines(station)
        reach = min(left, ego_left + SIDE_CLEARANCE_M) - max(right, ego_right - SIDE_CLEARANCE_M)
        vehicle_beside = ((offsets_beside > right) & (offsets_beside < left)).any()
        if index == nearest or (reach >= MIN_REACH_M and not vehicle_beside):
            body_right, body_left = _taken_part(right, left, ego_right, ego_left)
            x, y = road.to_xy(station, (body_right + body_left) / 2)
            body = LaneBody(
                lane=lane.of.index, edge=edge.id, lane_on_edge=index, front=np.array([x, y, state.heading]),
                width=body_left - body_right,
            )  # fmt: skip
            bodies.insert(0 if index == nearest else len(bodies), body)
    return tuple(bodies)


def _offsets_beside(state: EgoState, vehicle: VehicleGeometry, traffic: Traffic, *, road: Road) -> FloatArray:
    """Lateral offsets (n,) [m] on the road of the vehicles that have any part of their length beside the ego's."""
    beside = _is_beside(state, vehicle, traffic)
    return road.to_sd(traffic.poses[beside, :2])[1] if beside.any() else np.empty(0)


def _is_beside(state: EgoState, vehicle: VehicleGeometry, traffic: Traffic) -> BoolArray:
    """Which vehicles (n,) have any part of their length beside the ego's."""
    centre = advance(state.pose, vehicle.axle_to_centre_m)
    along = (traffic.poses[:, :2] - centre[:2]) @ np.array([np.cos(state.heading), np.sin(state.heading)])
    return np.asarray(np.abs(along) < (traffic.lengths + vehicle.length_m) / 2)


def _taken_part(right: float, left: float, ego_right: float, ego_left: float) -> tuple[float, float]:
    """Right and left offset [m] of the body in a lane between its lines, of an ego between its own rightmost and leftmost."""
    body_right, body_left = ego_right - SIDE_CLEARANCE_M, ego_left + SIDE_CLEARANCE_M
    reach = min(left, ego_left) - max(right, ego_right)
    if reach > BLOCKING_REACH_M and max(body_right - right, left - body_left) > PASSABLE_M:
        body_right, body_left = right, left
    rightmost, leftmost = right + BODY_TO_LINE_M, left - BODY_TO_LINE_M
    body_right = min(max(body_right, rightmost), leftmost - MIN_BODY_WIDTH_M)
    return body_right, max(min(body_left, leftmost), body_right + MIN_BODY_WIDTH_M)
