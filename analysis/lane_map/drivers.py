"""Where vehicles drive over a layout: lanes, lane changes, wander and speed, as tables of true stations and offsets."""

from dataclasses import dataclass, replace

import numpy as np
from layouts import Layout, smooth

from wzsumo.frames import FloatArray

MPH_MPS = 0.44704
HALF_VEHICLE_WIDTH_M = 0.93
DEVICE_GAP_M = 0.2  # that drivers keep between their side and the devices
GRID_M = 2.0
LATEST_IN_TAPER = 0.5  # share of the taper at which the latest driver would like to leave it
SPEED_SD, SPEED_LENGTH_M = 0.03, 300.0  # slow changes of a driver's speed


@dataclass(frozen=True, kw_only=True)
class Traffic:
    """How drivers use the lanes and where in them they drive.

    `lane_evenness` is the Dirichlet parameter of the lanes' shares, by seed. Lengths along the road in metres: of lane changes,
    ahead of a taper where drivers leave a closing lane at the earliest, and the mean behind it where some go back to their
    lane. Across it: standard deviations of a driver's habit, and of the wander, by driver and correlated over `wander_along`.
    """

    changes_per_km: float = 0.3
    lane_evenness: float = 4.0
    ramp_share: float = 0.3
    speed_factor: float = 1.0
    partial_share: float = 0.0  # of the vehicles, whose trips begin or end on the way
    habit: float = 0.15
    wander: tuple[float, float] = (0.25, 0.35)
    wander_along: float = 60.0
    change: tuple[float, float] = (60.0, 110.0)
    leaves_ahead: float = 500.0
    returning_share: float = 0.5
    returns_after: float = 300.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """True stations `s`, offsets `d` [m] and times `t` [s] (n,) of one vehicle."""

    t: FloatArray
    s: FloatArray
    d: FloatArray


def lane_shares(layout: Layout, traffic: Traffic, *, seed: int) -> FloatArray:
    """Shares (lanes,) of the vehicles that come in each lane, at least 0.08 each."""
    drawn = np.random.default_rng([seed, 1_000_003]).dirichlet(np.full(layout.lanes, traffic.lane_evenness))
    raised = np.maximum(drawn, 0.08)
    return np.asarray(raised / raised.sum())


def drive(layout: Layout, traffic: Traffic, *, seed: int, number: int) -> Drive:
    """The drive of vehicle `number`; the first of more vehicles are the same vehicles."""
    random = np.random.default_rng([seed, number])
    s = np.arange(-20.0, layout.length + 20.0 + GRID_M, GRID_M)
    lane = int(random.choice(layout.lanes, p=lane_shares(layout, traffic, seed=seed)))
    wander = _wander(traffic, s, random)
    uses_ramp = layout.ramp is not None and random.random() < traffic.ramp_share
    d = _over_ramp(layout, traffic, s, wander, random) if uses_ramp else _through(layout, traffic, s, lane, wander, random)
    d = _kept_clear(layout, d, s)
    speed = layout.speed_mph * MPH_MPS * traffic.speed_factor * random.normal(0.97, 0.06)
    t = _times(s, speed, random) + 15.0 * number + random.uniform(0.0, 10.0)
    kept = (s >= 0) & (s <= layout.length)
    if random.random() < traffic.partial_share:
        begin = random.uniform(-0.25, 0.7) * layout.length
        kept &= (s >= begin) & (s <= begin + random.uniform(0.3, 0.8) * layout.length)
    return Drive(t=t[kept], s=s[kept], d=d[kept])


def work_truck(layout: Layout, *, seed: int, number: int, stands_s: float = 300.0) -> Drive:
    """A maintenance truck that drives on in the closed lane past the devices, slows down, stands there, and drives on."""
    random = np.random.default_rng([seed, number, 7])
    closure = layout.closures[-1]
    s = np.arange(0.0, layout.length, GRID_M)
    lane = closure.last if closure.side != "right" else closure.first
    d = layout.lane_middle(lane, s) + 0.5 * _wander(Traffic(), s, random)
    inside = (s > closure.at[0]) & (s < closure.at[3])
    speed = np.where(inside, 9.0, 0.9 * layout.speed_mph * MPH_MPS)
    t = np.r_[0.0, np.cumsum(GRID_M / speed[1:])]
    stop = closure.at[1] + random.uniform(0.2, 0.8) * (closure.at[2] - closure.at[1])
    at = int(np.searchsorted(s, stop))
    t[at:] += stands_s
    t, s, d = (np.insert(x, at, y) for x, y in ((t, t[at] - 0.1), (s, s[at] - 0.05), (d, d[at])))
    return Drive(t=t + 15.0 * number, s=s, d=d)


def _through(
    layout: Layout, traffic: Traffic, s: FloatArray, lane: int, wander: FloatArray, random: np.random.Generator
) -> FloatArray:
    """Offsets (n,) [m] of a vehicle that comes in `lane` and stays on the main road."""
    lanes = np.full(len(s), float(lane))
    for at in _discretionary(traffic, s, random):
        now = round(float(np.interp(at, s, lanes)))
        other = now + int(random.choice([-1, 1]))
        if 0 <= other < layout.lanes and not any(
            layout.is_blocked(other, ahead) for ahead in np.arange(at, at + traffic.leaves_ahead, 20.0)
        ):
            lanes = _changed(lanes, s, at, other, random.uniform(*traffic.change))
    for closure in sorted(layout.closures, key=lambda one: one.at[0]):
        begin = closure.at[0]
        now = round(float(np.interp(begin, s, lanes)))
        if closure.first <= now <= closure.last:
            goal = _open_lane_beside(layout, closure.first, closure.last, begin, random)
            lanes = _left(layout, traffic, lanes, s, goal, closure.at, wander, random)
    if layout.closures and random.random() < traffic.returning_share:
        lanes = _changed(lanes, s, _returns_at(layout, traffic, random), lane, random.uniform(*traffic.change))
    return layout.lane_middle(lanes, s) + wander


