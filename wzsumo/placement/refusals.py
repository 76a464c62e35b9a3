"""Places at which a zone cannot stand, each refused in one line with edge, rule and remedy."""

import math

from wzsumo.errors import PlacementError
from wzsumo.placement.cuts import CutEdge
from wzsumo.placement.lane_plan import LanePlan

SIGNALS = ("traffic_light", "traffic_light_unregulated", "traffic_light_right_on_red", "rail_signal", "rail_crossing")


def check_cuts(cuts: tuple[CutEdge, ...]) -> None:
    """Raise PlacementError where an edge cannot be cut without changing more than its pieces."""
    for cut in cuts:
        edge = cut.edge
        for lane in edge.lanes:
            if any(child.tag == "neigh" for child in lane.element.children):
                raise PlacementError(
                    f"edge {edge.id!r}: lane {lane.id!r} has a neighbouring lane of the other direction (<neigh>), which a cut "
                    "would lose; place the zone on another edge"
                )
            if abs(lane.length - edge.length) > 0.01:
                raise PlacementError(
                    f"edge {edge.id!r}: its lanes are {edge.length:g} and {lane.length:g} m long, and a cut across them is at "
                    "no one position; place the zone on another edge"
                )
        if edge.element.get("bidi"):
            raise PlacementError(
                f"edge {edge.id!r} is one track for both directions (bidi={edge.element.get('bidi')!r}), which a cut would "
                "part; place the zone on another edge"
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
