"""Thresholds of the charts, as the calibration wrote them: evidence beyond which a family of charts alarms."""

import json
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.live.charts.findings import Family

LEAST_NATS = 8.0  # charts that hardly ever speak without a change, as of traces that end, have none that a calibration shows


@dataclass(frozen=True, kw_only=True, eq=False)
class Thresholds:
    """Thresholds of each family and their standard deviations (errors,) [nats] at receivers' errors (errors,) [m].

    Beyond a threshold false alarms become rarer by e with each `mean_excess` (errors,) [nats]; at it they come at
    `rate_per_trace`.
    """

    errors: FloatArray
    threshold: dict[Family, FloatArray]
    sd: dict[Family, FloatArray]
    mean_excess: dict[Family, FloatArray]
    rate_per_trace: float

    def at(self, family: Family, error: float) -> float:
        """Threshold [nats] where receivers err by `error` [m]."""
        return max(self._read(self.threshold[family], error), LEAST_NATS)

    def false_alarms_per_trace(self, family: Family, error: float, evidence: float) -> float:
        """How often evidence as strong comes about without a change."""
        beyond = evidence - self.at(family, error)
        return float(self.rate_per_trace * np.exp(-beyond / max(self._read(self.mean_excess[family], error), 0.1)))

    def _read(self, values: FloatArray, error: float) -> float:
        return float(np.interp(np.log(max(error, 1e-3)), np.log(self.errors), values))


@lru_cache
def calibrated_thresholds() -> Thresholds:
    """The thresholds of thresholds.json (analysis/live/calibrate.py)."""
    content = json.loads(files("wzsumo.live.charts").joinpath("thresholds.json").read_text(encoding="utf-8"))
    rows = {Family(name): values for name, values in content["families"].items()}

    def column(key: str) -> dict[Family, FloatArray]:
        return {family: np.array([row[key] for row in values]) for family, values in rows.items()}

    return Thresholds(
        errors=np.array(content["receiver_errors_m"]), threshold=column("threshold"), sd=column("sd"),
        mean_excess=column("mean_excess"), rate_per_trace=content["share_per_family"],
    )  # fmt: skip
