"""Charts of the lanes: closed from a cell on, the ends of a closure moved, closed ground driven again.

Each compares how a trace used a lane with how others did before. Habits are learned by counting, with the error of counting as
a dead zone; what traces show while a chart speaks is kept aside, so that a change is not learned as a habit.
"""

from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np
import numpy.typing as npt

from wzsumo.frames import FloatArray, IntArray
from wzsumo.live.charts.evidence import ODD_SHARE, SHOWN_SHARE, likeness
from wzsumo.live.ground import Ground
from wzsumo.live.trace.lane_use import LaneUse, Windows, windows_of

ODD_IN_CLOSED = 0.03  # of users of a lane that seem to stay in it although it closes
LEAVING_PRIOR = (4.0, 0.15)  # traces' worth, and share of users that leave a lane over the reach, before any is seen
USING_PRIOR = (0.3, 29.7)  # that drive on closed ground, and that do not
LEAST_USING = 0.006  # share of users of closed ground below which no habit is trusted
MOVES_M = (-300.0, -100.0, -50.0, 50.0, 100.0, 300.0)  # of an end, along the road
TAKE_UPS = (0.08, 0.2, 0.5)  # of vehicles that drive in a lane that is open again
PLACE_PRIOR = 10.0  # traces' worth of drivers who leave evenly over the reach
FORGOTTEN_AFTER = 300  # traces: what grew for longer without an alarm is a habit
PLACE_FLOOR = 0.1  # of a moved end's traces that are anywhere
NO_PLACE = 1e-9  # where no driver is known to leave or enter, all of a moved end's traces are anywhere
YOUNG_TRACES = 30.0  # of a place: as many count for the habit before they count for a change
MOST_TRACES = 2000.0  # remembered
LEARNED_BELOW = 1.0  # nats

Counts = npt.NDArray[np.int32]


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneCharts:
    """Evidence [nats] and the trace behind which it began to grow; habits, and what waits to become habit.

    `closing` (REACHES, L, m), and `left_s` when a vehicle left the lane there last [s]; `ends` (2, L, moves): of the starts and
    of the ends of closures; `opening` (L, take-ups).
    `leaving` (REACHES, 2 kinds of vehicles, L, m, 2) counts those that left and stayed, `places` (2, L, places) where, `using`
    (2, L, 2) those
    on closed ground and not. `ratios` (2, L, moves, 2) are sums of moved ends' likelihood
    ratios, and how many.
    """

    closing: FloatArray
    closing_since: Counts
    left_s: FloatArray
    leaving: FloatArray
    leaving_pending: FloatArray
    ends: FloatArray
    ends_since: Counts
    places: FloatArray
    places_pending: FloatArray
    ratios: FloatArray
    ratios_pending: FloatArray
    opening: FloatArray
    opening_since: Counts
    using: FloatArray
    using_pending: FloatArray


def first_lane_charts(ground: Ground) -> LaneCharts:
    """Charts of a map that no trace has been compared with yet."""
    n, m = ground.n_lanes, len(ground.cells)
    places = np.zeros((2, n, windows_of(ground).places))
    reaches = len(windows_of(ground).reaches)
    leaving, using = np.zeros((reaches, 2, n, m, 2)), np.zeros((2, n, 2))
    ends, opening = np.zeros((2, n, len(MOVES_M))), np.zeros((n, len(TAKE_UPS)))
    ratios = np.zeros((2, n, len(MOVES_M), 2))
    return LaneCharts(
        closing=np.zeros((reaches, n, m)), closing_since=np.zeros((reaches, n, m), dtype=np.int32),
        left_s=np.full((reaches, n, m), -np.inf), leaving=leaving,
        leaving_pending=np.zeros_like(leaving), ends=ends, ends_since=np.zeros(ends.shape, dtype=np.int32), places=places,
        places_pending=np.zeros_like(places), ratios=ratios, ratios_pending=np.zeros_like(ratios), opening=opening,
        opening_since=np.zeros(opening.shape, dtype=np.int32),
        using=using, using_pending=np.zeros_like(using),
    )  # fmt: skip


