"""LaneLevels: how many lanes stay open, which of them each trace drove in, how wide they are, and which are closed where."""

from dataclasses import dataclass

import numpy as np

from wzsumo.crowd_mapping.course.common_path import CommonPath
from wzsumo.crowd_mapping.course.station_table import STATION_SPACING_M
from wzsumo.crowd_mapping.hypotheses.change_costs import Evidence
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_hypotheses import LaneHypothesis, fit_again, likely_hypotheses
from wzsumo.frames import FloatArray

NARROWING_SD_M = 0.08  # of the lanes' width at the core against that before: one foot in a few zones
# GNSS errors that drift by 1 cm in 10 m (0.4 s) stay off by some 20 cm: wzsumo.sensing.gnss, whose shares are sourced there.
SPREAD_PER_DRIFT = 20.0
MOST_HYPOTHESES, LEAST_CHANCE = 5, 0.02  # that are kept
WANDER_M = 0.03  # drift in 10 m of drivers without any GNSS error (SUMO, lcSigma of 0.08)
HABIT_M = 0.25  # between drivers: 0.2 to 0.4 m in naturalistic studies


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneLevels:
    """Lanes 0 (rightmost) .. n_lanes - 1 are open all along, but for `interior` ones.

    Lane k's centre is at course + right + k width. Lanes `closed` beside them, below 0 or from n_lanes on, and `interior` ones
    among them are closed from station `closes` to `opens` (indices; as many as there are stations where they do not open
    again). `lanes` (traces, stations) are the traces' lanes in this count. `spread` [m] is the standard deviation of the
    traces' levels about their lanes: GNSS bias and driver habit together.
    """

    n_lanes: int
    closed: tuple[int, ...]
    interior: tuple[int, ...]
    closes: int
    opens: int
    right: float
    width: float
    covariance: FloatArray  # (2, 2) [m^2] of right and width
    outer_width: float  # of the lanes beside the open ones
    outer_width_sd: float
    spread: float
    lanes: FloatArray
    hypothesis: LaneHypothesis  # behind it, in the mirror where the closed side is the right

    def level_sd(self, lane: float) -> float:
        """Standard deviation [m] of a lane's level; -1/2 is the right edge of all open ones."""
        place = np.array([1.0, lane])
        return float(np.sqrt(place @ self.covariance @ place))

    @property
    def width_sd(self) -> float:
        """Standard deviation [m] of the width."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def core(self) -> int:
        """Index of the station in the middle of the closed stretch, or of all stations."""
        bounded = self.closed or self.interior
        return (self.closes + min(self.opens, self.lanes.shape[1])) // 2 if bounded else self.lanes.shape[1] // 2


def fit_lane_levels(
    path: CommonPath, *, width: tuple[float, float], weights: FloatArray, closure: ClosurePrior, n_lanes: int | None
) -> list[tuple[float, LaneLevels]]:
    """(chance, levels) of the likeliest hypotheses for a prior of the lanes' width (mean, sd) [m], the likeliest first.

    Few traces, or poor ones, leave it open which lanes there are: whoever uses the levels should ask them all. `n_lanes`
    lanes are open where that is known.
    """
    evidence = {side: _evidence(path, weights, width, side=side) for side in (1, -1)}
    fits = [
        (fit.log_evidence, side, fit)
        for side, least, prior in ((1, 0, closure), (-1, 1, closure.mirrored))
        for fit in likely_hypotheses(evidence[side], prior, n_open=n_lanes, least_closed=least)
    ]
    fits.sort(key=lambda fit: -fit[0])
    chances = np.exp([log_evidence - fits[0][0] for log_evidence, _, _ in fits[:MOST_HYPOTHESES]])
    chances /= chances.sum()
    likely = [(chance, side, fit) for chance, (_, side, fit) in zip(chances, fits, strict=False) if chance > LEAST_CHANCE]
    return [(float(chance), _levels(path, fit_again(fit, evidence[side]), width, side=side)) for chance, side, fit in likely]


def refresh(levels: LaneLevels, path: CommonPath, *, weights: FloatArray) -> LaneLevels:
    """The levels for another path, with the number of lanes, their outer width and the closure as they were."""
    outer, side = (levels.outer_width, levels.outer_width_sd), -1 if any(lane < 0 for lane in levels.closed) else 1
    return _levels(path, fit_again(levels.hypothesis, _evidence(path, weights, outer, side=side)), outer, side=side)


def _evidence(path: CommonPath, weights: FloatArray, outer: tuple[float, float], *, side: int) -> Evidence:
    """The evidence for a closure on the left (side 1), or on the right, mirrored (-1)."""
    return Evidence(
        levels=side * path.levels,
        lanes=side * np.rint(path.lanes).astype(np.int64),
        weights=weights,
        spacing=STATION_SPACING_M,
        width=(outer[0], float(np.hypot(outer[1], NARROWING_SD_M))),
        usual_spread=_usual_spread(path),
    )


def _usual_spread(path: CommonPath) -> float:
    """Standard deviation [m] of levels that is usual for the traces' drift, and for their scatter: the mean of both squares."""
    of_drift = SPREAD_PER_DRIFT**2 * max(path.errors.drift_m**2 - WANDER_M**2, 0.0)
    return float(np.sqrt(HABIT_M**2 + (of_drift + path.errors.bias_m**2) / 2))


def _levels(path: CommonPath, fit: LaneHypothesis, outer: tuple[float, float], *, side: int) -> LaneLevels:
    first = fit.first.argmax(axis=1)
    pattern, right, covariance = fit.pattern, fit.right, fit.covariance
    k = pattern.n_lanes if pattern.is_interior else pattern.n_open
    if side < 0:
        first, right = k - 1 - first, -(fit.right + (k - 1) * fit.width)
        mirror = np.array([[-1.0, 1.0 - k], [0.0, 1.0]])
        covariance = mirror @ covariance @ mirror.T
    beside = () if pattern.is_interior else pattern.closed if side > 0 else tuple(range(-len(pattern.closed), 0))
    return LaneLevels(
        n_lanes=k, closed=beside, interior=pattern.closed if pattern.is_interior else (), closes=fit.closes, opens=fit.opens,
        right=right, width=fit.width, covariance=covariance, outer_width=outer[0],
        outer_width_sd=outer[1], spread=fit.spread, lanes=first[:, None] + path.lanes, hypothesis=fit,
    )  # fmt: skip