def _returns_at(layout: Layout, traffic: Traffic, random: np.random.Generator) -> float:
    """Station [m] at which a vehicle goes back to the lane that it came in, behind the end of all closures."""
    return max(closure.at[3] for closure in layout.closures) + float(random.exponential(traffic.returns_after))


def _discretionary(traffic: Traffic, s: FloatArray, random: np.random.Generator) -> FloatArray:
    """Stations (n,) [m] in order at which a vehicle changes lanes though nothing forces it to, at least 250 m apart."""
    length = float(s[-1] - s[0])
    places = np.sort(random.uniform(s[0], s[-1] - 120.0, random.poisson(traffic.changes_per_km * length / 1000.0)))
    return places[np.diff(places, prepend=-np.inf) > 250.0]


def _changed(lanes: FloatArray, s: FloatArray, start: float, goal: float, length: float) -> FloatArray:
    """Lanes (n,) with a change to lane `goal` that begins at station `start`; later changes are gone."""
    now = np.where(s <= start, lanes, np.interp(start, s, lanes))
    return np.asarray(now + (goal - now) * smooth((s - start) / length))


def _open_lane_beside(layout: Layout, first: int, last: int, at: float, random: np.random.Generator) -> int:
    beside = [lane for lane in (first - 1, last + 1) if 0 <= lane < layout.lanes and not layout.is_blocked(lane, at)]
    return int(random.choice(beside))


def _left(
    layout: Layout,
    traffic: Traffic,
    lanes: FloatArray,
    s: FloatArray,
    goal: int,
    at: tuple[float, float, float, float],
    wander: FloatArray,
    random: np.random.Generator,
) -> FloatArray:
    """Lanes (n,) of a vehicle that leaves a closing lane at a random place, earlier where the devices leave no room."""
    length = random.uniform(*traffic.change) * abs(goal - round(float(np.interp(at[0], s, lanes))))
    start = random.uniform(at[0] - traffic.leaves_ahead, at[0] + LATEST_IN_TAPER * (at[1] - at[0]))
    beside = (s >= at[0]) & (s <= at[1] + 10.0)
    while True:
        tried = _changed(lanes, s, start, goal, length)
        room = layout.room(layout.lane_middle(tried, s) + np.minimum(np.abs(wander), 0.3) * np.sign(wander), s)
        if (room[beside] > HALF_VEHICLE_WIDTH_M + DEVICE_GAP_M).all() or start < at[0] - traffic.leaves_ahead:
            return tried
        start -= 10.0


def _over_ramp(layout: Layout, traffic: Traffic, s: FloatArray, wander: FloatArray, random: np.random.Generator) -> FloatArray:
    """Offsets (n,) [m] of a vehicle that comes from or leaves by the ramp."""
    ramp = layout.ramp
    assert ramp is not None
    begin, end = ramp.span
    length = min(random.uniform(*traffic.change), end - begin)  # a short opening is passed in a short change
    start = random.uniform(begin, end - length)
    share = smooth((s - start) / length)
    lanes = -share if ramp.leaves else share - 1.0
    return layout.lane_middle(lanes, s) + wander


def _kept_clear(layout: Layout, d: FloatArray, s: FloatArray) -> FloatArray:
    """Offsets (n,) [m] of a vehicle that keeps clear of devices; outside the zone it keeps to its lane alone."""
    bare = replace(layout, closures=(), ramp=None)
    gap = HALF_VEHICLE_WIDTH_M + DEVICE_GAP_M
    (right, left), (bare_right, bare_left) = layout.edges(s), bare.edges(s)
    d = np.where(left < bare_left - 0.01, np.minimum(d, left - gap), d)
    d = np.where(right > bare_right + 0.01, np.maximum(d, right + gap), d)
    hole_right, hole_left = layout.hole(s)
    there = hole_left > hole_right
    pushed = np.where(d < (hole_right + hole_left) / 2, np.minimum(d, hole_right - gap), np.maximum(d, hole_left + gap))
    return np.where(there, pushed, d)


def _wander(traffic: Traffic, s: FloatArray, random: np.random.Generator) -> FloatArray:
    """A driver's offset (n,) [m] from the lane's middle: a constant habit and a Gauss-Markov series about it."""
    habit = traffic.habit * random.standard_normal()
    return habit + random.uniform(*traffic.wander) * gauss_markov(s, traffic.wander_along, random)


def gauss_markov(at: FloatArray, scale: float, random: np.random.Generator) -> FloatArray:
    """Gauss-Markov series (n,) of unit variance at places or times `at`, correlated by exp(-distance / scale)."""
    keep = np.exp(-np.diff(at, prepend=at[0]) / scale)
    new = np.sqrt(1.0 - keep**2) * random.standard_normal(len(at))
    value = random.standard_normal()
    out = np.empty(len(at))
    for i, (rho, step) in enumerate(zip(keep.tolist(), new.tolist(), strict=True)):
        value = rho * value + step
        out[i] = value
    return out


def _times(s: FloatArray, speed: float, random: np.random.Generator) -> FloatArray:
    """Times (n,) [s] at stations s, from 0."""
    speeds = speed * np.clip(1.0 + SPEED_SD * gauss_markov(s, SPEED_LENGTH_M, random), 0.5, 1.5)
    return np.r_[0.0, np.cumsum(np.diff(s) / speeds[1:])]
