"""Which traces of anybody's file show one road, driven one way: those that can make a map."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from wzsumo.crowd_mapping.cleaning.station_table import tabulate
from wzsumo.crowd_mapping.cleaning.usable_fixes import UsableTraces, merge_dropped, usable_fixes
from wzsumo.crowd_mapping.reference_line import reference_line_from_traces
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.road import Road
from wzsumo.tables import kept_rows

JUMP_WINDOW, MAX_JUMP_M = 7, 10.0  # fixes around a fix, from whose median it lies aside: three lanes. Chosen by us
PLACE_CELL_M = 100.0  # side of the squares in which fixes are counted as near each other
MAX_PLACE_GAP_M = 300.0  # without any fix: beyond it another place begins; chosen by us
# A second place that holds this share of the first one's traces, and two of them, is a zone of its own; chosen by us.
MIN_SECOND_PLACE_SHARE = 0.2


def usable_traces(
    table: pd.DataFrame, *, source: str, heading_rad: float | None = None, tell: Callable[[float], None] = lambda _share: None
) -> UsableTraces:
    """The traces of a table of fixes that can make one map, and what was left out with the reason.

    Where a heading [rad, counter-clockwise from +x] is given, vehicles that drive otherwise are left out. So are rows that are
    no fixes (`usable_fixes`), vehicles that stand, drive against most others, or lie far beside or away from them, and fixes
    that jump aside. `tell` is called with the share of the work that is done, in the order of the steps; the shares are those
    of 3 million fixes. Raises TraceError where nothing is left and where the file holds two zones.
    """
    fixes = usable_fixes(table, source=source)
    kept, otherwise = _driven_towards(fixes.traces, heading_rad, source=source)
    tell(0.25)
    traces, far = _in_one_place(kept, source=source)
    tell(0.65)
    try:
        axis = reference_line_from_traces(traces)
        unfit = tabulate(traces, axis).dropped
    except TraceError as error:
        raise TraceError(f"{source}: {error}") from None
    counts = traces["vehicle_id"].value_counts()
    unfit = unfit.assign(n_fixes=counts.reindex(unfit["vehicle_id"]).to_numpy())
    kept = kept_rows(traces, ~traces["vehicle_id"].isin(unfit["vehicle_id"]).to_numpy())
    tell(0.8)
    kept, aside = _without_jumps(kept, axis)
    tell(1.0)
    parts = [part for part in (fixes.dropped, otherwise, far, unfit, aside) if len(part)]
    return UsableTraces(traces=kept, dropped=merge_dropped(parts))


def _driven_towards(traces: pd.DataFrame, heading_rad: float | None, *, source: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(traces that end within a right angle of a heading from where they begin; the others as dropped)."""
    if heading_rad is None:
        return traces, pd.DataFrame(columns=["vehicle_id", "n_fixes", "reason"])
    of_vehicle = traces.groupby("vehicle_id", sort=False)[["x_m", "y_m"]]
    way = (of_vehicle.last() - of_vehicle.first()).to_numpy() @ np.array([np.cos(heading_rad), np.sin(heading_rad)])
    ids = list(of_vehicle.groups)
    others = [name for name, along in zip(of_vehicle.first().index, way, strict=True) if along <= 0]
    if len(others) == len(ids):
        raise TraceError(f"{source}: none of {len(ids)} traces drives in the direction that is asked for")
    counts = traces["vehicle_id"].value_counts()
    dropped = pd.DataFrame(
        {
            "vehicle_id": others,
            "n_fixes": counts.reindex(others).to_numpy(),
            "reason": "drives in another direction than the one that is asked for",
        }
    )
    return kept_rows(traces, ~traces["vehicle_id"].isin(others).to_numpy()), dropped


