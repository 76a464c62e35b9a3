"""LaneLevels: how many lanes stay open, which of them each trace drove in, and how wide they are."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wzsumo.crowd_mapping.common_path import CommonPath
from wzsumo.crowd_mapping.lane_changes import CHANGE_STATIONS
from wzsumo.frames import FloatArray

MAX_OPEN_LANES = 4
NARROWING_SD_M = 0.08  # of the lanes' width at the core against that before: one foot in a few zones
LEAST_SPREAD_M = 0.08  # between traces: drivers differ by 0.2 to 0.4 m, simulated ones may not at all
SPREAD_PRIOR_M, SPREAD_PRIOR_COUNT = 0.35, 1.0  # as much as one trace of such a spread
WRONG_LANE_CHANCE = 0.1  # that a vehicle that moved inwards was not in a closed lane, or went on to a lane beyond the next
OUT_OF_PLACE_COST = 4.0  # -log of the chance that a vehicle moves towards a closed side for good: one in 50
CHANGE_MARGIN = 3  # stations
CHANGE_WINDOW = 12  # stations to either side of a lane change that tell how far it went


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneLevels:
    """Open lanes 0 (rightmost) .. n_lanes - 1 where fewest are open, station `core`; lane k's centre: course + right + k width.

    `lanes` (traces, stations) are the traces' lanes in this count; those below 0 or above n_lanes - 1 are closed at the core.
    `spread` [m] is the standard deviation of the traces' levels about their lanes: GNSS bias and driver habit together.
    """

    n_lanes: int
    core: int
    right: float
    right_sd: float
    width: float
    width_sd: float
    outer_width: float  # of the lanes beyond the core
    outer_width_sd: float
    spread: float
    lanes: FloatArray
    log_evidence: FloatArray  # (counts tried,) penalised log-likelihoods


def fit_lane_levels(
    path: CommonPath,
    offsets: FloatArray,
    *,
    width: tuple[float, float],
    weights: FloatArray,
    n_lanes: int | None,
) -> LaneLevels:
    """Levels of the open lanes for a prior of their width (mean, sd) [m]; `n_lanes` open ones where it is known."""
    outer, outer_sd = _width_from_changes(path, offsets, width)
    core = _core_station(path, outer, weights)
    at_core, merged = _at_core(path, core, outer, weights)
    counts = [*range(1, MAX_OPEN_LANES + 1)] if n_lanes is None else [n_lanes]
    prior = (outer, float(np.hypot(outer_sd, NARROWING_SD_M)))
    fits = [_tied_mixture(at_core, merged, k, width=prior, weights=weights) for k in counts]
    best = max(fits, key=lambda fit: fit.evidence)
    return LaneLevels(
        n_lanes=best.k, core=core, right=best.right, right_sd=best.right_sd, width=best.width, width_sd=best.width_sd,
        outer_width=outer, outer_width_sd=outer_sd, spread=best.spread,
        lanes=best.label[:, None] + path.lanes - path.lanes[:, [core]], log_evidence=np.array([fit.evidence for fit in fits]),
    )  # fmt: skip


def refresh(levels: LaneLevels, path: CommonPath, *, weights: FloatArray) -> LaneLevels:
    """The levels for another path, with the number of lanes, their outer width and the core as they were."""
    at_core, merged = _at_core(path, levels.core, levels.outer_width, weights)
    prior = (levels.outer_width, float(np.hypot(levels.outer_width_sd, NARROWING_SD_M)))
    fit = _tied_em(at_core, merged, levels.n_lanes, start=levels.right, width=prior, weights=weights)
    return replace(
        levels, right=fit.right, right_sd=fit.right_sd, width=fit.width, width_sd=fit.width_sd, spread=fit.spread,
        lanes=fit.label[:, None] + path.lanes - path.lanes[:, [levels.core]],
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    k: int
    evidence: float
    right: float
    right_sd: float
    width: float
    width_sd: float
    spread: float
    label: npt.NDArray[np.int64]


def _at_core(path: CommonPath, core: int, width: float, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Levels (traces,) [m] at the core, and the lanes that traces out of closed lanes moved to the left on their way there."""
    # Only the way that most went leaves closed lanes.
    moved = np.rint(path.lanes[:, core] - path.lanes[:, 0])
    return path.levels + width * path.lanes[:, core], np.where(moved * (weights @ moved) > 0, moved, 0.0)


def _width_from_changes(path: CommonPath, offsets: FloatArray, prior: tuple[float, float]) -> tuple[float, float]:
    """Posterior (mean, sd) [m] of the lanes' width from how far vehicles move in a change."""
    mean, sd = prior
    precision, total = 1 / sd**2, mean / sd**2
    rest = offsets - path.course
    reach = CHANGE_WINDOW + int(CHANGE_STATIONS.max()) // 2
    # Over the window the drift goes on: its variance adds to that of the two means.
    variance = 2 * path.noise_m**2 / CHANGE_WINDOW + path.drift_m**2 * CHANGE_WINDOW
    for row, lanes in zip(rest, path.lanes, strict=True):
        moving = np.flatnonzero(np.abs(lanes - np.rint(lanes)) > 1e-6)
        jumps = np.flatnonzero(np.abs(np.diff(np.rint(lanes))) > 0)
        for jump in jumps.tolist():
            window = np.arange(max(0, jump - reach), min(len(row), jump + reach + 1))
            window = window[np.isfinite(row[window]) & ~np.isin(window, moving)]
            # A change may go on beside the stations that it was found at.
            low, high = window[window < jump - CHANGE_MARGIN], window[window > jump + 1 + CHANGE_MARGIN]
            if len(low) < 2 or len(high) < 2 or np.ptp(lanes[low]) or np.ptp(lanes[high]):
                continue
            size = abs(row[high].mean() - row[low].mean())
            precision += 1 / variance
            total += size / variance
    # Ramps end gradually and courses round off: a systematic 3 cm remains however many changes there are.
    return total / precision, float(np.hypot(1 / np.sqrt(precision), 0.03))


