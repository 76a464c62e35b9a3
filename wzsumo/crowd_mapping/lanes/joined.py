"""The lane map of traces on a known road."""

from itertools import product

import numpy as np
import pandas as pd

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.crowd_mapping.lanes.branches import find_branches
from wzsumo.crowd_mapping.lanes.closures import Closure, ClosurePrior, fit_closures, p_open_strips
from wzsumo.crowd_mapping.lanes.course import CoursePrior
from wzsumo.crowd_mapping.lanes.fit import LaneFit, LaneSetting, fit_lanes
from wzsumo.crowd_mapping.lanes.observations import Observations, observe
from wzsumo.crowd_mapping.lanes.receivers import SCOUT_SIGMAS_M, SCOUT_TIMES_S, receivers_of, scouts_of
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap, MappedLane
from wzsumo.road import Road
from wzsumo.tapers import merging_taper_m

STRIPS = 8
ROAD_SD_M = 0.1  # of a drawn road against the true one, station by station
ROAD_WEIGHT = 1 / 6  # of each station's statement, for a drawing errs slowly
ZONE_MARGIN_M = 150.0  # around the announced zone within which lanes may already be moved
STRIPED_WIDTH_SD_M = 0.03
SHIFTS_M = np.arange(-7.0, 7.1, 1.0)  # that are tried
RIVAL = 30.0  # nats behind the likeliest start, within which the road as it was is tried too
ROAD_OFF_M = 2.5  # a larger shift is the road's, not that of all receivers
EDGE_SD_M = 0.06  # of the devices or lines beside a lane: drivers as a whole are off the lanes' middles


def map_on_road(traces: pd.DataFrame, road: Road, announced: AnnouncedZone | None, *, speed_mps: float, debug: dict | None = None) -> LaneMap:
    observations = observe(traces, road)
    width = road.own_width / road.own_lanes
    setting = LaneSetting(
        n_lanes=road.own_lanes,
        base=road.lane_centre(0),
        prior=CoursePrior(
            known=_known(observations.stations, announced), width=width, width_sd=STRIPED_WIDTH_SD_M,
            spacing=observations.spacing,
        ),
    )  # fmt: skip
    fit = _best_fit(observations, setting)
    taper = merging_taper_m(speed_mps, width_m=width)
    shoulders = (road.right_shoulder / width, (0.0 if road.opposing_lanes else road.left_shoulder) / width)
    fit, closures = fit_closures(fit, observations, ClosurePrior(announced=announced, taper_m=taper, shoulders=shoulders))
    if debug is not None:
        debug.update(fit=fit, closures=closures, observations=observations)
    return lane_map_of(fit, closures, observations, traces, taper=taper)


def lane_map_of(fit: LaneFit, closures: list[Closure], observations: Observations, traces: pd.DataFrame, *, taper: float) -> LaneMap:
    n = fit.setting.n_lanes
    course, s = fit.course, observations.stations
    drawn_shift = course.shift if abs(course.shift) < ROAD_OFF_M else 0.0  # alone it is 0
    offset = course.offset - drawn_shift + fit.setting.base
    lanes = []
    for lane, closure in enumerate(closures):
        side = 1 if 2 * lane > n - 1 else -1
        middle = offset + lane * course.width
        sd = np.hypot(course.sd, EDGE_SD_M)
        lanes.append(
            MappedLane(
                right=middle - course.width / 2, left=middle + course.width / 2, right_sd=sd, left_sd=sd,
                p_open=np.clip(p_open_strips(closure, s, closing_side=side, taper_m=taper, strips=STRIPS), 0, 1),
                n_traces=int((fit.in_lane[:, :, lane].max(axis=1) > 0.5).sum()),
            )
        )
    return LaneMap(
        axis=observations.axis, stations=s, lanes=tuple(lanes),
        branches=find_branches(fit, observations, odd=np.zeros(len(observations.ids), bool), width=0.9 * course.width), n_traces=len(observations.ids),
        first_time_s=float(traces["time_s"].min()), last_time_s=float(traces["time_s"].max()),
    )  # fmt: skip


def _known(stations: FloatArray, announced: AnnouncedZone | None) -> FloatArray:
    information = np.full(len(stations), ROAD_WEIGHT / ROAD_SD_M**2)
    if announced is not None:
        inside = (stations > announced.start_m - ZONE_MARGIN_M) & (stations < announced.end_m + ZONE_MARGIN_M)
        information[inside] = 1e-6
    return information


def _best_fit(observations: Observations, setting: LaneSetting) -> LaneFit:
    """The likeliest of fits from the road's course and from a common movement of the traces, each at its likeliest shift."""
    receivers = receivers_of(observations)
    scouts = scouts_of(observations)
    scout_receivers = receivers_of(scouts, sigmas=SCOUT_SIGMAS_M, times=SCOUT_TIMES_S)
    starts = [
        (fit_lanes(scouts, setting, course=base + shift, receivers=scout_receivers, rounds=0).log_posterior, n, base + shift)
        for n, (base, shift) in enumerate(product((np.zeros(len(observations.stations)), cumulated_course(observations)), SHIFTS_M))
    ]
    likeliest = max(starts)
    fits = [fit_lanes(observations, setting, course=likeliest[2], receivers=receivers)]
    unmoved = starts[len(SHIFTS_M) // 2]
    if unmoved is not likeliest and unmoved[0] > likeliest[0] - RIVAL:
        fits.append(fit_lanes(observations, setting, course=unmoved[2], receivers=receivers))
    return max(fits, key=lambda fit: fit.log_posterior)


def cumulated_course(observations: Observations) -> FloatArray:
    """A course (stations,) [m] that follows the median step of the traces from station to station, and returns to its start."""
    offset, seen = observations.offset, observations.eta > 0
    both = seen[:, 1:] & seen[:, :-1]
    step = np.where(both, np.diff(offset, axis=1), np.nan)
    median = np.array([np.nanmedian(column) if np.isfinite(column).any() else 0.0 for column in step.T])
    course = np.r_[0.0, np.cumsum(median)]
    return course - np.linspace(0, course[-1], len(course))
