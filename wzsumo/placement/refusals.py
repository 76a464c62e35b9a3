"""Places at which a zone cannot stand, each refused in one line with edge, rule and remedy."""

import math

from wzsumo.errors import PlacementError
from wzsumo.placement.cuts import CutEdge
from wzsumo.placement.lane_plan import LanePlan
from wzsumo.placement.lane_states import ClosedLanes
from wzsumo.placement.net import Net

SIGNALS = ("traffic_light", "traffic_light_unregulated", "traffic_light_right_on_red", "rail_signal", "rail_crossing")


def check_net(net: Net) -> None:
    """Raise PlacementError for a network that drives on the left, for which the manual lays out no zones."""
    if net.lefthand:
        raise PlacementError(
            f"{net.file.path}: its traffic drives on the left (lefthand), and the manual's zones are for the right; give a "
            "network that drives on the right"
        )


def check_cuts(net: Net, cuts: tuple[CutEdge, ...]) -> None:
    """Raise PlacementError where an edge cannot be cut without changing more than its pieces."""
    for cut in cuts:
        edge = cut.edge
        if taken := [id_ for id_ in cut.ids if id_ in net.edges] + [id_ for id_ in cut.nodes() if id_ in net.junctions]:
            raise PlacementError(
                f"edge {edge.id!r}: a piece of it would be called {taken[0]!r}, and the network has that already; rename it "
                "in netedit"
            )
        for lane in edge.lanes:
            if abs(lane.length - edge.length) > 0.01:
                raise PlacementError(
                    f"edge {edge.id!r}: its lanes are {edge.length:g} and {lane.length:g} m long, and a cut across them is at "
                    "no one position; place the zone on another edge"
                )


def check_other_direction(net: Net, closed: ClosedLanes) -> None:
    """Raise PlacementError where vehicles of the other direction drive on an edge that the zone cuts or closes lanes of."""
    ids = {cut.edge.id for cut in closed.plan.cuts} | {piece.link.edge.id for piece in closed.pieces if piece.barred}
    for edge in net.edges.values():
        shared = {edge.id, edge.element.get("bidi")}
        if edge.element.get("bidi") and shared & ids:
            raise PlacementError(
                f"edge {edge.id!r} is one track for both directions (bidi={edge.element.get('bidi')!r}), which the zone "
                "would part; place it on another edge"
            )
        for lane in edge.lanes:
            for beside in [child.get("lane").rpartition("_")[0] for child in lane.element.children if child.tag == "neigh"]:
                if {edge.id, beside} & ids:
                    raise PlacementError(
                        f"edge {edge.id!r}: vehicles on lane {lane.id!r} overtake over edge {beside!r} of the other direction "
                        "(<neigh>), which the zone would part; place it on another edge"
                    )


def check_signals(plan: LanePlan) -> None:
    """Raise PlacementError for a signal within a taper."""
    corridor = plan.corridor
    tapers = [(area.start, area.end) for area in plan.layout.areas if "taper" in area.name or "shift" in area.name]
    for link in corridor.links:
        node = corridor.net.junctions.get(link.edge.to_node)
        end = corridor.span(link)[1]
        if node is None or node.get("type") not in SIGNALS:
            continue
        for start, stop in tapers:
            if start < end < stop:
                down, up = math.ceil(end - start), math.ceil(stop - end)
                raise PlacementError(
                    f"edge {link.edge.id!r} ends at the signal of junction {link.edge.to_node!r}, within a taper, where "
                    f"traffic must not stop; move the zone by {down} m downstream or {up} m upstream"
                )