def _core_station(path: CommonPath, width: float, weights: FloatArray) -> int:
    """Index of the station between the vehicles that leave closed lanes and those that take them again.

    For either side, lanes are counted that traces still move away from it after a station or moved towards it before; one
    who overtakes and returns does neither. Where all go one way, leaving one side looks like taking the other: then the
    traces lie closer together at the core.
    """
    before, after = path.lanes - path.lanes[:, :1], path.lanes[:, -1:] - path.lanes
    places = path.levels[:, None] + width * path.lanes
    mean = weights @ places / weights.sum()
    variance = weights @ (places - mean) ** 2 / weights.sum() + LEAST_SPREAD_M**2
    tries = []
    for outwards in (1, -1):  # the closed side: left, right
        out_of_place = weights @ (np.maximum(-outwards * after, 0.0) + np.maximum(outwards * before, 0.0))
        best = out_of_place <= out_of_place.min() + 1e-6
        runs = np.flatnonzero(np.diff(np.r_[0, best.astype(int), 0])).reshape(-1, 2)
        start, end = runs[np.argmax(runs[:, 1] - runs[:, 0])]
        core = int((start + end - 1) // 2)
        tries.append((OUT_OF_PLACE_COST * out_of_place.min() + 0.5 * weights.sum() * np.log(variance[core]), core))
    return min(tries)[1]


def _tied_mixture(levels: FloatArray, merged: FloatArray, k: int, *, width: tuple[float, float], weights: FloatArray) -> _Fit:
    """Lanes of one width and one spread through the levels (n,) of traces: the best of several starts."""
    starts = [q - width[0] * lane for q in np.quantile(levels, [0.1, 0.35, 0.65, 0.9]) for lane in range(k)]
    tries = [_tied_em(levels, merged, k, start=float(start), width=width, weights=weights) for start in starts]
    return max(tries, key=lambda fit: fit.evidence)


def _tied_em(
    levels: FloatArray, merged: FloatArray, k: int, *, start: float, width: tuple[float, float], weights: FloatArray
) -> _Fit:
    lane, n = np.arange(k), float(weights.sum())
    right, wide, spread = start, width[0], 0.5
    shares = np.full(k, 1 / k)
    # A vehicle that came from the left went to the leftmost open lane, one from the right to the rightmost.
    log_goal = np.full((len(levels), k), np.nan)
    if k > 1:
        wrong = np.full(k, np.log(WRONG_LANE_CHANCE / (k - 1)))
        log_goal[merged < 0] = np.r_[wrong[1:], np.log1p(-WRONG_LANE_CHANCE)]
        log_goal[merged > 0] = np.r_[np.log1p(-WRONG_LANE_CHANCE), wrong[1:]]
    stayed = np.isnan(log_goal[:, 0])
    responsibility = np.zeros((len(levels), k))
    log_likelihood = -np.inf
    for _ in range(60):
        miss = levels[:, None] - right - wide * lane
        log_joint = (
            np.where(stayed[:, None], np.log(np.maximum(shares, 1e-9)), log_goal) - 0.5 * (miss / spread) ** 2 - np.log(spread)
        )
        top = log_joint.max(axis=1)
        each = top + np.log(np.exp(log_joint - top[:, None]).sum(axis=1))
        responsibility = np.exp(log_joint - each[:, None])
        previous, log_likelihood = log_likelihood, float(weights @ each)
        r = responsibility * weights[:, None]
        shares = (r[stayed].sum(axis=0) + 0.5) / (r[stayed].sum() + 0.5 * k)
        normal = np.array([[r.sum(), (r @ lane).sum()], [(r @ lane).sum(), (r @ lane**2).sum()]]) / spread**2
        normal[1, 1] += 1 / width[1] ** 2
        side = np.array([(r * levels[:, None]).sum(), (r * levels[:, None] * lane).sum()]) / spread**2
        side[1] += width[0] / width[1] ** 2
        right, wide = np.linalg.solve(normal, side)
        square = (r * (levels[:, None] - right - wide * lane) ** 2).sum()
        spread = np.sqrt((SPREAD_PRIOR_COUNT * SPREAD_PRIOR_M**2 + square) / (SPREAD_PRIOR_COUNT + max(n - 1, 0.0)))
        spread = max(float(spread), LEAST_SPREAD_M)
        if log_likelihood - previous < 1e-5:
            break
    covariance = np.linalg.inv(normal)
    occupied = (responsibility * weights[:, None]).sum(axis=0)
    evidence = log_likelihood - 0.5 * (k + 1) * np.log(max(n, 2.0)) - 0.5 * ((wide - width[0]) / width[1]) ** 2
    if occupied[[0, -1]].min() < 0.6 * min(1.0, n):
        evidence = -np.inf  # a lane that nobody drove in is none
    return _Fit(
        k=k, evidence=evidence, right=float(right), right_sd=float(np.sqrt(covariance[0, 0])), width=float(wide),
        width_sd=float(np.sqrt(covariance[1, 1])), spread=spread, label=responsibility.argmax(axis=1),
    )  # fmt: skip