def _without_jumps(traces: pd.DataFrame, axis: Road) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(traces without fixes that lie far aside of their vehicle's fixes around them; those as dropped)."""
    _, offset = axis.to_sd(traces[["x_m", "y_m"]].to_numpy())
    code, _ = pd.factorize(traces["vehicle_id"])
    first = np.flatnonzero(np.diff(code, prepend=-1))  # a checked table is sorted by vehicle
    spread = np.maximum.reduceat(offset, first) - np.minimum.reduceat(offset, first)
    jumps = np.zeros(len(traces), dtype=bool)
    for vehicle in np.flatnonzero(spread > MAX_JUMP_M):
        own = slice(first[vehicle], first[vehicle + 1] if vehicle + 1 < len(first) else None)
        around = pd.Series(offset[own]).rolling(JUMP_WINDOW, center=True, min_periods=1).median()
        jumps[own] = np.abs(offset[own] - around) > MAX_JUMP_M
    counts = traces["vehicle_id"][jumps].value_counts(sort=False)
    reason = f"jumps {MAX_JUMP_M:g} m or more aside from the fixes before and after"
    dropped = pd.DataFrame({"vehicle_id": counts.index, "n_fixes": counts.to_numpy(), "reason": reason})
    return kept_rows(traces, ~jumps), dropped


def _in_one_place(traces: pd.DataFrame, *, source: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(traces in the place where most are; the others as dropped). Raises TraceError where many are elsewhere."""
    place, middles = _places(traces)
    code, ids = pd.factorize(traces["vehicle_id"])
    of_vehicle = pd.Series(place[np.flatnonzero(np.diff(code, prepend=-1))], index=ids)  # sorted by vehicle
    counts = of_vehicle.value_counts()
    main = int(counts.index[0])
    away = np.hypot(*(middles - middles[main]).T)
    if len(counts) > 1 and counts.iloc[1] >= MIN_SECOND_PLACE_SHARE * counts.iloc[0] and counts.iloc[1] > 1:
        second = int(counts.index[1])
        where = " and ".join(f"{counts[k]} around ({middles[k][0]:.0f}, {middles[k][1]:.0f})" for k in (main, second))
        raise TraceError(
            f"{source}: the traces lie in {len(counts)} places up to {away.max() / 1000:.1f} km apart, {where}; a map holds "
            "one zone: cut the file into one for each"
        )
    others = of_vehicle[of_vehicle != main]
    fixes = traces["vehicle_id"].value_counts()
    far = pd.DataFrame(
        {
            "vehicle_id": others.index,
            "n_fixes": fixes.reindex(others.index).to_numpy(),
            "reason": [f"lies {away[k]:.0f} m away from the others" for k in others],
        }
    )
    return kept_rows(traces, ~traces["vehicle_id"].isin(others.index).to_numpy()), far


def _places(traces: pd.DataFrame) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """(place (n,) of each fix, middles (places, 2) [m]). Cells near each other, or joined by a vehicle, are one place."""
    # By hashing, axis by axis: to sort millions of fixes takes seconds, and their cells as pairs gigabytes.
    (column, columns), (row, rows) = (pd.factorize(np.floor(traces[name].to_numpy() / PLACE_CELL_M)) for name in ("x_m", "y_m"))
    cell_of, pairs = pd.factorize(column * len(rows) + row)
    cells = np.column_stack([columns[pairs // len(rows)], rows[pairs % len(rows)]])
    near = cKDTree(cells).query_pairs(MAX_PLACE_GAP_M / PLACE_CELL_M, output_type="ndarray")
    code, _ = pd.factorize(traces["vehicle_id"])
    steps = np.flatnonzero((np.diff(code) == 0) & (np.diff(cell_of) != 0))
    links = np.vstack([near, np.column_stack([cell_of[steps], cell_of[steps + 1]])])
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(len(cells), len(cells)))
    n_places, label = connected_components(graph, directed=False)
    place = label[cell_of]
    size = np.bincount(place, minlength=n_places)
    middles = np.column_stack([np.bincount(place, weights=traces[name], minlength=n_places) / size for name in ("x_m", "y_m")])
    return place.astype(np.intp), middles
