"""Branches: ground beside the lanes that several vehicles drove, such as ramps and auxiliary lanes."""

import numpy as np

from wzsumo.crowd_mapping.lanes.fit import LaneFit
from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.crowd_mapping.lanes.witnesses import MIN_WITNESSES, misplaced_share, witnesses
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.lane_map import MappedBranch

BESIDE_M = 0.4  # beyond the lanes' outer lines, from which on a vehicle's middle is beside them
MAX_SPREAD_M = 2.5  # between neighbouring vehicles on one branch
MAX_STEP_M = 3.0  # of a branch from station to station
MIN_LENGTH_M = 40.0


def find_branches(
    fit: LaneFit, observations: Observations, *, slow: BoolArray, removed_shift: float, width: float
) -> tuple[MappedBranch, ...]:
    """Strips of a width [m] on either side of the lanes, each driven all along by more witnesses than receivers in error."""
    right = fit.course.offset + fit.setting.base - fit.course.width / 2
    left = right + fit.setting.n_lanes * fit.course.width
    needed = MIN_WITNESSES + round(misplaced_share(fit) * len(observations.ids))
    off_lane = (observations.eta > 0) & (fit.burst > 0.5) & witnesses(fit, slow=slow)[:, None]
    y = observations.offset
    found = []
    for beside in (off_lane & (y > left + BESIDE_M), off_lane & (y < right - BESIDE_M)):
        found += _branches(y, beside, observations, shift=removed_shift, width=width, needed=needed)
    return tuple(found)


def _branches(
    y: FloatArray, beside: BoolArray, observations: Observations, *, shift: float, width: float, needed: int
) -> list[MappedBranch]:
    open_runs: list[list[tuple[int, float, set[int]]]] = []
    done: list[list[tuple[int, float, set[int]]]] = []
    for t in range(y.shape[1]):
        groups = _groups(np.flatnonzero(beside[:, t]), y[:, t], needed=needed)
        taken = set()
        still_open = []
        for run in open_runs:
            last_t, last_y, last_ids = run[-1]
            near = [
                g for g, (middle, ids) in enumerate(groups)
                if g not in taken and (abs(middle - last_y) < MAX_STEP_M * (t - last_t) or len(ids & last_ids) >= MIN_WITNESSES)
            ]  # fmt: skip
            if near:
                taken.add(near[0])
                run.append((t, *groups[near[0]]))
                still_open.append(run)
            elif t - last_t <= 2:
                still_open.append(run)
            else:
                done.append(run)
        open_runs = still_open + [[(t, *group)] for g, group in enumerate(groups) if g not in taken]
    branches = []
    for run in done + open_runs:
        at = observations.stations[[point[0] for point in run]]
        ids = set.union(*(point[2] for point in run))
        if at[-1] - at[0] >= MIN_LENGTH_M:
            line = observations.axis.to_xy(at, np.array([point[1] for point in run]) - shift)
            branches.append(MappedBranch(line=line, width=np.full(len(at), width), p_open=0.95, n_traces=len(ids)))
    return branches


def _groups(rows: np.ndarray, y: FloatArray, *, needed: int) -> list[tuple[float, set[int]]]:
    """(median offset, traces) of groups of `needed` or more neighbours."""
    order = rows[np.argsort(y[rows])]
    cuts = np.flatnonzero(np.diff(y[order]) > MAX_SPREAD_M) + 1
    return [(float(np.median(y[part])), set(part.tolist())) for part in np.split(order, cuts) if len(part) >= needed]
