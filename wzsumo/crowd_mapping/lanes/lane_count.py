"""The fit of traces alone: how many lanes they drove in, and where these lie."""

from itertools import pairwise

import numpy as np

from wzsumo.crowd_mapping.lanes.course import CoursePrior
from wzsumo.crowd_mapping.lanes.fit import LaneFit, LaneSetting, fit_lanes
from wzsumo.crowd_mapping.lanes.observations import Observations, cumulated_course
from wzsumo.crowd_mapping.lanes.receivers import SCOUT_SIGMAS_M, SCOUT_TIMES_S, receivers_of, scouts_of
from wzsumo.crowd_mapping.lanes.witnesses import misplaced_share
from wzsumo.frames import FloatArray

MAX_LANES = 6
LANE_WIDTH_M, LANE_WIDTH_SD_M = 3.6, 0.12  # 12 ft on freeways (AASHTO Green Book), down to 10 in zones (MUTCD 6G)
MIN_USERS = 1.5  # of an outer lane: one trace adds no lane
LEVELS_PER_LANE = 5  # at which lanes are tried
SCOUT_ROUNDS = 3
LOG_PRIOR_PER_LANE = -3.0  # a lane must be worth some two good witnesses. Chosen by us
MISPLACED_GAIN = 1.5  # nats: measured on crowds of mixed receivers of our generator, where lanes too many gain 1 a trace
HOPELESS, RIVAL = 60.0, 20.0  # nats behind the likeliest: no more lanes are tried; a fit to all traces is made


def fit_lane_count(observations: Observations) -> LaneFit:
    """The likeliest fit over the numbers of lanes.

    Each further lane must be worth LOG_PRIOR_PER_LANE, and more where receivers are poor: a trace that is misplaced by half a
    lane with one lane fewer gains some MISPLACED_GAIN from a lane of its own, though there is none.
    """
    fits = sorted(_rival_fits(observations), key=lambda fit: fit.setting.n_lanes)
    best, best_score, price = fits[0], score(fits[0]), 0.0
    for fewer, fit in pairwise(fits):
        price += MISPLACED_GAIN * 2 * misplaced_share(fewer) * len(observations.ids)
        if score(fit) - price > best_score:
            best, best_score = fit, score(fit) - price
    return best


def score(fit: LaneFit) -> float:
    """Log posterior with the prior of the number of lanes; a fit whose outer lanes lack users is out of the question."""
    users = fit.in_lane.max(axis=1).sum(axis=0)
    least = min(MIN_USERS, 0.5 * len(fit.in_lane))
    lacking = int(users[0] < least) + int(users[-1] < least) if fit.setting.n_lanes > 1 else 0
    return float(fit.log_posterior + LOG_PRIOR_PER_LANE * fit.setting.n_lanes - 1e6 * lacking)


def _rival_fits(observations: Observations) -> list[LaneFit]:
    """Fits to all traces, with the numbers of lanes that some traces make likely."""
    scouts = scouts_of(observations)
    receivers = receivers_of(scouts, sigmas=SCOUT_SIGMAS_M, times=SCOUT_TIMES_S)
    everyone = receivers_of(observations)
    relative = cumulated_course(observations)
    best: dict[int, tuple[float, LaneFit]] = {}
    for base in (np.zeros_like(relative), relative):
        levels = _levels(scouts, base)
        for n_lanes in range(1, MAX_LANES + 1):
            setting = _setting(n_lanes, observations)
            tried = [
                (fit_lanes(scouts, setting, course=base + c, receivers=receivers, rounds=0).log_posterior, base + c)
                for c in _candidate_centres(levels, n_lanes)
            ]
            fit = fit_lanes(
                scouts, setting, course=max(tried, key=lambda pair: pair[0])[1], receivers=receivers, rounds=SCOUT_ROUNDS
            )
            if n_lanes not in best or fit.log_posterior > best[n_lanes][0]:
                best[n_lanes] = (fit.log_posterior, fit)
            if score(fit) < max(score(one) for _, one in best.values()) - HOPELESS:
                break
    likeliest = max(score(fit) for _, fit in best.values())
    starts = [fit for _, fit in best.values() if score(fit) > likeliest - RIVAL]
    return [fit_lanes(observations, fit.setting, course=fit.course.offset, receivers=everyone) for fit in starts]


def _setting(n_lanes: int, observations: Observations) -> LaneSetting:
    prior = CoursePrior(
        known=np.full(len(observations.stations), 1e-9), width=LANE_WIDTH_M, width_sd=LANE_WIDTH_SD_M,
        spacing=observations.spacing,
    )  # fmt: skip
    return LaneSetting(n_lanes=n_lanes, base=0.0, prior=prior)


def _levels(observations: Observations, base: FloatArray) -> FloatArray:
    """Median offset of each trace from a course."""
    seen = observations.eta > 0
    return np.array([np.median((y - base)[ok]) for y, ok in zip(observations.offset, seen, strict=True) if ok.any()])


def _candidate_centres(levels: FloatArray, n_lanes: int) -> FloatArray:
    """Offsets of lane 0 so that the lanes cover most traces."""
    low, high = np.quantile(levels, [0.05, 0.95])
    span = (n_lanes - 1) * LANE_WIDTH_M
    first, last = min(low, high - span), max(low, high - span)
    step = LANE_WIDTH_M / LEVELS_PER_LANE
    return np.arange(first - step, last + 1.01 * step, step)
