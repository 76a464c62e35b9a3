"""Which lanes a trace drove in: ways that can have made its fixes, drawn from their distribution given the fixes.

A hidden Markov model along the cells. Its state is a lane, or one of two places between neighbouring lanes on the way to the
left or to the right, together with the receiver's error on a grid. The error walks at random and is seldom drawn anew. Ways are
sampled backwards from the filtered distribution (forward filtering, backward sampling), so that any question about a whole way
- did it leave the lane ahead of here, and not come back - is answered by an average over them.
"""

from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np
import numpy.typing as npt

from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.live.ground import Ground
from wzsumo.live.trace.reading import WANDER_SD_M, Reading

WAYS = 16  # drawn a trace
# The grid of errors: 6.6 m to each side on lanes of 3.6 m. Its step divides a lane's width and a third of it, the places
# between lanes, so that an error and another place with another error leave the same rest; else the rest decides for a lane.
STEPS_PER_LANE, HALF_LEVELS = 6, 11
LANE_CHANGES_PER_M = 1 / 1500  # to each side; near work vehicles change more often than elsewhere
STAYS, QUICK, CALLED_OFF = 0.35, 0.3, 0.05  # between lanes: chance of another cell there; change within a cell; called off
WILD_SHARE, WILD_WIDTH_M = 0.02, 15.0
REDRAW = 2e-3  # chance a cell that the error jumps: multipath, a bridge, a shifted road
IN_CLOSED = 0.01  # chance of entering ground that the map holds to be closed, beside that of entering an open lane
IN_CLOSED_DRAWN = 0.15  # that with which ways are drawn: they are then weighed, so that rare ways are seen too
WANDER_LENGTH_M = 60.0
ERROR_SDS_M = (0.4, 1.0, 2.2)  # of receivers, before anything is known: equal shares
KEPT_SHARE = 0.1  # of those, whatever is learned

Places = npt.NDArray[np.int16]
Draws = npt.NDArray[np.uint64]  # (1,): the state of a generator of random numbers


@dataclass(frozen=True, kw_only=True, eq=False)
class Ways:
    """Places (WAYS, m) of ways that the fixes leave possible, and their weights (WAYS,), which sum up to 1.

    A place is 3 k in lane k, 3 k + 1 and 3 k + 2 between lanes k and k + 1, -1 before the first and behind the last cell seen.
    """

    places: Places
    weights: FloatArray


def draw_ways(ground: Ground, reading: Reading, *, walk: float, receivers: FloatArray, seed: int) -> Ways:
    """Ways that the fixes leave possible.

    `walk` [m^2] is the variance of the error's change from cell to cell, `receivers` (SDS,) the shares of receivers by
    their error. The same seed draws the same ways.
    """
    levels = levels_of((1 - KEPT_SHARE) * receivers + KEPT_SHARE * first_receivers(), width=ground.width)
    eta = min(1.0, ground.spacing / WANDER_LENGTH_M)
    places, weights = _draw(
        reading.offset, reading.seen, ground.closed, ground.width, reading.white, walk, eta,
        LANE_CHANGES_PER_M * ground.spacing, levels, reading.first, reading.last, np.array([seed], dtype=np.uint64),
    )  # fmt: skip
    return Ways(places=places, weights=weights)


def first_receivers() -> FloatArray:
    """Shares (SDS,) of receivers by their error, before any is known."""
    return np.full(len(ERROR_SDS_M), 1 / len(ERROR_SDS_M))


def levels_of(receivers: FloatArray, *, width: float) -> FloatArray:
    """Chances (LEVELS,) of errors on the grid of lanes of a width [m], of shares (SDS,) of receivers by their error."""
    return np.asarray(receivers @ _levels_of_sds(round(width, 3)))


def error_of(receivers: FloatArray) -> float:
    """Root mean square [m] of the errors of shares (SDS,) of receivers."""
    return float(np.sqrt(receivers @ np.square(ERROR_SDS_M)))


