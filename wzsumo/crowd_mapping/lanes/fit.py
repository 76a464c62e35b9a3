"""Fits of the model of lanes: expectation-maximisation over lanes driven, receivers and course."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import gammaln

from wzsumo.crowd_mapping.lanes.course import Course, CoursePrior, course_at_start, fit_course
from wzsumo.crowd_mapping.lanes.lane_chain import LANE_CHANGES_PER_M, lane_chain
from wzsumo.crowd_mapping.lanes.lane_smoothing import lane_shares, smooth_traces
from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.crowd_mapping.lanes.receivers import Receivers, first_shares, receivers_of, shares_after
from wzsumo.frames import BoolArray, FloatArray

ROUNDS = 8
LEAST_GAIN = 0.5  # of the log posterior, from which on another round is worth it
LEAST_CLASS_SHARE = 0.02  # of a class that is smoothed
LEAST_TRIED = 1e-4  # of a class that is tried again in the next round
OFF_LANE_AT_START = 0.01  # share of traces that begin beside the lanes, as on a ramp
IN_CLOSED_LANE = 0.05  # weight of being in a closed lane, at each station


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneSetting:
    """What a fit takes as given: `n_lanes` lanes; `base` [m], the nominal offset of lane 0; the prior of the course.

    `closed` are (lane, first, last station) that are held to be closed; without `off_lane` no vehicle is beside the lanes.
    """

    n_lanes: int
    base: float
    prior: CoursePrior
    closed: tuple[tuple[int, int, int], ...] = ()
    off_lane: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Crowd:
    """What traces have in common: shares of the classes of `receivers`, of the `first_lanes`, and rates of lane changes.

    `changes_per_m` (lanes - 1, 2) [1/m] are those from lane k to k + 1 and back.
    """

    receivers: FloatArray
    first_lanes: FloatArray
    changes_per_m: FloatArray

    @property
    def log_prior(self) -> float:
        """Log prior density of the rates, each exponential with a mean of LANE_CHANGES_PER_M.

        A rate that was never seen so costs the logarithm of what was driven, not every vehicle its keeping to its lane.
        """
        relative = self.changes_per_m / LANE_CHANGES_PER_M
        return float((np.log(relative) - relative + 1).sum())


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneFit:
    """What traces say, for one setting: course, shares of lanes (traces, stations, lanes), bursts (traces, stations) ..."""

    setting: LaneSetting
    course: Course
    in_lane: FloatArray
    position: FloatArray
    burst: FloatArray
    class_share: FloatArray
    changes: FloatArray  # (traces, lanes - 1, 2) expected lane changes, from lane k to k + 1 and back
    receivers: Receivers
    log_likelihood: FloatArray
    log_posterior: float

    @property
    def stray(self) -> FloatArray:
        """Probability (traces,) of following no lane."""
        return self.class_share[:, -1]

    @property
    def sigma(self) -> FloatArray:
        """Expected sd (traces,) [m] of a trace's slow error, if it follows the lanes."""
        share = self.class_share[:, :-1]
        return np.sqrt((share * self.receivers.sigma[:-1] ** 2).sum(axis=1) / np.maximum(share.sum(axis=1), 1e-12))


