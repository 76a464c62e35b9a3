"""Fits of some of the traces, whose others keep what is known of them; and what a crowd may be like."""

from dataclasses import replace

import numpy as np
import pytest
from crowd_mapping.lanes.fits import WIDTH_M, always_in, fit_of, seen
from scipy.integrate import quad

from wzsumo.crowd_mapping.lanes.course import CoursePrior
from wzsumo.crowd_mapping.lanes.fit import LaneFit, LaneSetting, crowd_of, fit_lanes, log_chance_of_crowd
from wzsumo.crowd_mapping.lanes.lane_chain import LANE_CHANGES_PER_M
from wzsumo.crowd_mapping.lanes.observations import Observations

M = 40
PRIOR = CoursePrior(known=np.full(M, 10.0), width=WIDTH_M, width_sd=0.05, spacing=20.0)
OPEN = LaneSetting(n_lanes=2, base=0.0, prior=PRIOR)
CLOSED = replace(OPEN, closed=((1, 10, 30),))


def fitted() -> tuple[Observations, LaneFit]:
    """Twelve vehicles of which three are in lane 1, and their fit."""
    random = np.random.default_rng(1)
    level = np.r_[np.zeros(9), np.full(3, WIDTH_M)] + 0.2 * random.standard_normal(12)
    observations = seen(level[:, None] + 0.1 * random.standard_normal((12, M)))
    return observations, fit_lanes(observations, OPEN, course=np.zeros(M))


def test_traces_outside_the_mask_keep_what_the_other_fit_has_of_them() -> None:
    observations, fit = fitted()
    again = np.arange(12) >= 9
    closed = fit_lanes(observations, CLOSED, course=fit.course.offset, others=(fit, again))
    for name in ("in_lane", "position", "burst", "class_share", "changes", "log_likelihood"):
        assert np.array_equal(getattr(closed, name)[~again], getattr(fit, name)[~again]), name
    assert (closed.log_likelihood[again] < fit.log_likelihood[again] - 3).all()
    assert closed.log_posterior == pytest.approx(
        closed.log_likelihood.sum() + fit.log_posterior - fit.log_likelihood.sum(), abs=3.0
    )


def test_traces_that_a_closure_does_not_concern_say_the_same_fitted_again_or_kept() -> None:
    """Three of twelve drive where it is closed; the shares of all are those of a fit of all."""
    observations, fit = fitted()
    kept = fit_lanes(observations, CLOSED, course=fit.course.offset, others=(fit, np.arange(12) >= 9))
    whole = fit_lanes(observations, CLOSED, course=fit.course.offset)
    assert kept.in_lane == pytest.approx(whole.in_lane, abs=0.02)
    assert kept.log_likelihood == pytest.approx(whole.log_likelihood, abs=1.0)


@pytest.mark.parametrize(("first", "changes"), [((9, 3), (0, 0)), ((1, 1), (2, 5)), ((40, 60), (30, 1))])
def test_chance_of_a_crowd_is_its_likelihood_averaged_over_all_crowds(first: tuple[int, int], changes: tuple[int, int]) -> None:
    """By numerical integration over the share of the first lane and both rates of lane changes."""
    fit = fit_of(always_in([0] * first[0] + [1] * first[1], n_stations=M))
    observed = seen(np.zeros((sum(first), M)))
    fit = replace(fit, changes=np.full((sum(first), 1, 2), np.array(changes) / sum(first)))
    crowd, mean = crowd_of(fit, observed), LANE_CHANGES_PER_M
    likeliest = float((crowd.first_lanes ** np.array(first)).prod())
    averaged = quad(lambda share: share ** first[0] * (1 - share) ** first[1], 0, 1)[0]
    expected = np.log(averaged / likeliest)
    for lane, x in enumerate(changes):
        metres, rate = first[lane] * M * 20.0, float(crowd.changes_per_m[0, lane])
        relative = quad(lambda z: (z * mean / rate) ** x * np.exp(rate * metres - z * (mean * metres + 1)), 0, 60)[0]  # noqa: B023
        expected += np.log(relative)
    assert log_chance_of_crowd(fit, observed) == pytest.approx(expected, abs=1e-4)


def test_more_lanes_have_more_to_be_found_out_of_the_crowd() -> None:
    observed = seen(np.zeros((30, M)))
    chances = [log_chance_of_crowd(fit_of(always_in([0] * 30, n_stations=M, n_lanes=lanes)), observed) for lanes in (1, 2, 3)]
    assert chances[0] == 0
    assert np.diff(chances).max() < -1
