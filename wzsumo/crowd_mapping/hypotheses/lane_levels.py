"""LaneLevels: where the lanes lie, which lane each trace drove in, and which lanes are closed between which stations.

The middle of lane k has the offset course(s) + right + k width [m] from the reference line. Traces agree on the course; their
levels about it scatter by GNSS bias and drivers' habits. Hypotheses are fitted for closures on the left and, in the mirror
image, for closures on the right. Their probabilities are proportional to the exponential of their log evidence.
"""

from dataclasses import dataclass

import numpy as np

from wzsumo.crowd_mapping.course.common_path import CommonPath
from wzsumo.crowd_mapping.course.station_table import STATION_SPACING_M
from wzsumo.crowd_mapping.hypotheses.change_likelihood import LaneEvidence
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_hypotheses import LaneHypothesis, likely_hypotheses, refit_hypothesis
from wzsumo.frames import FloatArray

# Of the lanes' width beside the work about the width before it: zones narrow lanes by a foot at times. Chosen by us.
NARROWING_SD_M = 0.08
# A GNSS error that drifts by 1 cm in 10 m (0.4 s) has a bias of some 20 cm: the ratio in wzsumo.sensing.gnss, with its sources.
BIAS_PER_DRIFT = 20.0
DRIVER_DRIFT_M = 0.03  # in 10 m, of drivers without any GNSS error; SUMO with lcSigma = 0.08
DRIVER_OFFSET_SD_M = 0.25  # between drivers' usual places in a lane: 0.2 to 0.4 m in naturalistic studies
MAX_HYPOTHESES, MIN_HYPOTHESIS_CHANCE = 5, 0.02  # that are kept; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneLevels:
    """Lanes 0 (rightmost) .. n_lanes - 1 go through: they are open all along, but for `interior` ones.

    Lanes `closed` lie beside them: below 0 on the right, from n_lanes on the left. They and the `interior` lanes are closed
    from station `closed_from` on and open from `open_from` on (indices; the number of stations where they do not open again).
    `right` and `width` [m] have the `covariance` (2, 2) [m^2]. `outer_width` and `outer_width_sd` [m] are those of the lanes
    beside. `spread` [m] is the standard deviation of the traces' levels about their lanes. `lanes` (traces, stations) are the
    traces' lanes in this count. `hypothesis` is what all this follows from, mirrored where the closure is on the right.
    """

    n_lanes: int
    closed: tuple[int, ...]
    interior: tuple[int, ...]
    closed_from: int
    open_from: int
    right: float
    width: float
    covariance: FloatArray
    outer_width: float
    outer_width_sd: float
    spread: float
    lanes: FloatArray
    hypothesis: LaneHypothesis

    def level_sd(self, lane: float) -> float:
        """Standard deviation [m] of a lane's level; lane -1/2 is the right edge of lane 0."""
        place = np.array([1.0, lane])
        return float(np.sqrt(place @ self.covariance @ place))

    @property
    def width_sd(self) -> float:
        """Standard deviation [m] of the width."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def core_station(self) -> int:
        """Index of the station in the middle of the closed stretch; of all stations where nothing is closed."""
        bounded = self.closed or self.interior
        n_stations = self.lanes.shape[1]
        return (self.closed_from + min(self.open_from, n_stations)) // 2 if bounded else n_stations // 2


def fit_lane_levels(
    path: CommonPath, *, width: tuple[float, float], weights: FloatArray, closure_prior: ClosurePrior, n_lanes: int | None
) -> list[tuple[float, LaneLevels]]:
    """(probability, levels) of the likeliest hypotheses, the likeliest first.

    `width` is the prior mean and standard deviation [m] of the lanes' width, `n_lanes` the number of open lanes where it is
    known. Few or poor traces may leave several hypotheses likely: a map should be made of all of them.
    """
    evidence = {side: _evidence(path, weights, width, side=side) for side in (1, -1)}
    fits = [
        (fit.log_evidence, side, fit)
        for side, min_closed, prior in ((1, 0, closure_prior), (-1, 1, closure_prior.mirrored))
        for fit in likely_hypotheses(evidence[side], prior, n_open=n_lanes, min_closed=min_closed)
    ]
    fits.sort(key=lambda fit: -fit[0])
    chances = np.exp([log_evidence - fits[0][0] for log_evidence, _, _ in fits[:MAX_HYPOTHESES]])
    chances /= chances.sum()
    likely = [
        (chance, side, fit) for chance, (_, side, fit) in zip(chances, fits, strict=False) if chance > MIN_HYPOTHESIS_CHANCE
    ]
    return [
        (float(chance), _levels(path, refit_hypothesis(fit, evidence[side]), width, side=side)) for chance, side, fit in likely
    ]


def refit_levels(levels: LaneLevels, path: CommonPath, *, weights: FloatArray) -> LaneLevels:
    """The levels fitted to another path; the pattern of lanes, their outer width and the closure stay as they are."""
    outer, side = (levels.outer_width, levels.outer_width_sd), -1 if any(lane < 0 for lane in levels.closed) else 1
    return _levels(path, refit_hypothesis(levels.hypothesis, _evidence(path, weights, outer, side=side)), outer, side=side)


def _evidence(path: CommonPath, weights: FloatArray, outer: tuple[float, float], *, side: int) -> LaneEvidence:
    """The evidence as it is (side 1), for a closure on the left, or mirrored (side -1), for one on the right."""
    return LaneEvidence(
        levels=side * path.levels,
        lanes=side * np.rint(path.lanes).astype(np.int64),
        weights=weights,
        spacing=STATION_SPACING_M,
        width=(outer[0], float(np.hypot(outer[1], NARROWING_SD_M))),
        usual_spread=_usual_spread(path),
    )


def _usual_spread(path: CommonPath) -> float:
    """Standard deviation [m] of levels that the traces let expect, before the levels are looked at.

    The variance of the GNSS bias is the mean of two estimates: from the drift of the traces, and from their bias on bends.
    """
    of_drift = BIAS_PER_DRIFT**2 * max(path.errors.drift_m**2 - DRIVER_DRIFT_M**2, 0.0)
    return float(np.sqrt(DRIVER_OFFSET_SD_M**2 + (of_drift + path.errors.bias_m**2) / 2))


def _levels(path: CommonPath, fit: LaneHypothesis, outer: tuple[float, float], *, side: int) -> LaneLevels:
    """The levels of a hypothesis, back in the count of lanes from the right where it was fitted in the mirror image."""
    first = fit.first.argmax(axis=1)
    pattern, right, covariance = fit.pattern, fit.right, fit.covariance
    k = pattern.n_lanes if pattern.is_interior else pattern.n_open
    if side < 0:
        first, right = k - 1 - first, -(fit.right + (k - 1) * fit.width)
        mirror = np.array([[-1.0, 1.0 - k], [0.0, 1.0]])
        covariance = mirror @ covariance @ mirror.T
    beside = () if pattern.is_interior else pattern.closed if side > 0 else tuple(range(-len(pattern.closed), 0))
    return LaneLevels(
        n_lanes=k, closed=beside, interior=pattern.closed if pattern.is_interior else (), closed_from=fit.closed_from,
        open_from=fit.open_from, right=right, width=fit.width, covariance=covariance, outer_width=outer[0],
        outer_width_sd=outer[1], spread=fit.spread, lanes=first[:, None] + path.lanes, hypothesis=fit,
    )  # fmt: skip
