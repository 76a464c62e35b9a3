"""The layouts of the kinds: for each a function from a random generator to a Layout, so that each seed has another one.

Drawn for every layout: the frame (heading near a quarter turn, so that nothing is parallel to the axes and the map stays
slim), lane widths of 11 to 12 ft, the station of the first device and the length of the closed part. Tapers have the length
that the manual asks for from 45 mph on (width in ft times speed in mph), unless a kind says otherwise.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from alignment import Alignment
from layouts import Closure, Layout, Move, Ramp

FOOT_M = 0.3048
OPENING_M = 30.48  # downstream taper of a lane, 100 ft
Random = np.random.Generator
Side = Literal["left", "right"]
Pieces = tuple[tuple[float, float], ...]


def _road(random: Random, *, length: float, lanes: int, pieces: Pieces | None = None, speed_mph: float = 60.0) -> Layout:
    """An open road with a frame and a lane width of its own."""
    most = min(0.14, 150.0 / length)  # long roads stay near an axis, for the sake of the map's size
    heading = np.pi / 2 * random.integers(4) + random.choice([-1, 1]) * random.uniform(0.25 * most, most)
    pose = (*random.uniform(-2000.0, 2000.0, 2).tolist(), float(heading))
    width = float(random.choice([11.0, 11.5, 12.0])) * FOOT_M
    alignment = Alignment(pieces=pieces or ((length, 0.0),), pose=pose)
    zone = (0.3 * length, 0.7 * length)
    return Layout(alignment=alignment, length=length, lanes=lanes, width=width, speed_mph=speed_mph, announced=zone)


def _taper(layout: Layout, lanes: int = 1) -> float:
    """Length [m] of a merging taper over some lanes: the lanes' width [ft] times the speed [mph], in feet."""
    return layout.width * lanes * layout.speed_mph


def none(random: Random, *, length: float = 1500.0, lanes: int = 2, pieces: Pieces | None = None) -> Layout:
    """An ordinary road with a zone announced in which nothing is closed, or only a shoulder."""
    return _road(random, length=length, lanes=lanes, pieces=pieces)


def closed(
    random: Random,
    *,
    side: Side = "left",
    lanes: int = 2,
    count: int = 1,
    length: float = 1500.0,
    pieces: Pieces | None = None,
    taper_factor: float = 1.0,
    work: tuple[float, float] = (500.0, 750.0),
) -> Layout:
    """`count` lanes closed on a side by one taper each, one directly after the other."""
    layout = _road(random, length=length, lanes=lanes, pieces=pieces)
    start = random.uniform(0.18, 0.24) * length
    taper = taper_factor * _taper(layout, count)
    end = start + taper + random.uniform(*work)
    at = (start, start + taper, end, end + OPENING_M * count)
    first = lanes - count if side == "left" else 0
    closure = Closure(first=first, last=first + count - 1, side=side, at=at)
    return replace(layout, closures=(closure,), announced=(at[0], at[3]))


def middle(random: Random) -> Layout:
    """The middle one of three lanes closed: traffic passes on both sides."""
    layout = _road(random, length=1500.0, lanes=3)
    start = random.uniform(280.0, 360.0)
    taper = _taper(layout) / 2  # each side moves over by half a lane
    end = start + taper + random.uniform(500.0, 750.0)
    at = (start, start + taper, end, end + OPENING_M)
    return replace(layout, closures=(Closure(first=1, last=1, side="middle", at=at),), announced=(at[0], at[3]))


def double(random: Random, *, side: Side = "left", gap_share: tuple[float, float] = (0.2, 1.6)) -> Layout:
    """Two of three lanes closed by two tapers; the manual asks for 2 L between them, here it is a random share of L."""
    layout = _road(random, length=1900.0, lanes=3)
    taper = _taper(layout)
    first = random.uniform(280.0, 360.0)
    second = first + taper * (1.0 + random.uniform(*gap_share))
    end = second + taper + random.uniform(350.0, 500.0)
    outer, inner = (2, 1) if side == "left" else (0, 1)
    closures = (
        Closure(first=outer, last=outer, side=side, at=(first, first + taper, end + OPENING_M, end + 2 * OPENING_M)),
        Closure(first=inner, last=inner, side=side, at=(second, second + taper, end, end + OPENING_M)),
    )
    return replace(layout, closures=closures, announced=(first, end + 2 * OPENING_M))


def shift(random: Random, *, lanes: int = 2) -> Layout:
    """All lanes stay open and are shifted by 2.4 to 3 m on to the right shoulder, or on to the left one."""
    layout = _road(random, length=1500.0, lanes=lanes)
    size = float(random.uniform(2.4, 3.0) * random.choice([-1, 1]))
    ramp = abs(size) * layout.speed_mph / 2
    start = random.uniform(300.0, 380.0)
    back = start + ramp + random.uniform(500.0, 750.0)
    move = Move(size=size, at=(start, start + ramp, back, back + ramp))
    return replace(layout, moves=(move,), announced=(start, back + ramp), left_shoulder_ft=10.0)


