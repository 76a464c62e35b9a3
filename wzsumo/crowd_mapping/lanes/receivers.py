"""Receivers: classes of how a trace's position errs, from centimetres to metres, and one for vehicles that follow no lane."""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.frames import BoolArray, FloatArray

SIGMAS_M = (0.3, 0.6, 1.0, 1.7, 2.8, 4.5)  # a driver's habit alone; RTK or map-matched; good, usual, poor receivers in cars
TIMES_S = (30.0, 200.0, 2000.0)  # over which errors are correlated: multipath; ionosphere; antenna, mounting: a whole drive
STRAY_SIGMA_M, STRAY_TIME_S = 8.0, 200.0  # a vehicle that keeps to no lane: anywhere on the road
STRAY_SHARE = 0.02
PSEUDOCOUNT = 5.0  # traces' worth of equal shares: a crowd of good receivers so far may have a poor one yet
STATED_FACTOR = 2.0  # by which a receiver misjudges its own error. Chosen by us
SCOUTS = 20  # traces on which a fit is tried
SCOUT_SIGMAS_M, SCOUT_TIMES_S = (0.4, 1.0, 2.0, 4.0), (60.0,)


@dataclass(frozen=True, kw_only=True, eq=False)
class Receivers:
    """`sigma` (classes,) [m], and the correlation `rho` (traces, classes) between stations; the last class is the stray.

    `stated` (traces,) [m] is the error that a trace's receiver states of itself, NaN where it states none.
    """

    sigma: FloatArray
    rho: FloatArray
    stated: FloatArray

    def of(self, chosen: BoolArray) -> "Receivers":
        """The classes for some of the traces."""
        return replace(self, rho=self.rho[chosen], stated=self.stated[chosen])

    @property
    def stray(self) -> int:
        """Number of the stray class."""
        return len(self.sigma) - 1

    def log_shares(self, shares: FloatArray) -> FloatArray:
        """Log of the shares (traces, classes) of the classes for each trace, given those of the crowd (classes,).

        What a receiver states of its error is right but for a factor, STATED_FACTOR or its inverse being one sd.
        """
        known = np.isfinite(self.stated)
        gap = np.log(self.sigma[:-1]) - np.log(np.maximum(np.where(known, self.stated, 1.0), self.sigma[0]))[:, None]
        log = np.tile(np.log(shares), (len(self.stated), 1))
        log[known, :-1] -= 0.5 * (gap[known] / np.log(STATED_FACTOR)) ** 2
        return np.asarray(log - np.logaddexp.reduce(log, axis=1, keepdims=True))


def receivers_of(
    observations: Observations, *, sigmas: tuple[float, ...] = SIGMAS_M, times: tuple[float, ...] = TIMES_S
) -> Receivers:
    """The classes for some traces."""
    pairs = [(sigma, time) for sigma in sigmas for time in times] + [(STRAY_SIGMA_M, STRAY_TIME_S)]
    sigma, time = np.array(pairs).T
    rho = np.exp(-observations.spacing / (np.maximum(observations.speed, 3.0)[:, None] * time))
    return Receivers(sigma=sigma, rho=rho, stated=observations.stated_sd)


def first_shares(receivers: Receivers) -> FloatArray:
    """Shares (classes,) before anything is known."""
    n = receivers.stray
    return np.r_[np.full(n, (1 - STRAY_SHARE) / n), STRAY_SHARE]


def shares_after(class_share: FloatArray) -> FloatArray:
    """Shares (classes,) given those of the traces (traces, classes)."""
    counts = class_share.sum(axis=0) + PSEUDOCOUNT / class_share.shape[1]
    counts[-1] = class_share[:, -1].sum() + STRAY_SHARE
    shares = counts / counts.sum()
    shares[-1] = min(shares[-1], 0.3)
    return np.asarray(shares / shares.sum())


def some_of(observations: Observations, most: int) -> Observations:
    """At most so many of the traces, spread evenly over their places across the road: some of each lane."""
    n = len(observations.ids)
    if n <= most:
        return observations
    seen = observations.eta > 0
    place = np.array([np.median(y[ok]) if ok.any() else 0.0 for y, ok in zip(observations.offset, seen, strict=True)])
    chosen = np.sort(np.argsort(place, kind="stable")[np.linspace(0, n - 1, most).astype(int)])
    return observations.of(chosen)