def fit_lanes(
    observations: Observations,
    setting: LaneSetting,
    *,
    course: FloatArray,
    receivers: Receivers | None = None,
    rounds: int = ROUNDS,
    crowd: Crowd | None = None,
    tried: BoolArray | None = None,
    roughly: bool = False,
    others: tuple[LaneFit, BoolArray] | None = None,
) -> LaneFit:
    """The fit that begins at a course (m,) [m], relative to `base`; of 0 rounds it has its likelihoods alone.

    `crowd` is what is known of it beforehand, `tried` (traces, classes) which classes of receivers may be. `roughly`,
    it is faster: see `smooth_traces`. Of `others`, a fit and a mask (traces,), traces outside the mask keep what that fit has:
    an incremental E step (Neal and Hinton 1998), where a change of the setting concerns few of them.
    """
    receivers = receivers or receivers_of(observations)
    expect = partial(_expect_some, observations, setting, receivers, others=others, roughly=roughly)
    crowd = crowd or first_crowd(setting, receivers)
    fit = expect(course_at_start(course, setting.prior), crowd, likelihood_only=rounds == 0, tried=tried)
    if rounds == 0:
        return fit
    for _ in range(rounds):
        better = expect(_maximise(observations, setting, fit), crowd_of(fit, observations), tried=fit.class_share > LEAST_TRIED)
        gain = better.log_posterior - fit.log_posterior
        fit = better if gain > 0 else fit
        if gain < LEAST_GAIN:
            break
    # The course of this fit, with its standard deviations.
    last = _maximise(observations, setting, fit)
    return replace(fit, course=replace(fit.course, sd=last.sd, shift_sd=last.shift_sd, width_sd=last.width_sd))


def fit_of_all(fit: LaneFit, fitted: Observations, observations: Observations) -> LaneFit:
    """What all traces say by the course and the crowd that a fit to some of them found: one E step."""
    if len(observations.ids) == len(fitted.ids):
        return fit
    return _expect(observations, fit.setting, receivers_of(observations), fit.course, crowd_of(fit, fitted), roughly=False)


def _expect_some(
    observations: Observations,
    setting: LaneSetting,
    receivers: Receivers,
    course: Course,
    crowd: Crowd,
    *,
    others: tuple[LaneFit, BoolArray] | None,
    tried: BoolArray | None = None,
    **how: bool,
) -> LaneFit:
    """`_expect`, of traces of a mask alone where there are `others`."""
    if others is None:
        return _expect(observations, setting, receivers, course, crowd, tried=tried, **how)
    known, again = others
    new = _expect(
        observations.of(again),
        setting,
        receivers.of(again),
        course,
        crowd,
        tried=None if tried is None else tried[again],
        **how,
    )
    by_trace = ("in_lane", "position", "burst", "class_share", "changes", "log_likelihood")
    of_traces = {name: getattr(known, name).copy() for name in by_trace}
    for name, values in of_traces.items():
        values[again] = getattr(new, name)
    log_posterior = float(of_traces["log_likelihood"].sum() + course.log_prior + crowd.log_prior)
    return replace(new, **of_traces, receivers=receivers, log_posterior=log_posterior)


def _expect(
    observations: Observations,
    setting: LaneSetting,
    receivers: Receivers,
    course: Course,
    crowd: Crowd,
    *,
    roughly: bool,
    likelihood_only: bool = False,
    tried: BoolArray | None = None,
) -> LaneFit:
    chain = lane_chain(setting.n_lanes, spacing=observations.spacing, changes_per_m=crowd.changes_per_m)
    start = np.full(len(chain.position), 1e-4)
    start[: setting.n_lanes] = crowd.first_lanes
    start[chain.burst] = OFF_LANE_AT_START * crowd.first_lanes
    start /= start.sum()
    allowed = np.ones((len(observations.stations), len(chain.position)))
    allowed[:, chain.burst] = float(setting.off_lane)
    for lane, first, last in setting.closed:
        allowed[first : last + 1, (np.rint(chain.position) == lane) & ~chain.burst] = IN_CLOSED_LANE
    smoothed = smooth_traces(
        observations, chain, receivers, level=setting.base + course.offset, width=course.width, allowed=allowed, start=start,
        class_shares=crowd.receivers, least_share=2.0 if likelihood_only else LEAST_CLASS_SHARE, tried=tried, roughly=roughly,
    )  # fmt: skip
    state_share = smoothed.state_share
    on_lanes = 1 - smoothed.class_share[:, -1]
    return LaneFit(
        setting=setting,
        course=course,
        in_lane=lane_shares(state_share, chain.position, chain.burst, setting.n_lanes),
        position=np.stack([state_share @ chain.position, state_share @ chain.position**2], axis=-1),
        burst=state_share[:, :, chain.burst].sum(axis=2),
        class_share=smoothed.class_share,
        changes=(on_lanes[:, None] * state_share.sum(axis=1))[:, chain.begun] / chain.visits,
        receivers=receivers,
        log_likelihood=smoothed.log_likelihood,
        log_posterior=float(smoothed.log_likelihood.sum() + course.log_prior + crowd.log_prior),
    )


