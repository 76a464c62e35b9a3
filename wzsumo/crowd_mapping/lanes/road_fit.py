"""The fit of traces to a known road: its lanes bind, but for one shift of all positions and for lanes that the work moved."""

from functools import partial
from itertools import product

import numpy as np

from wzsumo.crowd_mapping.lanes.course import CoursePrior
from wzsumo.crowd_mapping.lanes.fit import LaneFit, LaneSetting, fit_lanes
from wzsumo.crowd_mapping.lanes.observations import Observations, cumulated_course
from wzsumo.crowd_mapping.lanes.receivers import SCOUT_SIGMAS_M, SCOUT_TIMES_S, SCOUTS, receivers_of, some_of
from wzsumo.crowd_mapping.lanes.rival_fits import explanations, in_full, likeliest_lanes
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.frames import FloatArray

ROAD_SD_M = 0.1  # of a drawn road against the true one: lane lines are surveyed to some centimetres
ROAD_WEIGHT = 1 / 6  # of each station's statement, since a drawing errs over hundreds of metres alike
ZONE_MARGIN_SDS = 3.0  # of the announced ends, around the zone within which lanes may already be moved
ZONE_WEIGHT = 0.1  # of the road's statement there: most zones move no open lane. Chosen by us
STRIPED_WIDTH_SD_M = 0.03
SHIFTS_M = np.arange(-7.0, 7.1, 1.0)  # of all positions, from which a fit is tried
RIVAL = 30.0  # nats behind the likeliest start, within which another is tried too
TRIED, ROUGH_ROUNDS = 4, 3  # starts, the likeliest, that are fitted roughly to all traces
FITTED = 2  # explanations, the likeliest after rough fits, that are fitted in full


def fit_to_road(observations: Observations, before: MapBefore, *, off_lane: bool = True) -> tuple[LaneFit, FloatArray]:
    """(the likeliest fit to the lanes of a road, probability (lanes,) that each of its lanes is there).

    Fits begin with the road's course or with a common movement of the traces, each at some shift. Where all traces drive in one
    lane, a fit that lies a lane aside is a rival: a lane that it has not is there by the probability of the others.
    """
    setting = LaneSetting(
        n_lanes=before.road.own_lanes,
        base=before.road.lane_centre(0),
        prior=CoursePrior(
            known=_known(observations.stations, before), width=before.lane_width, width_sd=STRIPED_WIDTH_SD_M,
            spacing=observations.spacing,
        ),
        off_lane=off_lane,
    )  # fmt: skip
    scouts = some_of(observations, SCOUTS)
    scout_receivers = receivers_of(scouts, sigmas=SCOUT_SIGMAS_M, times=SCOUT_TIMES_S)
    courses = [np.zeros(len(observations.stations)), cumulated_course(observations)]
    starts = [course + shift for course, shift in product(courses, SHIFTS_M)]
    scouted = partial(fit_lanes, scouts, setting, receivers=scout_receivers, rounds=0, roughly=True)
    tried = np.array([scouted(course=start).log_posterior for start in starts]).reshape(len(courses), -1)
    roughly = partial(fit_lanes, observations, setting, receivers=receivers_of(observations), rounds=ROUGH_ROUNDS, roughly=True)
    rough = explanations([roughly(course=starts[i]) for i in _worth_fitting(tried)])
    likely = [fit for fit in rough[:FITTED] if fit.log_posterior > rough[0].log_posterior - RIVAL]
    fits = [in_full(fit, observations) for fit in likely]
    return likeliest_lanes(fits, np.array([fit.log_posterior for fit in fits]))


def _worth_fitting(tried: FloatArray) -> list[int]:
    """Indices of starts: where the log posterior `tried` (courses, shifts) has peaks over the shifts, the likeliest first."""
    beside = np.pad(tried, ((0, 0), (1, 1)), constant_values=-np.inf)
    peak = (tried >= np.maximum(beside[:, :-2], beside[:, 2:])) & (tried > tried.max() - RIVAL)
    order = np.argsort(-tried, axis=None, kind="stable")
    return [int(i) for i in order if peak.flat[i]][:TRIED]


def _known(stations: FloatArray, before: MapBefore) -> FloatArray:
    """Information (stations,) [1/m^2] that the lanes lie where the road has them; less in the announced zone."""
    information = np.full(len(stations), ROAD_WEIGHT / ROAD_SD_M**2)
    if before.announced is not None:
        zone = before.announced
        start, end = zone.start_m - ZONE_MARGIN_SDS * zone.start_sd_m, zone.end_m + ZONE_MARGIN_SDS * zone.end_sd_m
        information[(stations > start) & (stations < end)] *= ZONE_WEIGHT
    return information
