"""Fits of the model of lanes that explain the same traces: the likeliest, and how sure each of its lanes is."""

import numpy as np

from wzsumo.crowd_mapping.lanes.fit import LEAST_TRIED, LaneFit, crowd_of, fit_lanes
from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.frames import FloatArray


def in_full(rough: LaneFit, observations: Observations) -> LaneFit:
    """The fit that begins where a rough one ended."""
    return fit_lanes(
        observations, rough.setting, course=rough.course.offset, receivers=rough.receivers, crowd=crowd_of(rough, observations),
        tried=rough.class_share > LEAST_TRIED,
    )  # fmt: skip


def explanations(fits: list[LaneFit]) -> list[LaneFit]:
    """The fits, the likeliest first, without those whose lanes lie where a likelier one has them: they explain alike."""
    found: list[LaneFit] = []
    for fit in sorted(fits, key=lambda one: -one.log_posterior):
        if not any(_same_lanes(fit, other) for other in found):
            found.append(fit)
    return found


def likeliest_lanes(fits: list[LaneFit], log_posterior: FloatArray) -> tuple[LaneFit, FloatArray]:
    """(the likeliest of fits, probability (lanes,) that each of its lanes is there).

    A lane is there by the probability of the fits that have one in its place. Fits that ended in the same lanes count once.
    """
    best = int(np.argmax(log_posterior))
    rivals = [i for i, fit in enumerate(fits) if i != best and not _same_lanes(fit, fits[best])]
    p = np.exp(log_posterior[[best, *rivals]] - log_posterior[best])
    has = np.array([_has_lanes_of(fits[best], fits[i]) for i in (best, *rivals)])
    return fits[best], np.minimum(p @ has / p.sum(), 1.0)


def _same_lanes(fit: LaneFit, other: LaneFit) -> bool:
    return fit.setting.n_lanes == other.setting.n_lanes and bool(_has_lanes_of(fit, other).all())


def _has_lanes_of(fit: LaneFit, other: LaneFit) -> FloatArray:
    """1 for each lane (lanes,) of `fit` in whose place `other` has one, else 0."""
    middles = [one.course.offset[:, None] + one.course.width * np.arange(one.setting.n_lanes) for one in (fit, other)]
    apart = np.median(np.abs(middles[0][:, :, None] - middles[1][:, None, :]), axis=0)
    return np.where(apart.min(axis=1) < fit.course.width / 2, 1.0, 0.0)