def closed_and_shifted(random: Random, *, side: Side = "left", pieces: Pieces | None = None) -> Layout:
    """One lane closed; the open ones are shifted away from the work, after a tangent of half a taper."""
    layout = closed(random, side=side, pieces=pieces, work=(700.0, 800.0))
    at = layout.closures[0].at
    size = 2.4 if side == "right" else -2.4
    ramp = abs(size) * layout.speed_mph / 2
    begin = at[1] + _taper(layout) / 2
    move = Move(size=size, at=(begin, begin + ramp, at[2] - ramp, at[2]))
    return replace(layout, moves=(move,), left_shoulder_ft=10.0)


def narrowed(random: Random) -> Layout:
    """One lane closed on the left, the open ones narrowed from 12 to 11 ft along the taper."""
    layout = replace(closed(random, lanes=3), width=12 * FOOT_M)
    at = layout.closures[0].at
    return replace(layout, narrowed=(11 * FOOT_M, at))


def crossover(random: Random, *, open_lanes: int = 1) -> Layout:
    """One or two lanes moved by 15 to 20 m to the left on to the other carriageway, and back; of two, one closes before."""
    layout = _road(random, length=1900.0, lanes=2)
    size = float(random.uniform(15.0, 20.0))
    start = random.uniform(280.0, 360.0)
    taper = _taper(layout) if open_lanes == 1 else 0.0
    over = start + taper + 60.0
    curves = random.uniform(180.0, 240.0)
    back = over + curves + random.uniform(450.0, 600.0)
    move = Move(size=size, at=(over, over + curves, back, back + curves), smooth_curves=True)
    end = back + curves + 30.0
    closures: tuple[Closure, ...] = ()
    if open_lanes == 1:
        at = (start, start + taper, end, end + OPENING_M)
        closures = (Closure(first=0, last=0, side="right", at=at),)
    return replace(layout, moves=(move,), closures=closures, announced=(start, end + OPENING_M))


def ramp(random: Random, *, leaves: bool, zone: bool = False, pieces: Pieces | None = None) -> Layout:
    """A ramp on the right of two lanes, nothing closed; or inside a zone that closes the left one."""
    layout = closed(random, pieces=pieces) if zone else none(random, pieces=pieces)
    gore = 900.0 if leaves else 500.0
    return replace(layout, ramp=Ramp(gore=gore + float(random.uniform(-50, 50)), leaves=leaves))


def _bend(length: float, radius: float) -> Pieces:
    return ((0.15 * length, 0.0), (0.85 * length, 1 / radius))


def _s_bend(length: float, radius: float) -> Pieces:
    part = length / 5
    return ((part, 0.0), (part, 1 / radius), (part, -1 / radius), (part, 1 / radius), (part, 0.0))


LAYOUTS: dict[str, Callable[[Random], Layout]] = {
    "none": none,
    "none_r900": partial(none, pieces=_bend(1500, -900)),
    "none_6_lanes": partial(none, lanes=6),
    "none_short": partial(none, length=100.0),
    "left": closed,
    "right": partial(closed, side="right"),
    "left_r900": partial(closed, pieces=_bend(1500, 900)),
    "right_r900": partial(closed, side="right", pieces=_bend(1500, 900)),
    "left_r400": partial(closed, pieces=_bend(1500, -400)),
    "left_s_bend": partial(closed, pieces=_s_bend(1500, 600)),
    "left_3": partial(closed, lanes=3),
    "right_4": partial(closed, side="right", lanes=4),
    "left_6": partial(closed, lanes=6),
    "left_2_of_4": partial(closed, lanes=4, count=2, work=(350.0, 500.0)),
    "half_taper": partial(closed, taper_factor=0.5),
    "double_taper": partial(closed, taper_factor=2.0, work=(350.0, 500.0)),
    "short": partial(closed, length=700.0, work=(120.0, 180.0)),
    "long": partial(closed, length=20_000.0, work=(5000.0, 6000.0)),
    "middle": middle,
    "double": double,
    "double_right": partial(double, side="right"),
    "shift": shift,
    "shift_3": partial(shift, lanes=3),
    "left_shift": closed_and_shifted,
    "left_shift_r900": partial(closed_and_shifted, pieces=_bend(1500, -900)),
    "right_shift": partial(closed_and_shifted, side="right"),
    "shoulder": partial(none, lanes=3),
    "narrowed": narrowed,
    "crossover": crossover,
    "crossover_2": partial(crossover, open_lanes=2),
    "on_ramp": partial(ramp, leaves=False),
    "off_ramp": partial(ramp, leaves=True),
    "exit_in_zone": partial(ramp, leaves=True, zone=True),
}
