"""Synthetic traces of drivers through work zones that are laid out by the MUTCD, and the truth beside them."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from shapely.geometry.base import BaseGeometry

from wzsumo.frames import FloatArray
from wzsumo.mutcd.layout import lay_out
from wzsumo.road import Bend, RoadSpec
from wzsumo.sensing.gnss import GnssSpec, report
from wzsumo.work_zone import WorkZone, WorkZoneLayout


@dataclass(frozen=True, kw_only=True)
class Zone:
    """True traces of a fleet through a zone, the area that is drivable, and the stations [m] of its first and last device."""

    traces: pd.DataFrame
    drivable: BaseGeometry
    layout: WorkZoneLayout
    start: float
    end: float


def zone_layout(
    *, lanes: int = 2, closed: tuple[int, ...] = (1,), bend: bool = False, shift_ft: float = 10.0
) -> WorkZoneLayout:
    """The layout of a zone of 60 mph on lanes of 12 ft, straight or with a bend to the left of 3500 ft."""
    alignment = (
        (Bend(length_ft=1500), Bend(length_ft=700, end_radius_ft=3500), Bend(length_ft=4800, radius_ft=3500))
        if bend
        else (Bend(length_ft=7000),)
    )
    road = RoadSpec(lane_count=lanes, lane_width_ft=12, left_shoulder_ft=10, right_shoulder_ft=12, alignment=alignment).build()
    zone = WorkZone(posted_speed_mph=60, start_ft=1300, closed_lanes=closed, shift_ft=shift_ft, work_length_ft=650)
    return lay_out(zone, road)


def drive(
    layout: WorkZoneLayout, n: int, *, seed: int, wander_sd: float = 0.06, habit_sd: float = 0.2, step_s: float = 0.2
) -> Zone:
    """Drivers on the lanes of a layout: those in a closing lane merge somewhere from 250 m ahead of the taper to its end."""
    random = np.random.default_rng(seed)
    road = layout.road
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
        d = _lane_middle(layout, lane, s) if lane not in closed else np.zeros_like(s)
        if lane in closed:
            # From the outermost lane inwards, one merge per closed lane.
            inwards = sorted((c for c in closed if (c <= lane if left else c >= lane)), reverse=left)
            d = np.full_like(s, road.lane_centre(lane))
            order = sorted(closed, reverse=left)
            for current in inwards:
                taper = tapers[order.index(current)]
                target = current - 1 if left else current + 1
                length = speed * random.uniform(3, 5)
                latest = taper.start + 0.55 * taper.length - length
                begin = max(latest - random.exponential(90.0), s_begin + 20)
                goal = _lane_middle(layout, target, s) if target not in closed else np.full_like(s, road.lane_centre(target))
                d = d + _smooth_step((s - begin) / length) * (goal - d)
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


def noisy(zone: Zone, error_m: float, *, seed: int, interval_s: float = 0.1) -> pd.DataFrame:
    """The zone's traces as receivers with a GNSS error [m] report them."""
    return report(zone.traces, spec=GnssSpec(error_m=error_m, sampling_interval_s=interval_s), seed=seed)


def _smooth_step(t: FloatArray) -> FloatArray:
    t = np.clip(t, 0, 1)
    return np.asarray(t * t * (3 - 2 * t))


def _lane_middle(layout: WorkZoneLayout, lane: int, s: FloatArray) -> FloatArray:
    """Offsets (n,) [m] of the middle of a lane that goes through, with kinks as drivers round them off."""
    for open_lane in layout.lanes:
        if open_lane.index == lane and open_lane.start <= 0.0 and open_lane.end >= layout.road.length - 1e-6:
            return _rounded_off((open_lane.right(s) + open_lane.left(s)) / 2, s)
    raise KeyError(lane)


def _rounded_off(d: FloatArray, s: FloatArray) -> FloatArray:
    """Offsets (n,) [m] whose kinks are spread over some 30 m."""
    width = max(1, round(30 / np.diff(s).mean()))
    kernel = np.hanning(width + 2)[1:-1]
    padded = np.pad(d, width, mode="edge")
    return np.asarray(np.convolve(padded, kernel / kernel.sum(), mode="same")[width:-width])
