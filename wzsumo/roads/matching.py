"""Which edges of a network traces drove along: a vote of their fixes, and the way through the edges with the most votes.

Each fix votes for the edges beside it that run its way, the nearer the more. From the edge with most votes a metre the way is
followed in both directions over the connections, to the edge with most votes each time, until few fixes speak for any.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd
import shapely

from wzsumo.errors import InputError
from wzsumo.frames import FloatArray, IntArray, wrap_angle
from wzsumo.roads.sumo_net import SumoNet

REACH_M = 25.0  # from the middle of an edge's lanes to a fix: half of six lanes and a poor receiver's error. Chosen by us
SPREAD_M = 6.0  # of fixes about the middle of an edge, as standard deviation: lanes and errors. Chosen by us
SAME_WAY_RAD = np.pi / 4  # between the ways of fix and edge; chosen by us
THINNED_M = 10.0  # between the fixes of a trace that vote; chosen by us
MIN_SUPPORT = 0.2  # votes a metre over those of the best edge; below it traces did not come along. Chosen by us
MAX_UNSUPPORTED_EDGES = 4  # short ones between two with votes
MAX_UNSUPPORTED_M = 150.0
MIN_SHARE_MATCHED = 0.5  # of fixes with an edge beside them


def edges_of_traces(net: SumoNet, traces: pd.DataFrame, *, source: str) -> list[str]:
    """Ids of the edges, in the order of travel, that the traces (in the network's metres) drove along.

    Raises InputError where most fixes have no edge beside them that runs their way.
    """
    points, headings = _thinned(traces)
    votes, share = _votes(net, points, headings)
    if share < MIN_SHARE_MATCHED:
        raise InputError(
            f"{source}: {share:.0%} of the traces lie on an edge of the network that runs their way; they are of different "
            "places or frames, or drive against it"
        )
    support = {edge: value / max(net.edges[edge].length, THINNED_M) for edge, value in votes.items()}
    best = max(support, key=support.__getitem__)
    least = MIN_SUPPORT * support[best]
    supported = {edge: value for edge, value in support.items() if value >= least}
    ahead = _followed(best, net.followers, net, supported)
    behind = _followed(best, net.predecessors, net, supported)
    return [*behind[::-1], best, *(edge for edge in ahead if edge not in behind)]


def check_edges(net: SumoNet, edges: Sequence[str], *, source: str) -> list[str]:
    """The named edges, in their order. Raises InputError where one is not there, or does not follow the one before."""
    for edge in edges:
        if edge not in net.edges:
            raise InputError(f"--edges: {source} has no edge {edge} for cars; it has {', '.join(list(net.edges)[:5])} ...")
    for before, after in pairwise(edges):
        if after not in net.followers(before):
            others = ", ".join(net.followers(before)) or "nowhere"
            raise InputError(f"--edges: no connection leads from {before} to {after} in {source}; {before} goes on to {others}")
    return list(edges)


def _thinned(traces: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) at least THINNED_M apart along each trace, and the ways (n,) [rad] in which they go on."""
    points, headings = [np.zeros((0, 2))], [np.zeros(0)]
    for _, trace in traces.groupby("vehicle_id", sort=False):
        xy = trace[["x_m", "y_m"]].to_numpy(dtype=float)
        travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
        kept = xy[np.concatenate([[True], np.diff(np.floor(travelled / THINNED_M)) > 0])]
        if len(kept) > 1:
            steps = np.diff(kept, axis=0)
            points.append((kept[1:] + kept[:-1]) / 2)
            headings.append(np.arctan2(steps[:, 1], steps[:, 0]))
    return np.concatenate(points), np.concatenate(headings)


def _votes(net: SumoNet, points: FloatArray, headings: FloatArray) -> tuple[dict[str, float], float]:
    """(votes of each edge with any, the share of points that voted)."""
    ids = list(net.edges)
    lines = np.array([_middle_line(net, edge) for edge in ids])
    places = np.asarray(shapely.points(points))
    fixes, near = shapely.STRtree(lines).query(places, predicate="dwithin", distance=REACH_M)
    beside, here = lines[near], places[fixes]
    at = shapely.line_locate_point(beside, here)
    way = shapely.get_coordinates(shapely.line_interpolate_point(beside, at + 1.0)) - shapely.get_coordinates(
        shapely.line_interpolate_point(beside, np.maximum(at - 1.0, 0.0))
    )
    same = np.abs(wrap_angle(np.arctan2(way[:, 1], way[:, 0]) - headings[fixes])) < SAME_WAY_RAD
    weight = np.exp(-0.5 * (shapely.distance(beside, here) / SPREAD_M) ** 2)[same]
    total = np.bincount(near[same], weights=weight, minlength=len(ids))
    share = len(np.unique(fixes[same])) / len(points) if len(points) else 0.0
    chosen: IntArray = np.flatnonzero(total)
    return {ids[edge]: float(total[edge]) for edge in chosen}, share


def _middle_line(net: SumoNet, edge: str) -> shapely.LineString:
    lanes = net.edges[edge].car_lanes
    return shapely.LineString(lanes[len(lanes) // 2].shape)


def _followed(start: str, next_of: Callable[[str], list[str]], net: SumoNet, supported: dict[str, float]) -> list[str]:
    """The edges after `start` by `next_of`, each time to the best supported one, over short ones without support."""
    way, seen = [], {start}
    at = start
    while found := _next_supported(at, next_of, net, supported, seen):
        way += found
        seen.update(found)
        at = found[-1]
    return way


def _next_supported(
    at: str, next_of: Callable[[str], list[str]], net: SumoNet, supported: dict[str, float], seen: set[str]
) -> list[str]:
    """The edges to the best supported edge that is near; none where there is none."""
    fronts: list[list[str]] = [[edge] for edge in next_of(at) if edge not in seen]
    for _ in range(MAX_UNSUPPORTED_EDGES + 1):
        good = [path for path in fronts if path[-1] in supported]
        if good:
            return max(good, key=lambda path: supported[path[-1]])
        fronts = [
            [*path, edge]
            for path in fronts
            if sum(net.edges[part].length for part in path) < MAX_UNSUPPORTED_M
            for edge in next_of(path[-1])
            if edge not in seen and edge not in path
        ]
    return []
