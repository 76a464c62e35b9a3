"""A zone's layout in other states than the manual's: taken away, its devices pushed into the lane, the road closed."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.mutcd.spacing import DEVICE_SIZE_M
from wzsumo.road import Profile
from wzsumo.work_zone import DEVICE_COLUMNS, ClosedStrip, DeviceKind, OpenLane, WorkZoneLayout

ACROSS_SPACING_M = 2.0  # of devices across a closed road: no vehicle fits between two. Chosen by us
RAMP_M = 15.0  # from the last device that stands to the first that was pushed; chosen by us


def without_zone(layout: WorkZoneLayout) -> WorkZoneLayout:
    """The road of a layout with every lane open; `areas` still say where the zone stood."""
    road = layout.road
    spans = [road.lane_span(number) for number in range(len(road.lane_widths))]
    lanes = tuple(
        OpenLane(index=number, start=0.0, end=road.length, right=_level(right, road.length), left=_level(left, road.length),
                 opposing=number >= road.own_lanes)
        for number, (right, left) in enumerate(spans)
    )  # fmt: skip
    return replace(
        layout, lanes=lanes, drivable_right=_level(0.0, road.length), drivable_left=_level(road.own_width, road.length),
        closed_strips=(), devices=layout.devices.iloc[:0], signs=layout.signs.iloc[:0], taking_turns=None,
    )  # fmt: skip


def with_road_closed(layout: WorkZoneLayout, station: float) -> WorkZoneLayout:
    """The layout with a row of drums across all lanes at a station [m], and closed ground from there to the road's end.

    `lanes` stay as they are: traffic leaves the road ahead of the row. Raises SpecError where the row is not on the road.
    """
    road = layout.road
    if not 0 < station < road.length:
        raise SpecError(f"the road cannot be closed at {station:.0f} m: it is {road.length:.0f} m long")
    low, high = -road.right_shoulder, road.left_edge
    height, radius = DEVICE_SIZE_M[DeviceKind.DRUM]
    d = np.linspace(low + radius, high - radius, max(2, int(np.ceil((high - low) / ACROSS_SPACING_M))))
    x, y = road.to_xy(np.full_like(d, station), d).T
    row = pd.DataFrame({
        "kind": DeviceKind.DRUM, "s_m": station, "d_m": d, "x_m": x, "y_m": y, "heading_rad": float(road.heading_at(station)),
        "height_m": height, "radius_m": radius, "length_m": 0.0,
    })[list(DEVICE_COLUMNS)]  # fmt: skip
    strip = ClosedStrip(
        start=station, end=road.length, right=_level(low, road.length), left=_level(high, road.length), interior=True
    )
    standing = layout.devices[layout.devices["s_m"] < station]
    devices = pd.concat([standing, row], ignore_index=True) if len(standing) else row
    return replace(layout, closed_strips=(*layout.closed_strips, strip), devices=devices)


def with_devices_pushed(layout: WorkZoneLayout, first: float, last: float, *, by: float) -> WorkZoneLayout:
    """The layout with the devices between two stations [m] pushed by so many metres into the lane beside them.

    The closed ground follows them, and so does the line of the open lane beside, over RAMP_M at either end.
    Raises SpecError where the zone does not close one side of the road along all of that stretch.
    """
    strip = next((q for q in layout.closed_strips if not q.interior and q.start < first < last < q.end), None)
    if strip is None or len(layout.closed_strips) > 1:
        raise SpecError(f"no closed side along {first:.0f} to {last:.0f} m whose devices could be pushed")
    middle = (first + last) / 2
    on_left = float(strip.right(middle) + strip.left(middle)) > layout.road.own_width
    ahead, behind = first - RAMP_M, last + RAMP_M

    def pushed(line: Profile) -> Profile:
        s = np.unique(np.concatenate([line.stations, [ahead, first, last, behind]]))
        return Profile(stations=s, offsets=line(s) + aside(s))

    def aside(s: FloatArray) -> FloatArray:
        return np.interp(s, [ahead, first, last, behind], [0.0, by, by, 0.0]) * (-1 if on_left else 1)

    lanes = tuple(_pushed_lane(lane, strip, middle, on_left=on_left, pushed=pushed) for lane in layout.lanes)
    devices = layout.devices.copy()
    s = devices["s_m"].to_numpy()
    devices["d_m"] += aside(s)
    devices[["x_m", "y_m"]] = layout.road.to_xy(s, devices["d_m"].to_numpy())
    moved = replace(strip, right=pushed(strip.right)) if on_left else replace(strip, left=pushed(strip.left))
    return replace(
        layout, lanes=lanes, devices=devices, closed_strips=(moved,),
        drivable_right=layout.drivable_right if on_left else pushed(layout.drivable_right),
        drivable_left=pushed(layout.drivable_left) if on_left else layout.drivable_left,
    )  # fmt: skip


def _pushed_lane(
    lane: OpenLane, strip: ClosedStrip, at: float, *, on_left: bool, pushed: Callable[[Profile], Profile]
) -> OpenLane:
    """The lane with the line that the devices stand along pushed; other lanes are as they were."""
    line, edge = (lane.left, strip.right) if on_left else (lane.right, strip.left)
    if lane.opposing or not lane.start < at < lane.end or abs(float(line(at)) - float(edge(at))) > 0.5:
        return lane
    return replace(lane, left=pushed(line)) if on_left else replace(lane, right=pushed(line))


def _level(offset: float, length: float) -> Profile:
    return Profile(stations=np.array([0.0, length]), offsets=np.array([offset, offset]))
