"""Classes of receivers: their shares in a crowd, and what a receiver states of its own error."""

from dataclasses import replace

import numpy as np
import pytest
from crowd_mapping.lanes.fits import seen

from wzsumo.crowd_mapping.lanes.receivers import (
    PSEUDOCOUNT,
    STATED_FACTOR,
    STRAY_SHARE,
    Receivers,
    first_shares,
    receivers_of,
    shares_after,
)


def test_shares_of_classes_before_any_trace_sum_to_one_and_hold_few_strays() -> None:
    shares = first_shares(receivers_of(seen(np.zeros((2, 10)))))
    assert shares.sum() == pytest.approx(1.0)
    assert shares[-1] == STRAY_SHARE


def test_crowd_of_good_receivers_leaves_a_poor_one_its_share_of_the_pseudocount() -> None:
    receivers = receivers_of(seen(np.zeros((2, 10))))
    n = receivers.stray
    of_one_class = np.eye(n + 1)[np.zeros(30, dtype=int)]
    shares = shares_after(of_one_class)
    assert shares[n - 1] == pytest.approx(PSEUDOCOUNT / (n + 1) / (30 + n * PSEUDOCOUNT / (n + 1) + STRAY_SHARE), rel=1e-6)
    assert shares.argmax() == 0


def test_correlation_between_stations_is_that_of_time_at_the_traces_speed() -> None:
    observations = seen(np.zeros((1, 10)))
    receivers = receivers_of(observations, sigmas=(1.0,), times=(30.0,))
    assert receivers.rho[0, 0] == pytest.approx(np.exp(-observations.spacing / (20.0 * 30.0)))


def test_receiver_that_states_no_error_has_the_shares_of_the_crowd() -> None:
    receivers = receivers_of(seen(np.zeros((2, 10))))
    assert np.exp(receivers.log_shares(first_shares(receivers))) == pytest.approx(np.tile(first_shares(receivers), (2, 1)))


@pytest.mark.parametrize("stated", [0.5, 1.2, 3.0])
def test_stated_error_weighs_classes_by_a_normal_density_of_the_logarithm(stated: float) -> None:
    sigma = np.array([0.3, 1.0, 3.0, 8.0])
    receivers = Receivers(sigma=sigma, rho=np.full((1, 4), 0.9), stated=np.array([stated]))
    shares = np.exp(receivers.log_shares(np.array([0.3, 0.4, 0.2, 0.1])))[0]
    odds = shares[1] / shares[0] * 0.3 / 0.4
    spread = np.log(STATED_FACTOR)
    expected = np.exp((np.log(0.3 / stated) ** 2 - np.log(1.0 / stated) ** 2) / (2 * spread**2))
    assert odds == pytest.approx(expected)
    assert shares.sum() == pytest.approx(1.0)


def test_error_stated_as_nought_counts_as_that_of_the_best_class() -> None:
    observations = replace(seen(np.zeros((2, 10))), stated_sd=np.array([0.0, 0.3]))
    receivers = receivers_of(observations)
    one, other = receivers.log_shares(first_shares(receivers))
    assert np.isfinite(one).all()
    assert one == pytest.approx(other)
