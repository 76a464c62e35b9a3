"""The road before from a SUMO network: the stretch that traces drove, or named edges, in the metres of the traces."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from wzsumo.errors import SpecError
from wzsumo.geography import LocalFrame
from wzsumo.road import Road
from wzsumo.roads.found_road import FoundRoad
from wzsumo.roads.matching import check_edges, edges_of_traces
from wzsumo.roads.stretch import road_of_edges
from wzsumo.roads.sumo_net import SumoNet, read_net


def read_network_road(
    path: Path,
    *,
    traces: pd.DataFrame,
    frame: LocalFrame | None,
    edges: Sequence[str],
    shoulders: tuple[float, float] | None,
    source: str,
) -> FoundRoad:
    """The road of a network file along the traces (metres of `frame`), or along `edges` where they are named.

    `source` names the traces. Raises InputError where traces and network have no place in common.
    """
    net = read_net(path)
    if frame is not None and net.frame is None:
        raise SpecError(
            f"{path}: its location names no projection (projParameter), so the place of its metres is unknown; give the "
            "traces in its metres"
        )
    moved = _in_net(traces, frame, net)
    chain = check_edges(net, edges, source=str(path)) if edges else edges_of_traces(net, moved, source=source)
    found = road_of_edges(net, chain, shoulders=shoulders, source=str(path))
    if frame is None or net.frame is None or frame == net.frame:
        return found
    line = frame.from_lonlat(net.frame.to_lonlat(found.road.reference_line))
    return replace(found, road=_with_line(found.road, line))


def _in_net(traces: pd.DataFrame, frame: LocalFrame | None, net: SumoNet) -> pd.DataFrame:
    if frame is None or net.frame is None or frame == net.frame:
        return traces
    xy = net.frame.from_lonlat(frame.to_lonlat(traces[["x_m", "y_m"]].to_numpy()))
    return traces.assign(x_m=xy[:, 0], y_m=xy[:, 1])


def _with_line(road: Road, line: np.ndarray) -> Road:
    return replace(road, reference_line=line)