def with_errors(receivers: FloatArray, seen: FloatArray, *, width: float, rate: float) -> FloatArray:
    """Shares (SDS,) of receivers by their error after a trace whose errors have weights `seen` (LEVELS,).

    Errors are a mixture of normal ones with the standard deviations ERROR_SDS_M; a step of online EM moves its shares. An
    error of a lane's width that is none cannot last: receivers that err so must also err by half a lane, which is not seen.
    """
    parts = receivers[:, None] * _levels_of_sds(round(width, 3))
    wanted = (parts / parts.sum(axis=0) * seen).sum(axis=1)
    return np.asarray((1 - rate * seen.sum()) * receivers + rate * wanted)


@lru_cache
def _levels_of_sds(width: float) -> FloatArray:
    """Chances (SDS, LEVELS) of errors with each of ERROR_SDS_M."""
    levels = width / STEPS_PER_LANE * np.arange(-HALF_LEVELS, HALF_LEVELS + 1)
    parts = np.exp(-0.5 * (levels / np.array(ERROR_SDS_M)[:, None]) ** 2)
    return np.asarray(parts / parts.sum(axis=1, keepdims=True))


@numba.njit(cache=True, nogil=True)
def error_levels(
    y: FloatArray, seen: BoolArray, ways: Places, weights: FloatArray, width: float, closed: BoolArray
) -> FloatArray:
    """Weights (LEVELS,) of the mean errors that the ways leave the trace with, the same to both sides.

    `closed` (L,) are the lanes that are closed somewhere. An error of half a lane and more towards one of them may be a vehicle
    that drives there, and says nothing of receivers: so one to the other side counts twice. All weights may be 0.
    """
    share = np.zeros(2 * HALF_LEVELS + 1)
    for i in range(ways.shape[0]):
        total, place, n = 0.0, 0.0, 0
        for t in range(ways.shape[1]):
            if seen[t] and ways[i, t] >= 0:
                total += y[t] - ways[i, t] * width / 3
                place += ways[i, t] / 3
                n += 1
        if n == 0:
            continue
        left = total > 0  # which side the error is to
        towards, away = False, False
        for k in range(len(closed)):
            if closed[k]:
                towards = towards or (k > place / n if left else k < place / n)
                away = away or (k < place / n if left else k > place / n)
        part = 0.5 * weights[i]
        if abs(total / n) >= width / 2:
            part *= 0.0 if towards else (2.0 if away else 1.0)
        level = min(int(abs(total / n) / width * STEPS_PER_LANE + 0.5), HALF_LEVELS)
        share[HALF_LEVELS - level] += part
        share[HALF_LEVELS + level] += part
    return share


@numba.njit(cache=True, nogil=True)
def _links(n_lanes: int, change: float) -> tuple[IntArray, FloatArray]:
    """Sources (states, 4) of each state, -1 where there are fewer, and their probabilities.

    States: lanes 0 ... L - 1, then for each pair of neighbours four: up 1/3, up 2/3, down 2/3, down 1/3.
    """
    n = n_lanes + 4 * (n_lanes - 1)
    source = -np.ones((n, 9), dtype=np.int64)
    chance = np.zeros((n, 9))
    used = np.zeros(n, dtype=np.int64)

    for k in range(n_lanes):
        sides = (1 if k > 0 else 0) + (1 if k < n_lanes - 1 else 0)
        _link(source, chance, used, k, k, 1 - sides * change)
    for k in range(n_lanes - 1):
        up1 = n_lanes + 4 * k
        up2, down2, down1 = up1 + 1, up1 + 2, up1 + 3
        _link(source, chance, used, k, up1, change * (1 - QUICK))
        _link(source, chance, used, k, k + 1, change * QUICK)
        _link(source, chance, used, k + 1, down2, change * (1 - QUICK))
        _link(source, chance, used, k + 1, k, change * QUICK)
        _link(source, chance, used, up1, up1, STAYS)
        _link(source, chance, used, up1, up2, 1 - STAYS - CALLED_OFF)
        _link(source, chance, used, up1, k, CALLED_OFF)
        _link(source, chance, used, up2, up2, STAYS)
        _link(source, chance, used, up2, k + 1, 1 - STAYS)
        _link(source, chance, used, down2, down2, STAYS)
        _link(source, chance, used, down2, down1, 1 - STAYS - CALLED_OFF)
        _link(source, chance, used, down2, k + 1, CALLED_OFF)
        _link(source, chance, used, down1, down1, STAYS)
        _link(source, chance, used, down1, k, 1 - STAYS)
    return source, chance


