"""The lane map of a trace table: joined to the road before the zone, or of the traces alone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from wzsumo.crowd_mapping.cleaning.station_table import percentile_85_speed
from wzsumo.crowd_mapping.lanes.branches import find_branches
from wzsumo.crowd_mapping.lanes.closures import Closure, ClosurePrior, fit_closures, p_open_strips, slow_stretches
from wzsumo.crowd_mapping.lanes.doubts import said_of_count, said_of_explained, said_of_lanes, said_of_shift, said_of_traces
from wzsumo.crowd_mapping.lanes.fit import LaneFit, fit_of_all
from wzsumo.crowd_mapping.lanes.lane_count import fit_lane_count
from wzsumo.crowd_mapping.lanes.observations import Observations, observe
from wzsumo.crowd_mapping.lanes.receivers import some_of
from wzsumo.crowd_mapping.lanes.road_fit import fit_to_road
from wzsumo.crowd_mapping.lanes.witnesses import open_where_driven, share_of_fixes
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.crowd_mapping.reference_line import reference_line_from_traces
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap, MappedLane
from wzsumo.tapers import merging_taper_m

STRIPS = 8  # across a lane
FITTED_TRACES = 400  # that lanes are fitted to
EDGE_SD_M = 0.06  # of an edge, however many traces there are: drivers as a whole are off the lanes' middles. Chosen by us
LEAST_EXPLAINED = 0.5  # share of the drives that lanes have to explain; else they are laid where vehicles drove
ROAD_OFF_M = 2.5  # a larger common shift is the road's, not the receivers': their ionosphere and clocks give 2 m at most
BRANCH_WIDTH_SHARE = 0.9  # of a lane's width that is free around the middle of the traces of a branch


@dataclass(frozen=True, kw_only=True, eq=False)
class MappedLanes:
    """The lane map of some traces, and figures about it, units in the names."""

    lanes: LaneMap
    figures: dict[str, Any]
    removed_shift_m: float  # the common error of all positions, which the lanes are free of


def map_lanes(
    traces: pd.DataFrame, *, before: MapBefore | None = None, tell: Callable[[float], None] = lambda _share: None
) -> MappedLanes:
    """The lane map of usable traces (sorted by vehicle and time).

    `before` is the road before the zone and where the zone is announced, where that is known. No random numbers are drawn: the
    same traces give the same map. `tell` is called with the share of the work that is done, of a hundred traces. Raises
    TraceError where no trace is long enough to show a road.
    """
    axis = before.road if before else reference_line_from_traces(traces)
    observations = observe(traces, axis)
    tell(0.05)
    fit, there, unexplained = _fit(observations, before)
    tell(0.7)
    prior = _closure_prior(traces, before, width=fit.course.width)
    fit, closures = fit_closures(fit, observations, prior)
    tell(1.0)
    slow = slow_stretches(observations)
    removed = fit.course.shift if before and abs(fit.course.shift) < ROAD_OFF_M else 0.0
    lanes = _mapped_lanes(fit, there, closures, observations, removed_shift=removed, taper_m=prior.taper_m)
    lanes, overruled = open_where_driven(lanes, fit, observations, slow=slow)
    branches = find_branches(fit, observations, slow=slow, removed_shift=removed, width=BRANCH_WIDTH_SHARE * fit.course.width)
    on_free, on_occupied = share_of_fixes(lanes, fit, observations)
    odd, odd_words = said_of_traces(fit, observations, slow=slow, lanes=lanes)
    warnings = (
        *(said_of_shift(fit.course, has_road=before is not None, removed=removed)),
        *overruled,
        *unexplained,
        *said_of_count(there),
        *said_of_lanes(lanes, fit, observations, branches=branches),
        *odd_words,
    )
    lane_map = LaneMap(
        axis=axis, stations=observations.stations, lanes=lanes, branches=branches, n_traces=len(observations.ids),
        first_time_s=float(traces["time_s"].min()), last_time_s=float(traces["time_s"].max()), warnings=warnings,
    )  # fmt: skip
    figures = {
        "open_lanes": sum(bool((lane.p_open_middle > 0.5).all()) for lane in lanes),
        "lanes": len(lanes),
        "lane_width_m": fit.course.width,
        "lane_width_sd_m": fit.course.width_sd,
        "common_shift_m": fit.course.shift if before else None,
        "common_shift_sd_m": fit.course.shift_sd if before else None,
        "receiver_error_m": float(np.median(fit.sigma)),
        "p_closed": [of_lane[0].p_closed for of_lane in closures],
        "fixes_on_free_share": on_free,
        "fixes_on_occupied_share": on_occupied,
        "odd_traces": odd,
        "branches": len(branches),
        "warnings": list(warnings),
    }
    return MappedLanes(lanes=lane_map, figures=figures, removed_shift_m=removed)


def _fit(observations: Observations, before: MapBefore | None) -> tuple[LaneFit, FloatArray, list[str]]:
    """(fit, probability (lanes,) that each lane is there, what is said where lanes do not explain the drives).

    The lanes are fitted to FITTED_TRACES at most, which tell their course to some 6 cm; the others are placed in them. Where
    lanes explain too little, as of one vehicle on a winding street, all drives are held to be in lanes: these then lie
    where vehicles drove.
    """
    fitted = some_of(observations, FITTED_TRACES)
    fit, there = _fit_lanes(fitted, before, off_lane=True)
    said: list[str] = []
    driven = fitted.eta > 0
    explained = float(((1 - fit.burst) * (1 - fit.stray)[:, None])[driven].mean()) if driven.any() else 0.0
    if explained < LEAST_EXPLAINED:
        fit, there = _fit_lanes(fitted, before, off_lane=False)
        if before is None:  # nothing but the receivers tells where such lanes lie; half a lane off, nobody knows
            there = there * (1 + ((fit.sigma < fit.course.width / 2) & (fit.stray < 0.5)).mean()) / 2
        said = said_of_explained(explained)
    return fit_of_all(fit, fitted, observations), there, said


def _fit_lanes(observations: Observations, before: MapBefore | None, *, off_lane: bool) -> tuple[LaneFit, FloatArray]:
    if before is None:
        return fit_lane_count(observations, off_lane=off_lane)
    return fit_to_road(observations, before, off_lane=off_lane)


def _closure_prior(traces: pd.DataFrame, before: MapBefore | None, *, width: float) -> ClosurePrior:
    announced = before.announced if before else None
    speed = announced.speed_mps if announced and announced.speed_mps else percentile_85_speed(traces)
    shoulders = (0.0, 0.0)
    if before:
        left = 0.0 if before.road.opposing_lanes else before.road.left_shoulder
        shoulders = (before.road.right_shoulder / width, left / width)
    return ClosurePrior(announced=announced, taper_m=merging_taper_m(speed, width_m=width), shoulders=shoulders)


def _mapped_lanes(
    fit: LaneFit,
    there: FloatArray,
    closures: list[list[Closure]],
    observations: Observations,
    *,
    removed_shift: float,
    taper_m: float,
) -> tuple[MappedLane, ...]:
    course, n_lanes = fit.course, fit.setting.n_lanes
    middle = course.offset - removed_shift + fit.setting.base
    edges = [middle + (lane - 0.5) * course.width for lane in range(n_lanes + 1)]
    centre = (n_lanes - 1) / 2
    sds = [np.sqrt(course.sd**2 + EDGE_SD_M**2 + ((lane - 0.5 - centre) * course.width_sd) ** 2) for lane in range(n_lanes + 1)]
    return tuple(
        MappedLane(
            right=edges[lane], left=edges[lane + 1], right_sd=sds[lane], left_sd=sds[lane + 1],
            p_open=there[lane] * p_open_strips(
                of_lane, observations.stations, outer_left=2 * lane > n_lanes - 1, taper_m=taper_m, strips=STRIPS
            ),
            n_traces=int((fit.in_lane[:, :, lane].max(axis=1) > 0.5).sum()),
        )
        for lane, of_lane in enumerate(closures)
    )  # fmt: skip
