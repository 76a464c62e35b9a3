"""CommonRoad scenarios of one road as one set of trips: scenarios whose frames differ by a translation are joined on a map."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pandas as pd

from wzsumo.frames import FloatArray

MATCH_M = 0.02  # two points of two maps are the same point within it
LEAST_MATCHES = 40
LEAST_TRIP_M = 40.0  # shorter trips are left out
SCORED_M = (190.0, 410.0)  # along the axis, from the on-ramp to the off-ramp of US-101: most trips are there
AXIS_STEP_M = 10.0


def joined_scenarios(paths: Iterable[Path], map_file: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
    """(trips with columns trip, t, x, y; what is known of the lanes) of the scenarios whose lanelets lie on the map.

    The lanes are a dict: `lanelets` (rings of points), `left` and `right` edge of the main lanes at the same places, the
    number of `lanes` and the `scored` part along them [m]. Its frame has its origin at the first main lane's left edge.
    """
    lanelets = {one.get("id", ""): one for one in Xml.parse(map_file).getroot().findall("lanelet")}
    bounds = {name: (_points(one, "leftBound"), _points(one, "rightBound")) for name, one in lanelets.items()}
    everything = np.vstack([side for pair in bounds.values() for side in pair])
    main, lanes = _main_edges(lanelets, bounds)
    origin = main[0][0]
    trips: dict[tuple[int, ...], pd.DataFrame] = {}
    for path in paths:
        root = Xml.parse(path).getroot()
        own = np.vstack([_points(one, side) for one in root.findall("lanelet") for side in ("leftBound", "rightBound")])
        shift = _translation(own, everything)
        if shift is None:
            continue
        for vehicle in root:
            fixes = _fixes(vehicle)
            if len(fixes) and np.hypot(*(fixes[-1, 1:] - fixes[0, 1:])) >= LEAST_TRIP_M:
                xy = fixes[:, 1:] - shift - origin
                key = tuple(np.round(np.r_[xy[0], xy[-1]]).astype(int).tolist())  # one trip is in several scenarios
                trips.setdefault(key, pd.DataFrame({"t": 0.1 * fixes[:, 0], "x": xy[:, 0], "y": xy[:, 1]}))
    table = pd.concat([one.assign(trip=f"u{number:04d}") for number, one in enumerate(trips.values())], ignore_index=True)
    rings = [np.vstack([left, right[::-1]]) - origin for left, right in bounds.values()]
    length = float(np.hypot(*np.diff(main[0], axis=0).T).sum())
    left, right = (_resampled(side - origin, count=round(length / AXIS_STEP_M) + 1) for side in main)
    known = {
        "lanelets": [ring.tolist() for ring in rings],
        "left": left.tolist(),
        "right": right.tolist(),
        "lanes": lanes,
        "scored": SCORED_M,
    }
    return table[["trip", "t", "x", "y"]], known


def _points(element: Xml.Element, bound: str) -> FloatArray:
    found = element.find(bound)
    assert found is not None
    return np.array([[float(point.findtext("x", "nan")), float(point.findtext("y", "nan"))] for point in found.iter("point")])


def _fixes(vehicle: Xml.Element) -> FloatArray:
    """Fixes (n, 3) of a vehicle: step, x, y [m] of its centre; none of what is no vehicle."""
    states = [*vehicle.findall("initialState"), *vehicle.findall("trajectory/state")]
    points = [(state.findtext("time/exact"), state.find("position/point")) for state in states]
    return np.array(
        [(float(t), float(p.findtext("x", "nan")), float(p.findtext("y", "nan"))) for t, p in points if t and p is not None]
    ).reshape(-1, 3)


def _translation(points: FloatArray, others: FloatArray) -> FloatArray | None:
    """The translation (2,) [m] that most points have in common with others, None where too few have one."""
    some = points[:: max(1, len(points) // 150)]
    steps = np.round((some[:, None] - others[None]).reshape(-1, 2) / MATCH_M).astype(np.int64)
    found, counts = np.unique(steps @ np.array([1 << 31, 1]), return_counts=True)
    if counts.max() < LEAST_MATCHES:
        return None
    best = int(found[counts.argmax()])
    y = (best + (1 << 30)) % (1 << 31) - (1 << 30)
    return MATCH_M * np.array([(best - y) >> 31, y])


def _main_edges(
    lanelets: dict[str, Xml.Element], bounds: dict[str, tuple[FloatArray, FloatArray]]
) -> tuple[tuple[FloatArray, FloatArray], int]:
    """((left, right edge line) of the main lanes, their number): rows of lanelets beside each other, chained along the road.

    The main lanes are those that lie beside the leftmost chain all along; a ramp does so on a part of the way.
    """
    follows = {name: [s.get("ref", "") for s in one.findall("successor")] for name, one in lanelets.items()}
    left_of = {name: next((a.get("ref", "") for a in one.findall("adjacentLeft")), "") for name, one in lanelets.items()}
    heads = [name for name in lanelets if not any(name in others for others in follows.values())]
    chains = []
    for head in heads:
        chain = [head]
        while follows[chain[-1]]:
            chain.append(follows[chain[-1]][0])
        chains.append(chain)
    full = [chain for chain in chains if all(left_of[name] for name in chain) or not any(left_of[name] for name in chain)]
    leftmost = next(chain for chain in full if not any(left_of[name] for name in chain) and _leads(chain, left_of))
    row = [leftmost]
    while nexts := [chain for chain in full if [left_of[name] for name in chain] == row[-1]]:
        row.append(nexts[0])
    left = np.vstack([bounds[name][0] for name in row[0]])
    right = np.vstack([bounds[name][1] for name in row[-1]])
    return (left, right), len(row)


def _leads(chain: list[str], left_of: dict[str, str]) -> bool:
    """Whether something lies to the right of each lanelet of a chain."""
    return all(name in left_of.values() for name in chain)


def _resampled(line: FloatArray, *, count: int) -> FloatArray:
    """`count` points (count, 2) at equal distances along a line (n, 2)."""
    distinct = line[np.r_[True, np.hypot(*np.diff(line, axis=0).T) > 1e-3]]
    at = np.r_[0.0, np.cumsum(np.hypot(*np.diff(distinct, axis=0).T))]
    share = np.linspace(0, at[-1], count)
    return np.column_stack([np.interp(share, at, distinct[:, axis]) for axis in (0, 1)])