def add_use(
    charts: LaneCharts, use: LaneUse, ground: Ground, *, kind: int, slow: bool, now_s: float, number: int
) -> LaneCharts:
    """The charts after trace `number`, of a `kind` of vehicle, which ended at `now_s`.

    A slow one says nothing about closed ground.
    """
    new = LaneCharts(**{name: value.copy() for name, value in vars(charts).items()})
    for reach, prior in enumerate(_leaving_priors(ground)):
        _add_closing(
            use.left[reach], use.stayed[reach], use.came[reach], ground.closed, prior, kind, new.closing[reach],
            new.closing_since[reach], new.left_s[reach], new.leaving[reach], new.leaving_pending[reach], now_s, number,
        )  # fmt: skip
    moves = np.round(np.array(MOVES_M) / ground.spacing).astype(np.int64)
    priors = _place_priors(windows_of(ground))
    for side, seen in enumerate((use.leaves, use.enters)):
        _add_places(
            seen,
            use.followed[side],
            priors[side],
            moves,
            new.ends[side],
            new.ends_since[side],
            new.places[side],
            new.places_pending[side],
            new.ratios[side],
            new.ratios_pending[side],
            number,
        )
    if not slow:
        _add_opening(use.uses, np.array(TAKE_UPS), kind, new.opening, new.opening_since, new.using, new.using_pending, number)
    return new


@lru_cache(maxsize=64)
def _leaving_priors(ground: Ground) -> FloatArray:
    """Shares (REACHES, L, m) of a lane's users that leave it over a reach ahead of a cell: all ahead of a closure, evenly."""
    cells = np.arange(len(ground.cells))
    priors = []
    for reach in windows_of(ground).reaches:
        usual = 1 - (1 - LEAVING_PRIOR[1]) ** (reach / windows_of(ground).reach)
        prior = np.full(ground.closed.shape, usual)
        for lane, (start, _) in enumerate(ground.closures):
            if start >= 0:
                must = np.clip((cells - (start - reach)) / reach, 0.0, 0.97) * (cells < start)
                prior[lane] = np.maximum(prior[lane], must)
        priors.append(prior)
    return np.array(priors)


@lru_cache(maxsize=64)
def _place_priors(windows: Windows) -> FloatArray:
    """Chances (2, places) of where drivers leave a lane that closes, and enter one behind its closure."""
    place = np.arange(windows.places)
    ahead, behind = place - windows.approach, place - windows.inside
    reach = windows.reach
    leave = 0.8 * ((ahead >= -reach) & (ahead < 0)) / reach + 0.2 * (ahead < 0) / windows.approach
    enter = 0.8 * ((behind > 0) & (behind <= reach)) / reach + 0.2 * (behind > 0) / windows.approach
    return np.array([leave / leave.sum(), enter / enter.sum()])


@numba.njit(cache=True, nogil=True)
def _add_closing(
    left: FloatArray, stayed: FloatArray, came: FloatArray, closed: npt.NDArray[np.bool_], prior: FloatArray, kind: int,
    evidence: FloatArray,
    since: Counts, left_s: FloatArray, habit: FloatArray, pending: FloatArray, now_s: float, number: int,
) -> None:  # fmt: skip
    """One reach ahead of a cell."""
    n_lanes, m = evidence.shape
    for k in range(n_lanes):
        for t in range(m):
            users = left[k, t] + stayed[k, t]
            if closed[k, t] or users + came[k, t] == 0:
                if closed[k, t]:
                    evidence[k, t] = 0.0
                continue
            a = habit[kind, k, t, 0] + LEAVING_PRIOR[0] * prior[k, t]
            b = habit[kind, k, t, 1] + LEAVING_PRIOR[0] * (1 - prior[k, t])
            share = a / (a + b)
            share = min(max(share + np.sqrt(share * (1 - share) / (a + b + 1)), ODD_SHARE), 0.99)
            share += (0.99 - share) * likeness(now_s - left_s[k, t])
            if left[k, t] > 0.5:
                left_s[k, t] = max(left_s[k, t], now_s)
            ratio = left[k, t] * (1 - ODD_IN_CLOSED) / share + stayed[k, t] * ODD_IN_CLOSED / (1 - share)
            ratio += 0.2 * came[k, t] + 1 - users - came[k, t]
            value = evidence[k, t] + np.log(ratio)
            if value <= 0 or number - since[k, t] > FORGOTTEN_AFTER:
                value = 0.0
                since[k, t] = number
            evidence[k, t] = value
            pending[kind, k, t, 0] += left[k, t]
            pending[kind, k, t, 1] += stayed[k, t]
            if value < LEARNED_BELOW or habit[kind, k, t].sum() < YOUNG_TRACES:
                for c in range(2):
                    habit[c, k, t] += pending[c, k, t]
                    pending[c, k, t] = 0.0
                if habit[kind, k, t].sum() > MOST_TRACES:
                    habit[kind, k, t] *= MOST_TRACES / habit[kind, k, t].sum()