def _maximise(observations: Observations, setting: LaneSetting, fit: LaneFit) -> Course:
    mean = fit.position[:, :, 0]
    variance = np.maximum(fit.position[:, :, 1] - mean**2, 0)
    normal = 1 - fit.burst
    weight = np.where(
        observations.eta > 0,
        observations.eta * normal * (1 - fit.stray)[:, None] / (observations.variance + fit.course.width**2 * variance),
        0.0,
    )
    usual = fit.class_share[:, :-1]
    likeliest = usual.argmax(axis=1)
    rho = fit.receivers.rho[np.arange(len(likeliest)), likeliest]
    return fit_course(
        np.where(weight > 0, observations.offset - setting.base, 0.0), weight, mean, rho=rho, sigma=fit.sigma,
        prior=setting.prior, start=fit.course.offset,
    )  # fmt: skip


def first_crowd(setting: LaneSetting, receivers: Receivers) -> Crowd:
    """What is known of a crowd before its traces are."""
    n = setting.n_lanes
    return Crowd(
        receivers=first_shares(receivers), first_lanes=np.full(n, 1 / n), changes_per_m=np.full((n - 1, 2), LANE_CHANGES_PER_M)
    )


def crowd_of(fit: LaneFit, observations: Observations) -> Crowd:
    """What the traces of a fit have in common: with one vehicle more in each first lane, and one change more in each lane."""
    first, changes, exposure = _counts(fit, observations)
    return Crowd(
        receivers=shares_after(fit.class_share),
        first_lanes=(1 + first) / (1 + first).sum(),
        changes_per_m=(1 + changes) / (1 / LANE_CHANGES_PER_M + exposure),
    )


def log_chance_of_crowd(fit: LaneFit, observations: Observations) -> float:
    """Log of the likelihood of a fit averaged over what the crowd may be like, relative to that by its likeliest crowd.

    Shares of first lanes are alike likely beforehand, rates of changes exponential with mean LANE_CHANGES_PER_M: so both
    averages are closed forms of the expected counts. The more lanes, the more has to be found out of the crowd.
    """
    first, changes, exposure = _counts(fit, observations)
    n, lanes = first.sum(), len(first)
    shares = gammaln(lanes) - gammaln(n + lanes) + (gammaln(first + 1) - first * np.log((first + 1) / (n + lanes))).sum()
    known = 1 / (1 + LANE_CHANGES_PER_M * exposure)  # share of what is known of a rate that was known beforehand
    rates = np.log(known) + gammaln(changes + 1) - changes * np.log(changes + 1) + (changes + 1) * (1 - known)
    return float(shares + rates.sum())


def _counts(fit: LaneFit, observations: Observations) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(vehicles that begin in each lane (lanes,), lane changes (lanes - 1, 2), metres driven where these may begin)."""
    on_lanes = (1 - fit.stray)[:, None]
    seen = fit.in_lane.sum(axis=2) > 0.1
    first = np.where(seen.any(axis=1), seen.argmax(axis=1), 0)
    begun = fit.in_lane[np.arange(len(first)), first] * on_lanes
    driven = (fit.in_lane.sum(axis=1) * on_lanes).sum(axis=0) * observations.spacing
    return begun.sum(axis=0), fit.changes.sum(axis=0), np.stack([driven[:-1], driven[1:]], axis=1)