@numba.njit(cache=True, nogil=True)
def _link(source: IntArray, chance: FloatArray, used: IntArray, a: int, b: int, p: float) -> None:
    source[b, used[b]] = a
    chance[b, used[b]] = p
    used[b] += 1


@numba.njit(cache=True, nogil=True)
def _thirds(state: int, n_lanes: int) -> int:
    """Place of a state in thirds of a lane from lane 0's middle."""
    if state < n_lanes:
        return 3 * state
    k, part = (state - n_lanes) // 4, (state - n_lanes) % 4
    return 3 * k + (1 if part in {0, 3} else 2)


@numba.njit(cache=True, nogil=True)
def _draw(  # noqa: C901 - one pass forward, one backward
    y: FloatArray, seen: BoolArray, closed: BoolArray, width: float, white: float, walk: float, eta: float, change: float,
    start: FloatArray, first: int, last: int, random: Draws,
) -> tuple[Places, FloatArray]:  # fmt: skip
    n_lanes = closed.shape[0]
    source, chance = _links(n_lanes, change)
    n_states, n_levels, m = source.shape[0], len(start), len(y)
    place = np.array([_thirds(z, n_lanes) for z in range(n_states)])
    half = (n_levels - 1) // 2
    apart = width / STEPS_PER_LANE
    step = min(0.25, walk / (2 * apart * apart))  # chance to move a level to each side
    r = white * white + WANDER_SD_M**2 + apart**2 / 12
    # The tempered density of a fix on a fine table of distances.
    table = np.empty(600)
    for i in range(600):
        gap = 0.05 * i
        table[i] = ((1 - WILD_SHARE) * np.exp(-0.5 * gap * gap / r) / np.sqrt(2 * np.pi * r) + WILD_SHARE / WILD_WIDTH_M) ** eta
    here = np.empty(STEPS_PER_LANE * (n_lanes - 1) + n_levels)  # densities by a place and an error together, in steps
    alpha = np.zeros((last - first + 1, n_states, n_levels))
    walked = np.empty((n_states, n_levels))
    row = np.zeros((last - first + 1, n_states))  # sums over the levels
    for t in range(first, last + 1):
        now = alpha[t - first]
        if t == first:
            for k in range(n_lanes):
                factor = IN_CLOSED_DRAWN if closed[k, t] else 1.0
                for b in range(n_levels):
                    now[k, b] = factor * start[b]
        else:
            before = alpha[t - first - 1]
            for z in range(n_states):
                jumped = REDRAW * row[t - first - 1, z] / n_levels
                stays, moves = (1 - REDRAW) * (1 - 2 * step), (1 - REDRAW) * step
                for b in range(1, n_levels - 1):
                    walked[z, b] = stays * before[z, b] + moves * (before[z, b - 1] + before[z, b + 1]) + jumped
                walked[z, 0] = (stays + moves) * before[z, 0] + moves * before[z, 1] + jumped
                walked[z, -1] = (stays + moves) * before[z, -1] + moves * before[z, -2] + jumped
            for z in range(n_states):
                for j in range(9):
                    a = source[z, j]
                    if a < 0:
                        break
                    p = chance[z, j]
                    if z < n_lanes and closed[z, t] and (a != z or not closed[z, t - 1]):
                        p *= IN_CLOSED_DRAWN
                    for b in range(n_levels):
                        now[z, b] += p * walked[a, b]
        if seen[t]:
            for i in range(len(here)):
                here[i] = table[min(int(abs(y[t] - apart * (i - half)) * 20 + 0.5), 599)]
        total = 0.0
        for z in range(n_states):
            off = place[z] * STEPS_PER_LANE // 3
            for b in range(n_levels):
                if seen[t]:
                    now[z, b] *= here[off + b]
                row[t - first, z] += now[z, b]
            total += row[t - first, z]
        scale = 1 / total
        for z in range(n_states):
            row[t - first, z] *= scale
            for b in range(n_levels):
                now[z, b] *= scale
    return _sample(alpha, row, source, chance, closed, place, step, first, last, m, random)