@numba.njit(cache=True, nogil=True)
def _add_places(  # noqa: C901 - one pass over lanes and moves
    seen: FloatArray, followed: IntArray, prior: FloatArray, moves: IntArray, evidence: FloatArray, since: Counts,
    habit: FloatArray, pending: FloatArray, ratios: FloatArray, ratios_pending: FloatArray, number: int,
) -> None:  # fmt: skip
    """One side of the closures. Drivers keep their distance from an end that moves; how far ahead of it, or behind it, they
    would leave or enter beyond the stretch that the trace passes is not seen, so places are compared given that they lie in it.
    """
    n_lanes, places = seen.shape
    density = np.empty(places)
    for k in range(n_lanes):
        total = seen[k].sum()
        low, high = followed[k]
        if total <= 0.05 or high <= low:
            continue
        n = habit[k].sum()
        half = 2 if n < 100 else (1 if n < 1000 else 0)  # cells to each side over which few drivers are spread
        for x in range(places):
            smooth = 0.0
            for dx in range(-half, half + 1):
                if 0 <= x + dx < places:
                    smooth += (half + 1 - abs(dx)) / (half + 1) ** 2 * habit[k, x + dx]
            density[x] = (smooth + PLACE_PRIOR * prior[x]) / (n + PLACE_PRIOR)
        most, odd = 0.0, PLACE_FLOOR / (high - low + 1)
        usual = max(density[low : high + 1].sum(), NO_PLACE)
        for i in range(len(moves)):
            ratio, moved = 1 - total, NO_PLACE
            for x in range(low, high + 1):
                moved += density[min(max(x - moves[i], 0), places - 1)]
            for x in range(low, high + 1):
                if seen[k, x] > 0:
                    was = (1 - PLACE_FLOOR) * density[x] / usual + odd
                    now = (1 - PLACE_FLOOR) * density[min(max(x - moves[i], 0), places - 1)] / moved + odd
                    ratio += seen[k, x] * now / was
            ratio = 1 - SHOWN_SHARE + SHOWN_SHARE * ratio
            # Divided by what it is in the mean, since the density is only known by counting.
            count = ratios[k, i, 1] + 10.0
            mean = (ratios[k, i, 0] + 10.0) / count
            ratios_pending[k, i, 0] += ratio
            ratios_pending[k, i, 1] += 1
            value = evidence[k, i] + np.log(ratio / max(mean, 1.0))
            if value <= 0:
                value = 0.0
                since[k, i] = number
            evidence[k, i] = value
            most = max(most, value)
        pending[k] += seen[k]
        forgotten = number - since[k].min() > FORGOTTEN_AFTER
        if forgotten:
            evidence[k] = 0.0
            since[k] = number
        if most < LEARNED_BELOW or n < 2 * YOUNG_TRACES or forgotten:
            habit[k] += pending[k]
            pending[k] = 0.0
            ratios[k] += ratios_pending[k]
            ratios_pending[k] = 0.0
            for i in range(len(moves)):
                if ratios[k, i, 1] > MOST_TRACES:
                    ratios[k, i] *= MOST_TRACES / ratios[k, i, 1]
            if habit[k].sum() > MOST_TRACES:
                habit[k] *= MOST_TRACES / habit[k].sum()


@numba.njit(cache=True, nogil=True)
def _add_opening(
    uses: FloatArray, take_ups: FloatArray, kind: int, evidence: FloatArray, since: Counts, habit: FloatArray,
    pending: FloatArray, number: int,
) -> None:  # fmt: skip
    for k in range(len(uses)):
        if uses[k] < 0:
            continue
        # Whatever the ways are worth, the ratio below is 1 in the mean while the share of users is the habit's.
        a, b = habit[kind, k, 0] + USING_PRIOR[0], habit[kind, k, 1] + USING_PRIOR[1]
        share = a / (a + b)
        share = min(max(share + np.sqrt(share * (1 - share) / (a + b + 1)), LEAST_USING), 0.9)
        most = 0.0
        for i in range(len(take_ups)):
            q = take_ups[i]
            value = 0.0 if q < 2 * share else evidence[k, i] + np.log(1 - q + q * uses[k] / share)
            if value <= 0:
                value = 0.0
                since[k, i] = number
            evidence[k, i] = value
            most = max(most, value)
        pending[kind, k, 0] += uses[k]
        pending[kind, k, 1] += 1 - uses[k]
        forgotten = number - since[k].min() > FORGOTTEN_AFTER
        if forgotten:
            evidence[k] = 0.0
            since[k] = number
        # A young map's habit is its own word that nobody drives there: traces against it are no habit, however young it is.
        if most < LEARNED_BELOW or forgotten:
            for c in range(2):
                habit[c, k] += pending[c, k]
                pending[c, k] = 0.0
            if habit[kind, k].sum() > MOST_TRACES:
                habit[kind, k] *= MOST_TRACES / habit[kind, k].sum()
