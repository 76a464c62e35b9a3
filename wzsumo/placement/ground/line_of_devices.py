"""The line of devices drawn back, away from what vehicles sweep: the closed ground a bit smaller, the devices with its edge."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pandas as pd
import shapely

from wzsumo.frames import FloatArray
from wzsumo.road import Profile
from wzsumo.work_zone import ClosedStrip, Side, WorkZoneLayout

STATION_STEP_M = 0.5
SAMPLED_M = 0.25  # between points along the outline of a vehicle
KEPT_CLEAR_M = 0.1  # between what vehicles sweep and the line; chosen by us
EASED = 0.1  # m by which the line comes forward again in 1 m along the road; chosen by us
# At most this share of the ground's width is taken, where a taper is narrower than a lane of a lane's width; chosen by us.
LARGEST_SHARE = 0.5
Line = Literal["right", "left"]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Retreat:
    """One line of a strip as it was, and by how much [m] it is drawn back along its stations, into the strip."""

    line: Profile
    by: Profile
    into: float  # +1 where the strip lies to the left of its line, -1 to the right

    @property
    def moved(self) -> Profile:
        stations = np.union1d(self.line.stations, self.by.stations)
        return Profile(stations=stations, offsets=self.line(stations) + self.into * self.by(stations))


def drawn_back(layout: WorkZoneLayout, outlines: list[shapely.Geometry]) -> tuple[WorkZoneLayout, float]:
    """The layout whose lines of devices are drawn back from outlines of vehicles, and by how much at most [m].

    At most half of the ground is taken, in the narrow part of a taper at most half a lane: vehicles that reach farther still
    cover some of it.
    """
    boxes = np.array(outlines)
    middles = layout.road.to_sd(shapely.get_coordinates(shapely.centroid(boxes)))
    points, of_outline = shapely.get_coordinates(shapely.segmentize(boxes, SAMPLED_M), return_index=True)
    s, d = layout.road.to_sd(points)
    strips, retreats, farthest = [], [], 0.0
    for unmoved in layout.closed_strips:
        strip = unmoved
        middle = (strip.right(middles[0]) + strip.left(middles[0])) / 2
        for line in _lines_of_devices(layout, unmoved):
            beside = (middles[1] < middle) if line == "right" else (middles[1] > middle)
            retreat = _retreat(layout, unmoved, line, s[beside[of_outline]], d[beside[of_outline]])
            farthest = max(farthest, float(retreat.by.offsets.max()))
            moved = retreat.moved
            strip = replace(strip, right=moved) if line == "right" else replace(strip, left=moved)
            retreats.append(retreat)
        strips.append(strip)
    if farthest == 0.0:
        return layout, 0.0
    back = replace(layout, closed_strips=tuple(strips), devices=_moved_devices(layout, retreats))
    return _with_drivable(back), farthest


def _lines_of_devices(layout: WorkZoneLayout, strip: ClosedStrip) -> tuple[Line, ...]:
    """The lines of a strip that devices stand along: towards the lanes that stay open."""
    if strip.interior:
        return "right", "left"
    return ("right",) if _side_of(layout, strip) == "left" else ("left",)


def _side_of(layout: WorkZoneLayout, strip: ClosedStrip) -> Side:
    """The side of the road that a strip along its edge lies on."""
    outer = float(strip.left.offsets.max())
    return "left" if outer >= layout.road.own_width - 1e-6 and float(np.ptp(strip.left.offsets)) < 1e-6 else "right"


def _retreat(layout: WorkZoneLayout, strip: ClosedStrip, line: Line, s: FloatArray, d: FloatArray) -> _Retreat:
    """How far a line must be drawn back from points (n,) of vehicles beside it."""
    profile, into = (strip.right, 1.0) if line == "right" else (strip.left, -1.0)
    stations = np.linspace(strip.start, strip.end, max(round((strip.end - strip.start) / STATION_STEP_M), 1) + 1)
    step = stations[1] - stations[0]
    width = strip.left(stations) - strip.right(stations)
    over = into * (d - profile(s))
    there = (over > 0) & (s > strip.start - step) & (s < strip.end + step)
    by = np.zeros(len(stations))
    before = np.floor((s[there] - strip.start) / step).astype(int)
    for number in (before, before + 1):  # a point between two stations counts at both
        np.maximum.at(by, np.clip(number, 0, len(by) - 1), over[there] + KEPT_CLEAR_M)
    reach = int(by.max() / (EASED * step)) + 1
    eased = by
    for shift in range(1, reach):
        less = by - shift * step * EASED
        eased = np.maximum(eased, np.maximum(np.pad(less, (shift, 0))[: len(by)], np.pad(less, (0, shift))[shift:]))
    half_a_lane = LARGEST_SHARE * min(layout.road.lane_widths)
    most = np.maximum(LARGEST_SHARE * width, np.minimum(width, half_a_lane))
    return _Retreat(line=profile, by=Profile(stations=stations, offsets=np.clip(eased, 0.0, most)), into=into)


def _moved_devices(layout: WorkZoneLayout, retreats: list[_Retreat]) -> pd.DataFrame:
    """The devices, each moved with the line that it stands along."""
    devices = layout.devices.copy()
    s, d = devices["s_m"].to_numpy(), devices["d_m"].to_numpy()
    off = np.array([np.where(_is_beside(r, s), np.abs(d - r.line(s)), np.inf) for r in retreats])
    nearest = off.argmin(axis=0)
    by = np.array([r.into * r.by(s) for r in retreats])[nearest, np.arange(len(s))]
    slope = np.array([r.into * (r.by(s + 0.5) - r.by(s - 0.5)) for r in retreats])[nearest, np.arange(len(s))]
    by, slope = (np.where(np.isfinite(off.min(axis=0)), values, 0.0) for values in (by, slope))
    xy = layout.road.to_xy(s, d + by)
    turned = devices["heading_rad"] + np.where(devices["length_m"] > 0, np.arctan(slope), 0.0)
    return devices.assign(d_m=d + by, x_m=np.where(by == 0.0, devices["x_m"], xy[:, 0]),
                          y_m=np.where(by == 0.0, devices["y_m"], xy[:, 1]), heading_rad=turned)  # fmt: skip


def _is_beside(retreat: _Retreat, s: FloatArray) -> np.ndarray:
    first, last = retreat.by.stations[[0, -1]]
    return np.asarray((s >= first - 1e-6) & (s <= last + 1e-6))


def _with_drivable(layout: WorkZoneLayout) -> WorkZoneLayout:
    """The layout whose drivable ground reaches up to the strip along the road's edge, as far as the road has lanes."""
    for strip in layout.closed_strips:
        if strip.interior:
            continue
        if _side_of(layout, strip) == "left":
            offsets = np.minimum(strip.right.offsets, layout.road.own_width)
            return replace(layout, drivable_left=Profile(stations=strip.right.stations, offsets=offsets))
        offsets = np.maximum(strip.left.offsets, 0.0)
        return replace(layout, drivable_right=Profile(stations=strip.left.stations, offsets=offsets))
    return layout
