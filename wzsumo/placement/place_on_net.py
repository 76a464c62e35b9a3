"""The place of a zone in a network, from an edge and a position or from a latitude and a longitude."""

import numpy as np
import shapely

from wzsumo.errors import MAX_SHOWN, PlacementError, SpecError, one_line
from wzsumo.frames import FloatArray
from wzsumo.geography import LocalFrame
from wzsumo.placement.net import Net, NetEdge

NO_PROJECTION = ("!", "-", "")  # projParameter of a network without a place on earth
FROM_THE_ROAD_M = 30.0  # at most, of a point in degrees: some lanes beside the one that was meant; chosen by us


def edge_at(net: Net, edge_id: str, position: float) -> tuple[NetEdge, float]:
    """(edge, position from its beginning [m]); raises PlacementError where the network has none such."""
    edge = net.edges.get(edge_id)
    if edge is None or edge.is_internal:
        n_edges, named = sum(not edge.is_internal for edge in net.edges.values()), one_line(edge_id, limit=MAX_SHOWN)
        raise PlacementError(
            f"--at {named}: the network has no such edge; give the id of one of its {n_edges} edges, as in "
            f"{net.file.path.name} or sumo-gui"
        )
    if not -edge.length <= position <= edge.length:
        raise PlacementError(
            f"--at {edge_id} {position:g}: the edge is {edge.length:.2f} m long; give a position from {-edge.length:.2f} to "
            f"{edge.length:.2f}, negative ones from its end"
        )
    return edge, position if position >= 0 else position + edge.length


def edge_near(net: Net, latitude: float, longitude: float) -> tuple[str, float]:
    """(id of the edge, position [m]) nearest to a place in degrees, WGS 84.

    Raises PlacementError where the network has no geographic frame, or no road near that place.
    """
    projection = net.location.get("projParameter", "!")
    if projection in NO_PROJECTION:
        raise PlacementError(
            f"--at-latlon: {net.file.path} has no geographic frame (projParameter={projection!r}); give --at EDGE POS"
        )
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 180):
        raise PlacementError(
            f"--at-latlon {latitude:g} {longitude:g}: give a latitude of -90..90, then a longitude of -180..180"
        )
    frame = frame_of(net)
    point = frame.from_lonlat([longitude, latitude])
    if not np.isfinite(point).all():
        raise PlacementError(f"--at-latlon {latitude:g} {longitude:g}: the network's CRS {frame.crs!r} knows no such place")
    edge, position = _nearest(net, point)
    return edge.id, position


def frame_of(net: Net) -> LocalFrame:
    """The frame of a network that has one: SUMO adds netOffset to the coordinates of its projection."""
    east, north = (float(value) for value in net.location.get("netOffset", "0,0").split(","))
    return LocalFrame(crs=net.location["projParameter"], origin_m=(-east, -north))


def known_frame(net: Net) -> LocalFrame | None:
    """The frame of a network; None where its metres have no place on earth."""
    if net.location.get("projParameter", "!") in NO_PROJECTION:
        return None
    try:
        return frame_of(net)
    except SpecError:
        return None


def _nearest(net: Net, point: FloatArray) -> tuple[NetEdge, float]:
    place, best = None, FROM_THE_ROAD_M
    spot = shapely.Point(point)
    for edge in net.edges.values():
        for lane in [] if edge.is_internal else edge.lanes:
            points = lane.points
            if (point < points.min(axis=0) - best).any() or (point > points.max(axis=0) + best).any() or not lane.is_roadway:
                continue
            path = shapely.LineString(points)
            if (distance := path.distance(spot)) < best:
                best, place = distance, (edge, path.project(spot) / path.length * lane.length)
    if place is None:
        raise PlacementError(
            f"--at-latlon: no road lies within {FROM_THE_ROAD_M:.0f} m of x={point[0]:.1f}, y={point[1]:.1f} m of the network "
            f"(whose bounds are {net.location.get('convBoundary', '?')}); give a point on a road"
        )
    return place
