import numpy as np
import pytest
from scipy.special import log_softmax, softmax

from wzsumo.crowd_mapping.hypotheses.lane_em import (
    LaneLikelihood,
    LanePlaces,
    LanePrior,
    covariance_of,
    expected_lanes,
    fit_lanes,
)

PRIOR = LanePrior(width=(3.6, 0.12), usual_spread=1.5, counts=np.array([3.0, 3.0, 0.5]))


def levels_in_three_lanes(n, *, spread, seed):
    random = np.random.default_rng(seed)
    levels = 1.0 + 3.6 * random.integers(3, size=n) + spread * random.standard_normal(n)
    return LaneLikelihood(levels=levels, weights=np.ones(n), fit=np.ones((n, 1, 3)), log_prior=np.zeros(1))


def fitted(seen):
    start = LanePlaces(right=1.0, width=3.6, spread=1.5, shares=np.full(3, 1 / 3))
    return fit_lanes(seen, start=start, prior=PRIOR, rounds=400)


def log_posterior(parameters, seen, spread):
    """Of right, width and the logits of the first two shares; the spread is given."""
    right, width, *logits = parameters
    shares = np.append(logits, 0.0)
    places = LanePlaces(right=right, width=width, spread=spread, shares=softmax(shares))
    of_width = -0.5 * ((width - PRIOR.width[0]) / PRIOR.width[1]) ** 2
    return expected_lanes(seen, places)[2] + of_width + PRIOR.counts @ log_softmax(shares)


def second_derivatives(function, at, step=1e-3):
    axes = step * np.eye(len(at))
    return np.array(
        [
            [function(at + a + b) - function(at + a - b) - function(at - a + b) + function(at - a - b) for b in axes]
            for a in axes
        ]
    ) / (4 * step**2)  # fmt: skip


@pytest.mark.parametrize("spread", [0.3, 1.8])
def test_covariance_is_that_of_the_posteriors_second_derivatives(spread: float) -> None:
    seen = levels_in_three_lanes(80, spread=spread, seed=2)
    fit = fitted(seen)
    shares = np.log(fit.places.shares)
    at = np.array([fit.places.right, fit.places.width, *(shares[:2] - shares[2])])
    hessian = second_derivatives(lambda x: log_posterior(x, seen, fit.places.spread), at)
    np.testing.assert_allclose(covariance_of(fit, seen, PRIOR), np.linalg.inv(-hessian)[:2, :2], rtol=0.05)


def test_lanes_that_are_told_apart_are_known_as_if_their_traces_said_so() -> None:
    seen = levels_in_three_lanes(80, spread=0.3, seed=2)
    fit = fitted(seen)
    np.testing.assert_allclose(covariance_of(fit, seen, PRIOR), np.linalg.inv(fit.precision), rtol=1e-3)


def test_lanes_that_overlap_are_known_less_well() -> None:
    seen = levels_in_three_lanes(80, spread=1.8, seed=2)
    fit = fitted(seen)
    assert covariance_of(fit, seen, PRIOR)[0, 0] > 1.5 * np.linalg.inv(fit.precision)[0, 0]
