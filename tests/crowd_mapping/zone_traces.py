"""Synthetic traces through work zones, two families: drivers on a MUTCD layout, and free curves with a drifting error."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from shapely.geometry.base import BaseGeometry

from wzsumo.mutcd.layout import lay_out
from wzsumo.road import Bend, Road, RoadSpec
from wzsumo.sensing.gnss import GnssSpec, report
from wzsumo.work_zone import WorkZone, WorkZoneLayout


@dataclass(frozen=True, kw_only=True)
class Zone:
    """True traces of a fleet through a zone, and the truth."""

    traces: pd.DataFrame
    drivable: BaseGeometry
    layout: WorkZoneLayout
    start: float
    end: float


def smooth_step(t):
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def zone_layout(*, lanes=2, closed=(1,), bend=False, shift_ft=10.0, tangent_ft=None, width_ft=12.0, speed_mph=60.0):
    alignment = (
        (Bend(length_ft=1500), Bend(length_ft=700, end_radius_ft=3500), Bend(length_ft=4800, radius_ft=3500))
        if bend
        else (Bend(length_ft=7000),)
    )
    road = RoadSpec(
        lane_count=lanes, lane_width_ft=width_ft, left_shoulder_ft=10, right_shoulder_ft=12, alignment=alignment
    ).build()
    zone = WorkZone(
        posted_speed_mph=speed_mph,
        start_ft=1300,
        closed_lanes=closed,
        shift_ft=shift_ft,
        work_length_ft=650,
        taper_tangent_ft=tangent_ft,
    )
    return lay_out(zone, road)


def drive(layout, n, *, seed, wander_sd=0.06, habit_sd=0.2, step_s=0.2):
    """Drivers on the lanes of a layout: closed-lane drivers merge somewhere from 250 m ahead of the taper to its end."""
    random = np.random.default_rng(seed)
    road: Road = layout.road
    tapers = [a for a in layout.areas if a.name.startswith("merging taper")]
    closed = set(layout.work_zone.closed_lanes)
    open_lanes = [i for i in range(len(road.lane_widths)) if i not in closed]
    left = max(closed, default=-1) > max(open_lanes)
    s_end = min(layout.end + 150, road.length - 5)
    s_begin = max(layout.start - 350, 5.0)
    parts = []
    for i in range(n):
        lane = int(random.integers(len(road.lane_widths)))
        speed = random.uniform(18, 28)
        s = np.arange(s_begin + random.uniform(0, 3), s_end, speed * step_s)
        d = lane_centre(layout, lane if lane not in closed else None, s) if lane not in closed else np.zeros_like(s)
        if lane in closed:
            # From the outermost inwards, one merge per closed lane.
            inwards = sorted((c for c in closed if (c <= lane if left else c >= lane)), reverse=left)
            d = np.full_like(s, road.lane_centre(lane))
            order = sorted(closed, reverse=left)
            for current in inwards:
                taper = tapers[order.index(current)]
                target = current - 1 if left else current + 1
                length = speed * random.uniform(3, 5)
                latest = taper.start + 0.55 * taper.length - length
                begin = max(latest - random.exponential(90.0), s_begin + 20)
                goal = lane_centre(layout, target, s) if target not in closed else np.full_like(s, road.lane_centre(target))
                d = d + smooth_step((s - begin) / length) * (goal - d)
        wander = wander_sd * np.cumsum(random.standard_normal(len(s))) * np.sqrt(step_s)
        wander -= wander.mean()
        xy = road.to_xy(s, d + habit_sd * random.standard_normal() + wander)
        parts.append(
            pd.DataFrame({"vehicle_id": f"v{i}", "time_s": np.arange(len(s)) * step_s, "x_m": xy[:, 0], "y_m": xy[:, 1]})
        )
    return Zone(
        traces=pd.concat(parts, ignore_index=True),
        drivable=layout.drivable_between(s_begin, layout.end),
        layout=layout,
        start=layout.start,
        end=layout.end,
    )


def lane_centre(layout, lane, s):
    for open_lane in layout.lanes:
        if open_lane.index == lane and open_lane.start <= 0.0 and open_lane.end >= layout.road.length - 1e-6:
            return smooth((open_lane.right(s) + open_lane.left(s)) / 2, s)
    raise KeyError(lane)


def smooth(d, s):
    """Drivers round off the kinks of lane lines over some 30 m."""
    width = max(1, round(30 / np.diff(s).mean()))
    kernel = np.hanning(width + 2)[1:-1]
    padded = np.pad(d, width, mode="edge")
    return np.convolve(padded, kernel / kernel.sum(), mode="same")[width:-width]


def noisy(zone, error_m, *, seed, interval_s=0.1):
    return report(zone.traces, spec=GnssSpec(error_m=error_m, sampling_interval_s=interval_s), seed=seed)


def drive_like_a_simulator(layout, n, *, seed, step_s=0.1, upstream=(150.0, 550.0), overtaking=0.2, jam=False):
    """The other family: vehicles on exact lane centres with kinks, quick straight lane changes far ahead of the taper.

    Some change to a neighbouring lane and back on the way up; in a jam they creep for a while, so that fixes bunch.
    """
    random = np.random.default_rng(seed + 1000)
    road: Road = layout.road
    tapers = [a for a in layout.areas if a.name.startswith("merging taper")]
    closed = sorted(layout.work_zone.closed_lanes)
    count = len(road.lane_widths)
    left = bool(closed) and closed[-1] == count - 1
    order = closed[::-1] if left else closed
    s_begin, s_end = max(layout.start - 350, 5.0), min(layout.end + 150, road.length - 5)
    middle = {
        lane.index: (lane.right, lane.left) for lane in layout.lanes if lane.start <= 0.0 and lane.end >= road.length - 1e-6
    }
    parts = []
    for i in range(n):
        speed, lane = random.uniform(20, 29), int(random.integers(count))
        time = np.arange(0, 600, step_s)
        pace = np.full(len(time), speed)
        if jam:
            pace[(time > random.uniform(3, 8)) & (time < random.uniform(15, 30))] = 2.0
        s = s_begin + random.uniform(0, 30) + np.cumsum(pace) * step_s
        s = s[s < s_end]
        place = np.full(len(s), float(lane))
        if random.random() < overtaking and lane not in closed:
            other = lane + (1 if lane + 1 < count and lane + 1 not in closed else -1)
            if 0 <= other < count and other not in closed:
                at = s_begin + random.uniform(20, 60)
                place += (other - lane) * (np.clip((s - at) / 45, 0, 1) - np.clip((s - at - 120) / 45, 0, 1))
        current = lane
        while current in closed:
            target = current - 1 if left else current + 1
            taper = tapers[order.index(current)]
            at = max(taper.end - random.uniform(*upstream), s_begin + 5, s[0])
            place += (target - current) * np.clip((s - at) / random.choice([2.0, 60.0]), 0, 1)
            current = target
        d = np.interp(place, np.arange(count), [road.lane_centre(k) for k in range(count)])
        inside = np.array([np.interp(s, *((p.stations, p.offsets))) for pair in middle.values() for p in pair])
        lanes = np.array(list(middle))
        centres = (inside[0::2] + inside[1::2]) / 2
        for row, k in zip(centres, lanes, strict=True):
            d += (row - road.lane_centre(k)) * np.clip(1 - np.abs(place - k), 0, 1)
        xy = road.to_xy(s, d)
        parts.append(pd.DataFrame({"vehicle_id": f"m{i}", "time_s": time[: len(s)], "x_m": xy[:, 0], "y_m": xy[:, 1]}))
    return Zone(
        traces=pd.concat(parts, ignore_index=True),
        drivable=layout.drivable_between(s_begin, layout.end),
        layout=layout,
        start=layout.start,
        end=layout.end,
    )
