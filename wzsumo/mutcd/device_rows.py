"""The channelizing devices along the lines of a zone."""

import numpy as np
import pandas as pd

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.mutcd.closure import Closure
from wzsumo.mutcd.sequence import Stretch
from wzsumo.mutcd.spacing import BARRIER_SEGMENT_FT, DEVICE_SIZE_M, device_gaps
from wzsumo.road import Profile
from wzsumo.units import METRES_PER_FOOT
from wzsumo.work_zone import DEVICE_COLUMNS, Area, DeviceKind, WorkZone

# Offsets e of a line, and the side of it on which the closed ground lies: +1 towards greater e, -1 towards smaller e.
DeviceLine = tuple[Profile, int]


def device_table(
    work_zone: WorkZone,
    closure: Closure,
    *,
    areas: tuple[Area, ...],
    stretches: tuple[Stretch, ...],
    lines: tuple[DeviceLine, ...],
) -> pd.DataFrame:
    """Devices (DEVICE_COLUMNS) by station: at most the stretch's spacing apart, each touching its line from the closed side."""
    rows = []
    for line, side in lines:
        for area, stretch in zip(areas, stretches, strict=True):
            if area.start < line.stations[0] - 1e-6 or area.end > line.stations[-1] + 1e-6:
                continue
            kind = (stretch.name == "activity area" and work_zone.work_space_device) or work_zone.device
            if kind is DeviceKind.BARRIER:
                rows.append(_wall(line, side, area, closure))
                continue
            gaps = device_gaps(area.length, spacing_ft=stretch.spacing)
            from_start = 0 if area.start <= line.stations[0] + 1e-6 else 1  # else the stretch before has a device there
            s = area.start + np.arange(from_start, gaps + 1) / gaps * area.length
            rows.append(_row_of_devices(kind, line, side, s, closure))
    table = pd.concat(rows, ignore_index=True)
    table = table[_is_clear(table, closure, lines) & ~_in_a_gap(table["s_m"].to_numpy(), work_zone)]
    return table.sort_values("s_m", kind="stable", ignore_index=True)[list(DEVICE_COLUMNS)]


def _row_of_devices(kind: DeviceKind, line: Profile, side: int, s: FloatArray, closure: Closure) -> pd.DataFrame:
    radius = DEVICE_SIZE_M[kind][1]
    d = closure.d_of(line(s) + side * radius * _steepest_secant(line, s))
    return _table(kind, s, d, closure.road.to_xy(s, d), heading=closure.road.heading_at(s), length=np.zeros_like(s))


def _wall(line: Profile, side: int, area: Area, closure: Closure) -> pd.DataFrame:
    """A wall without gaps: boxes from joint to joint, whose faces towards the traffic lie on the line."""
    radius = DEVICE_SIZE_M[DeviceKind.BARRIER][1]
    pieces = device_gaps(area.length, spacing_ft=BARRIER_SEGMENT_FT * METRES_PER_FOOT)
    s = area.start + np.arange(pieces + 1) / pieces * area.length
    d = closure.d_of(line(s) + side * radius)
    joints = closure.road.to_xy(s, d)
    chord = np.diff(joints, axis=0)
    heading, length = np.arctan2(chord[:, 1], chord[:, 0]), np.hypot(chord[:, 0], chord[:, 1])
    middle = _middles(joints)
    return _table(DeviceKind.BARRIER, _middles(s), _middles(d), middle, heading=heading, length=length)


def _table(
    kind: DeviceKind, s: FloatArray, d: FloatArray, xy: FloatArray, *, heading: FloatArray, length: FloatArray
) -> pd.DataFrame:
    height, radius = DEVICE_SIZE_M[kind]
    columns = {"s_m": s, "d_m": d, "x_m": xy[:, 0], "y_m": xy[:, 1], "heading_rad": heading, "length_m": length}
    return pd.DataFrame(columns).assign(kind=str(kind), height_m=height, radius_m=radius)


def _middles(values: FloatArray) -> FloatArray:
    return (values[1:] + values[:-1]) / 2


def _steepest_secant(line: Profile, s: FloatArray) -> FloatArray:
    """1 / cos of a line's steeper slope at stations (n,): a circle moved out by that times its radius clears both slopes."""
    slopes = np.concatenate([[0.0], np.diff(line.offsets) / np.diff(line.stations), [0.0]])
    before = slopes[np.searchsorted(line.stations, s - 1e-6)]
    after = slopes[np.searchsorted(line.stations, s + 1e-6)]
    return np.asarray(np.hypot(1.0, np.maximum(np.abs(before), np.abs(after))))


def _is_clear(table: pd.DataFrame, closure: Closure, lines: tuple[DeviceLine, ...]) -> BoolArray:
    """Which devices (n,) stand clear of the other line of an interior closure: its tips are narrower than a device."""
    e, radius = closure.d_of(table["d_m"].to_numpy()), table["radius_m"].to_numpy()
    clear = np.ones(len(table), dtype=bool)
    for line, side in lines[1:]:
        s = table["s_m"].to_numpy()
        beside = (s >= line.stations[0] - 1e-6) & (s <= line.stations[-1] + 1e-6)
        between = e < lines[0][0](s)  # the devices of the closed side stand beyond the gore
        clear &= ~beside | ~between | (side * (e - line(s)) >= radius - 1e-9)
    return clear


def _in_a_gap(s: FloatArray, work_zone: WorkZone) -> BoolArray:
    """Which stations (n,) lie in a stretch where the zone's devices are missing."""
    from_start = s - work_zone.start_ft * METRES_PER_FOOT
    gaps = np.array(work_zone.device_gaps_ft).reshape(-1, 2) * METRES_PER_FOOT
    return np.asarray(((from_start[:, None] >= gaps[:, 0]) & (from_start[:, None] <= gaps[:, 1])).any(axis=1))
