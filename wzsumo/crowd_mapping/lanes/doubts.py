"""What the reader of a map must know of its weaknesses, in sentences."""

import numpy as np

from wzsumo.crowd_mapping.lanes.course import Course
from wzsumo.crowd_mapping.lanes.fit import LaneFit
from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.crowd_mapping.lanes.witnesses import lanes_driven
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import FREE_THRESHOLD, OCCUPIED_THRESHOLD
from wzsumo.lane_map import MappedBranch, MappedLane

TOLD_SHIFT_M, TOLD_SHIFT_SDS = 0.5, 2.0  # a smaller shift, or a less certain one, is not told
UNSURE_SHIFT_SD_M = 0.8  # beyond, nothing tells a common error from a move of the lanes
POOR_RECEIVERS_M = 1.2  # median error, beyond which a map of few traces is uncertain
MIN_OFF_LANE_M = 100.0  # beside the lanes, from which on a trace is named
MAX_NAMED = 5


def said_of_shift(course: Course, *, has_road: bool, removed: float) -> list[str]:
    """What is said of the common shift of all positions."""
    if not has_road:
        return []
    if course.shift_sd > UNSURE_SHIFT_SD_M:
        return [
            "no trace drove on the road outside the announced zone, or too few: whether all positions are off together "
            "cannot be told"
        ]
    size, side = abs(course.shift), "left" if course.shift > 0 else "right"
    if size < max(TOLD_SHIFT_M, TOLD_SHIFT_SDS * course.shift_sd):
        return []
    seen = f"all positions lie {size:.1f} m (sd {course.shift_sd:.1f} m) to the {side} of the road's lanes"
    if removed:
        return [f"{seen}: taken to be a common error of the receivers and removed"]
    return [f"{seen}: the road is taken to be drawn off its place, and the map lies where the traces are"]


def said_of_explained(explained: float) -> list[str]:
    """What is said where lanes, with vehicles that may be beside them, explain too little of what was driven."""
    return [
        f"lanes explain {explained:.0%} of what was driven: they are laid where vehicles drove, and whether some of these "
        "drove beside them cannot be told"
    ]


def said_of_count(there: FloatArray) -> list[str]:
    """What is said of lanes that may not be there, by the probability (lanes,) of each."""
    return [
        f"lane {number} (0 = rightmost) may not be there (probability that it is: {p:.2f}): other lanes explain the traces too"
        for number, p in enumerate(there)
        if p < 1 - FREE_THRESHOLD
    ]


def said_of_lanes(
    lanes: tuple[MappedLane, ...], fit: LaneFit, observations: Observations, *, branches: tuple[MappedBranch, ...]
) -> list[str]:
    """What is said of lanes that nobody or one vehicle drove, of tapers that are prior alone, and of branches."""
    words = []
    for number, lane in enumerate(lanes):
        p_closed = 1 - lane.p_open_middle
        if lane.n_traces == 0:
            words.append(
                f"no trace drove in lane {number} (0 = rightmost): what is said of it rests on the road and the announcement"
            )
        elif lane.n_traces == 1 and (p_closed < FREE_THRESHOLD).all():
            words.append(f"one trace alone drove in lane {number} (0 = rightmost)")
        closed = p_closed > OCCUPIED_THRESHOLD
        if closed.any() and not closed[0]:
            ends = observations.stations[(p_closed > 0.1) & (p_closed < 0.9)]
            ahead = ends[ends < observations.stations[closed][0] + 1]
            if len(ahead) > 1:
                words.append(
                    f"lane {number} closes between {ahead[0]:.0f} m and {observations.stations[closed][0]:.0f} m; its taper's "
                    "shape is the manual's, not seen by traces"
                )
    words += [
        f"{branch.n_traces} traces drove beside the lanes over {np.hypot(*np.diff(branch.line, axis=0).T).sum():.0f} m: mapped "
        "as a branch"
        for branch in branches
    ]
    if np.median(fit.sigma) > POOR_RECEIVERS_M:
        words.append(f"half of the receivers err by {np.median(fit.sigma):.1f} m or more")
    return words


def said_of_traces(
    fit: LaneFit, observations: Observations, *, slow: BoolArray, lanes: tuple[MappedLane, ...]
) -> tuple[list[dict[str, str]], list[str]]:
    """(traces that bear no witness, with the reason; the same in words)."""
    beside = (fit.burst > 0.5) & (lanes_driven(fit, observations).max(axis=2) < 0.5)
    off_lane_m = ((observations.eta > 0) & beside).sum(axis=1) * observations.spacing
    closed = np.stack([lane.p_open_middle < 1 - OCCUPIED_THRESHOLD for lane in lanes], axis=1)
    in_closed = (fit.in_lane > 0.5) & closed[None]
    somewhere_closed = in_closed.max(axis=2)
    creeping = (somewhere_closed & slow).max(axis=1)
    in_closed_m = somewhere_closed.sum(axis=1) * observations.spacing
    odd = []
    for i, name in enumerate(observations.ids):
        if fit.stray[i] > 0.5:
            reason = "follows no lane"
        elif creeping[i]:
            reason = "stands or creeps in a closed lane, as a work vehicle does"
        elif in_closed_m[i] > MIN_OFF_LANE_M:
            reason = "drives in a lane that is closed to the others"
        elif off_lane_m[i] > MIN_OFF_LANE_M:
            reason = f"is beside the lanes, or jumps, over {off_lane_m[i]:.0f} m"
        else:
            continue
        odd.append({"vehicle_id": name, "reason": reason})
    if not odd:
        return [], []
    named = "; ".join(f"{one['vehicle_id']} {one['reason']}" for one in odd[:MAX_NAMED])
    more = f"; and {len(odd) - MAX_NAMED} more" if len(odd) > MAX_NAMED else ""
    return odd, [f"{len(odd)} of {len(observations.ids)} traces bear no full witness: {named}{more}"]
