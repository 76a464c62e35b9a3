"""The fit of traces to a known road: its lanes bind, but for one shift of all positions and for lanes that the work moved."""

from functools import partial
from itertools import product

import numpy as np

from wzsumo.crowd_mapping.lanes.course import CoursePrior
from wzsumo.crowd_mapping.lanes.fit import LaneFit, LaneSetting, fit_lanes
from wzsumo.crowd_mapping.lanes.observations import Observations, cumulated_course
from wzsumo.crowd_mapping.lanes.receivers import SCOUT_SIGMAS_M, SCOUT_TIMES_S, receivers_of, scouts_of
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.frames import FloatArray

ROAD_SD_M = 0.1  # of a drawn road against the true one: lane lines are surveyed to some centimetres
ROAD_WEIGHT = 1 / 6  # of each station's statement, since a drawing errs over hundreds of metres alike
ZONE_MARGIN_SDS = 3.0  # of the announced ends, around the zone within which lanes may already be moved
ZONE_WEIGHT = 0.1  # of the road's statement there: most zones move no open lane. Chosen by us
STRIPED_WIDTH_SD_M = 0.03
SHIFTS_M = np.arange(-7.0, 7.1, 1.0)  # of all positions, from which a fit is tried
RIVAL = 30.0  # nats behind the likeliest start, within which the road as it was is tried too


def fit_to_road(observations: Observations, before: MapBefore, *, off_lane: bool = True) -> LaneFit:
    """The likeliest of fits that begin with the road's course or with a common movement of the traces, each at some shift."""
    setting = LaneSetting(
        n_lanes=before.road.own_lanes,
        base=before.road.lane_centre(0),
        prior=CoursePrior(
            known=_known(observations.stations, before), width=before.lane_width, width_sd=STRIPED_WIDTH_SD_M,
            spacing=observations.spacing,
        ),
        off_lane=off_lane,
    )  # fmt: skip
    scouts = scouts_of(observations)
    scout_receivers = receivers_of(scouts, sigmas=SCOUT_SIGMAS_M, times=SCOUT_TIMES_S)
    courses = [np.zeros(len(observations.stations)), cumulated_course(observations)]
    starts = [course + shift for course, shift in product(courses, SHIFTS_M)]
    scouted = partial(fit_lanes, scouts, setting, receivers=scout_receivers, rounds=0, roughly=True)
    tried = [scouted(course=start).log_posterior for start in starts]
    likeliest, unmoved = int(np.argmax(tried)), len(SHIFTS_M) // 2
    chosen = {likeliest, unmoved} if tried[unmoved] > tried[likeliest] - RIVAL else {likeliest}
    receivers = receivers_of(observations)
    fits = [fit_lanes(observations, setting, course=starts[i], receivers=receivers) for i in sorted(chosen)]
    return max(fits, key=lambda fit: fit.log_posterior)


def _known(stations: FloatArray, before: MapBefore) -> FloatArray:
    """Information (stations,) [1/m^2] that the lanes lie where the road has them; less in the announced zone."""
    information = np.full(len(stations), ROAD_WEIGHT / ROAD_SD_M**2)
    if before.announced is not None:
        zone = before.announced
        start, end = zone.start_m - ZONE_MARGIN_SDS * zone.start_sd_m, zone.end_m + ZONE_MARGIN_SDS * zone.end_sd_m
        information[(stations > start) & (stations < end)] *= ZONE_WEIGHT
    return information
