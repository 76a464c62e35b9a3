"""The fit of traces alone: how many lanes they drove in, and where these lie."""

from dataclasses import replace
from functools import partial

import numpy as np

from wzsumo.crowd_mapping.lanes.closures import log_closing
from wzsumo.crowd_mapping.lanes.course import CoursePrior
from wzsumo.crowd_mapping.lanes.fit import LaneFit, LaneSetting, fit_lanes, log_chance_of_crowd
from wzsumo.crowd_mapping.lanes.observations import Observations, cumulated_course
from wzsumo.crowd_mapping.lanes.receivers import SCOUT_SIGMAS_M, SCOUT_TIMES_S, SCOUTS, receivers_of, some_of
from wzsumo.crowd_mapping.lanes.rival_fits import in_full, likeliest_lanes
from wzsumo.frames import FloatArray

MAX_LANES = 6
# Widths of lanes on urban interstates, freeways, principal and minor arterials, these four alike: 12 ft and more 84.8 %, 11 ft
# 8.6 %, 10 ft 5.6 %, less 1 % (FHWA, Conditions and Performance 2002, Exhibit 3-15: HPMS of 2000)
LANE_WIDTH_M, LANE_WIDTH_SD_M = 3.59, 0.18
MIN_USERS = 1.5  # of an outer lane: one trace adds no lane
LEVELS_PER_LANE = 5  # at which lanes are tried
SCOUT_ROUNDS = 3
LOG_PRIOR_PER_LANE = -2.5  # a lane more is a twelfth as likely beforehand. Chosen by us
ODD_SHARE = 0.002  # of traces that say nothing of the number of lanes: so none says more than 6 nats. Chosen by us
RIVAL = 20.0  # nats behind the likeliest, from which on no more lanes are tried
NEAR = 10.0  # nats behind the likeliest rough fit, up to which a number of lanes is fitted in full: a full fit gains some 4


def fit_lane_count(observations: Observations, *, off_lane: bool = True) -> tuple[LaneFit, FloatArray]:
    """(the likeliest fit over the numbers of lanes, probability (lanes,) that each of its lanes is there).

    Numbers of lanes NEAR the likeliest after rough fits are fitted in full, and all where none of these has users in its outer
    lanes any more. Without `off_lane` no vehicle is beside lanes.
    """
    rough = _rough_fits(some_of(observations, SCOUTS), observations, off_lane=off_lane)
    score = _with_closures(rough, observations)
    near = score > score.max() - NEAR
    fits = [in_full(fit, observations) for fit, chosen in zip(rough, near, strict=True) if chosen]
    if all(_outer_lanes_without_users(fit) for fit in fits):
        fits += [in_full(fit, observations) for fit, chosen in zip(rough, near, strict=True) if not chosen]
    return likeliest_lanes(fits, _with_closures(fits, observations))


def _with_closures(fits: list[LaneFit], observations: Observations) -> FloatArray:
    """Scores (fits,) with what possible closures add; a fit whose outer lanes lack users is out of the question."""
    closing = np.array([log_closing(fit, observations) for fit in fits])
    lacking = np.array([_outer_lanes_without_users(fit) for fit in fits])
    crowd = np.array([log_chance_of_crowd(fit, observations) for fit in fits])
    return np.asarray(scores(fits) + crowd + closing - 1e6 * lacking)


def scores(fits: list[LaneFit]) -> FloatArray:
    """Log posteriors (fits,) of fits to the same traces, with the prior of the number of lanes.

    Any trace may be of a vehicle that the model does not know, with probability ODD_SHARE, and is then as likely in each fit:
    so one trace says no more for or against a lane than -log(ODD_SHARE).
    """
    log_likelihood = np.stack([fit.log_likelihood for fit in fits])
    known = np.logaddexp(np.log(1 - ODD_SHARE) + log_likelihood, np.log(ODD_SHARE) + log_likelihood.max(axis=0))
    prior = [fit.course.log_prior + LOG_PRIOR_PER_LANE * fit.setting.n_lanes for fit in fits]
    return np.asarray(known.sum(axis=1) + prior)


def _outer_lanes_without_users(fit: LaneFit) -> int:
    """How many of the two outer lanes lack users."""
    if fit.setting.n_lanes == 1:
        return 0
    users = fit.in_lane.max(axis=1).sum(axis=0)
    least = min(MIN_USERS, 0.5 * len(fit.in_lane))
    return int(users[0] < least) + int(users[-1] < least)


def _rough_fits(scouts: Observations, observations: Observations, *, off_lane: bool) -> list[LaneFit]:
    """Rough fits to all traces: of the number of lanes that some traces make likeliest, and of its rivals about it."""
    everyone = receivers_of(observations)
    by_scouts = {fit.setting.n_lanes: fit for fit in _scouted(scouts, off_lane=off_lane)}
    of_all: dict[int, LaneFit] = {}

    def worth_it(n_lanes: int) -> bool:
        """Whether this number of lanes is not behind another by more than what a lane costs."""
        if n_lanes not in by_scouts:
            return False
        start = by_scouts[n_lanes]
        of_all[n_lanes] = fit_lanes(
            observations, start.setting, course=start.course.offset, receivers=everyone, rounds=SCOUT_ROUNDS, roughly=True
        )
        score = _with_closures(list(of_all.values()), observations)
        return bool(score[-1] >= score.max() + LOG_PRIOR_PER_LANE)

    first = list(by_scouts)[int(np.argmax(scores(list(by_scouts.values()))))]
    worth_it(first)
    for step in (1, -1):
        n_lanes = first + step
        while worth_it(n_lanes):
            n_lanes += step
    return list(of_all.values())


def _scouted(scouts: Observations, *, off_lane: bool) -> list[LaneFit]:
    """The likeliest fit to some traces for each number of lanes, as far as more lanes may help."""
    receivers = receivers_of(scouts, sigmas=SCOUT_SIGMAS_M, times=SCOUT_TIMES_S)
    best: dict[int, LaneFit] = {}

    def fitted(n_lanes: int, starts: list[FloatArray]) -> None:
        setting = replace(_setting(n_lanes, scouts), off_lane=off_lane)
        fit_roughly = partial(fit_lanes, scouts, setting, receivers=receivers, roughly=True)
        tried = [fit_roughly(course=start, rounds=0).log_posterior for start in starts]
        fit = fit_roughly(course=starts[int(np.argmax(tried))], rounds=SCOUT_ROUNDS)
        if n_lanes not in best or fit.log_posterior > best[n_lanes].log_posterior:
            best[n_lanes] = fit

    relative = cumulated_course(scouts)
    for base in (np.zeros_like(relative), relative):
        levels = _levels(scouts, base)
        for n_lanes in range(1, MAX_LANES + 1):
            fitted(n_lanes, [base + centre for centre in _candidate_centres(levels, n_lanes)])
            score = scores([best[fewer] for fewer in range(1, n_lanes + 1)])
            if score[-1] < score.max() - RIVAL:
                break
    for n_lanes in range(max(best), 1, -1):  # without one of the outer lanes
        more = best[n_lanes].course
        fitted(n_lanes - 1, [more.offset, more.offset + more.width])
    return list(best.values())


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
