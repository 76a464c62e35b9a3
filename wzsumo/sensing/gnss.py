"""The traces that vehicles report: positions with a GNSS error, one at each sampling interval.

On each axis the error is the sum of a bias (one value for a whole trace), a first-order Gauss-Markov process and white noise.
"""

import hashlib
from typing import Self

import numpy as np
import pandas as pd
from numba import njit
from pydantic import Field, model_validator

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.spec import Spec
from wzsumo.tables import check_traces

# Shares of the variance of a single-frequency fix on a road. Under open sky they are 97, 2 and 1 % (National Research Council
# 1995, The Global Positioning System, Table C-1, without selective availability). Beside traffic and signs multipath is several
# times stronger; these three are chosen by us.
BIAS_VARIANCE_SHARE = 0.80  # changes over many minutes: ionosphere, troposphere, clock, ephemeris
CORRELATED_VARIANCE_SHARE = 0.15  # changes within a minute: multipath
WHITE_VARIANCE_SHARE = 0.05  # new in each fix: receiver noise


class GnssSpec(Spec):
    """Error of reported positions: standard deviations [m] on each of the two axes, and how often a fix is reported.

    Give either the total `error_m`, which is split by the variance shares above, or some of the three parts; a part that is
    left out is 0. error_m = 0 reports exact positions.
    """

    # total, which is split into bias, correlated and white by variance shares of 0.80, 0.15 and 0.05; or give these
    error_m: float | None = Field(None, ge=0, le=100)
    bias_sd_m: float | None = Field(None, ge=0, le=100)  # one value for a whole trace
    correlated_sd_m: float | None = Field(None, ge=0, le=100)  # first-order Gauss-Markov (Ornstein-Uhlenbeck)
    correlation_time_s: float = Field(60.0, gt=0)  # D. L. Wilson's autocorrelation of a Garmin 12XL bends at 1 min
    white_sd_m: float | None = Field(None, ge=0, le=100)  # anew at each fix
    sampling_interval_s: float = Field(0.1, ge=0.1, le=60)  # the simulation's step, as in the paper; consumer receivers: 1 s

    @model_validator(mode="after")
    def _total_or_parts(self) -> Self:
        parts = {k: v for k in ("bias_sd_m", "correlated_sd_m", "white_sd_m") if (v := getattr(self, k)) is not None}
        if (self.error_m is None) == (not parts):
            raise ValueError(
                f"give either error_m or bias_sd_m, correlated_sd_m, white_sd_m (given: error_m={self.error_m}, {parts})"
            )
        return self

    @property
    def standard_deviations_m(self) -> tuple[float, float, float]:
        """Standard deviations [m] on each axis of the bias, the correlated part and the white noise."""
        if self.error_m is not None:
            shares = [BIAS_VARIANCE_SHARE, CORRELATED_VARIANCE_SHARE, WHITE_VARIANCE_SHARE]
            bias, correlated, white = np.sqrt(shares) * self.error_m
            return float(bias), float(correlated), float(white)
        return self.bias_sd_m or 0.0, self.correlated_sd_m or 0.0, self.white_sd_m or 0.0


def report(traces: pd.DataFrame, *, spec: GnssSpec, seed: int) -> pd.DataFrame:
    """The trace table that vehicles report of their true `traces`: fewer fixes, errors in x_m and y_m, other columns exact.

    A vehicle's errors and the times of its fixes depend on the seed and its own id, not on the other vehicles. Its errors do
    not depend on the sampling interval either. Headings and speeds stay exact, because receivers get them from Doppler shifts.
    Raises TraceError where `traces` is no trace table.
    """
    table = check_traces(traces, source="traces")
    starts = np.flatnonzero(np.r_[True, table["vehicle_id"].to_numpy()[1:] != table["vehicle_id"].to_numpy()[:-1]])
    ends = np.r_[starts[1:], len(table)]
    time = table["time_s"].to_numpy(dtype=float)
    error = np.empty((len(table), 2))
    kept = np.zeros(len(table), dtype=bool)
    for start, end, vehicle_id in zip(starts, ends, table["vehicle_id"].iloc[starts], strict=True):
        random = _generator(seed, vehicle_id)
        phase = random.uniform(0, spec.sampling_interval_s)
        kept[start:end] = _at_interval(time[start:end], interval_s=spec.sampling_interval_s, phase_s=phase)
        error[start:end] = _errors(time[start:end], spec=spec, random=random)
    reported = table.assign(x_m=table["x_m"] + error[:, 0], y_m=table["y_m"] + error[:, 1])
    return reported[kept].reset_index(drop=True)


def compile_kernels() -> None:
    """Compile, or load from the cache, the kernel of this module."""
    _gauss_markov(np.zeros(2), 1.0, np.zeros((2, 2)))


def _generator(seed: int, vehicle_id: str) -> np.random.Generator:
    digest = hashlib.blake2b(f"gnss {seed} {vehicle_id}".encode(), digest_size=16).digest()
    return np.random.default_rng(int.from_bytes(digest, "little"))


def _at_interval(time: FloatArray, *, interval_s: float, phase_s: float) -> BoolArray:
    """Which of the fixes (n,) are reported: the first one of each interval, the intervals beginning at time[0] + phase_s.

    A trace that ends before the first interval begins reports its first fix.
    """
    # Times of a simulation are multiples of its step up to rounding; 1e-6 of an interval keeps a fix in the interval it begins.
    number = np.floor((time - time[0] - phase_s) / interval_s + 1e-6)
    chosen = np.r_[number[0] >= 0, np.diff(number) > 0]
    chosen[0] |= not chosen.any()
    return np.asarray(chosen)


def _errors(time: FloatArray, *, spec: GnssSpec, random: np.random.Generator) -> FloatArray:
    """Errors (n, 2) [m] on the two axes at times (n,)."""
    bias, correlated, white = spec.standard_deviations_m
    slow = _gauss_markov(time, spec.correlation_time_s, random.standard_normal((len(time), 2)))
    return np.asarray(bias * random.standard_normal(2) + correlated * slow + white * random.standard_normal((len(time), 2)))


@njit(cache=True)
def _gauss_markov(time: FloatArray, correlation_time: float, normals: FloatArray) -> FloatArray:
    """Unit-variance Gauss-Markov series (n, 2) at times (n,) from normals (n, 2), exact for any spacing."""
    out = np.empty_like(normals)
    out[0] = normals[0]
    for i in range(1, len(time)):
        rho = np.exp(-(time[i] - time[i - 1]) / correlation_time)
        out[i] = rho * out[i - 1] + np.sqrt(1.0 - rho * rho) * normals[i]
    return out