@numba.njit(cache=True, nogil=True)
def _sample(
    alpha: FloatArray, row: FloatArray, source: IntArray, chance: FloatArray, closed: BoolArray, place: IntArray, step: float,
    first: int, last: int, m: int, random: Draws,
) -> tuple[Places, FloatArray]:  # fmt: skip
    """Ways drawn backwards, and their weights."""
    n_levels = alpha.shape[2]
    ways = -np.ones((WAYS, m), dtype=np.int16)
    weight = np.zeros((source.shape[1], 4))
    cumulated = np.cumsum(alpha[-1].ravel())
    for i in range(WAYS):
        # One draw in each of equal shares of the last distribution: the ways differ as much as they can.
        pick = np.searchsorted(cumulated, (i + _uniform(random)) / WAYS * cumulated[-1])
        pick = min(pick, cumulated.size - 1)
        state, level = pick // n_levels, pick % n_levels
        ways[i, last] = place[state]
        for t in range(last - 1, first - 1, -1):
            before, sums = alpha[t - first], row[t - first]
            n_sources = _weigh(weight, before, sums, source[state], chance[state], state, level, closed, t, step)
            chosen = _pick(weight, n_sources, _uniform(random))
            state, move = source[state, chosen // 4], chosen % 4
            if move == 1:
                level = max(level - 1, 0)
            elif move == 2:
                level = min(level + 1, n_levels - 1)
            elif move == 3:
                left, level = _uniform(random) * sums[state] - before[state, 0], 0
                while left > 0 and level < n_levels - 1:
                    level += 1
                    left -= before[state, level]
            ways[i, t] = place[state]
    return ways, _weights(ways, closed)


@numba.njit(cache=True, nogil=True)
def _uniform(random: Draws) -> float:
    """The next random number in [0, 1): SplitMix64 (Steele et al. 2014), which begins in no time with any seed."""
    random[0] += np.uint64(0x9E3779B97F4A7C15)
    z = random[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return float((z ^ (z >> np.uint64(31))) >> np.uint64(11)) / 9007199254740992.0


@numba.njit(cache=True, nogil=True)
def _weigh(
    weight: FloatArray, before: FloatArray, sums: FloatArray, source: IntArray, chance: FloatArray, state: int, level: int,
    closed: BoolArray, t: int, step: float,
) -> int:  # fmt: skip
    """Fill the weights of a state's sources by how the error came: it stayed, rose, fell, was drawn anew; number of sources."""
    n_lanes, n_levels = closed.shape[0], before.shape[1]
    below, above = max(level - 1, 0), min(level + 1, n_levels - 1)
    stays, moves = (1 - REDRAW) * (1 - 2 * step), (1 - REDRAW) * step
    for j in range(len(source)):
        a = source[j]
        if a < 0:
            return j
        p = chance[j]
        if state < n_lanes and closed[state, t + 1] and (a != state or not closed[state, t]):
            p *= IN_CLOSED_DRAWN
        weight[j, 0] = p * stays * before[a, level]
        weight[j, 1] = p * moves * before[a, below]
        weight[j, 2] = p * moves * before[a, above]
        weight[j, 3] = p * REDRAW * sums[a] / n_levels
    return len(source)


@numba.njit(cache=True, nogil=True)
def _pick(weight: FloatArray, n: int, draw: float) -> int:
    """Number of the weight (n, 4), row by row, that a uniform random number falls to."""
    total = 0.0
    for j in range(n):
        for c in range(4):
            total += weight[j, c]
    left, chosen = draw * total, 0
    for j in range(n):
        for c in range(4):
            if weight[j, c] > 0:
                chosen = 4 * j + c
                left -= weight[j, c]
                if left <= 0:
                    return chosen
    return chosen


@numba.njit(cache=True, nogil=True)
def _weights(ways: Places, closed: BoolArray) -> FloatArray:
    """Weights (n,) of ways that were drawn as if vehicles entered closed ground more often than they do."""
    weights = np.ones(ways.shape[0])
    for i in range(ways.shape[0]):
        inside, entered = False, False
        for t in range(ways.shape[1]):
            on = ways[i, t] >= 0 and ways[i, t] % 3 == 0 and closed[ways[i, t] // 3, t]
            if on and not inside:  # a vehicle that found one stretch open finds the next one open, too
                weights[i] *= (1.0 if entered else IN_CLOSED) / IN_CLOSED_DRAWN
                entered = True
            inside = on
    return weights / weights.sum()
