"""WorkZone + Road -> WorkZoneLayout: tapers, tangents, buffer and devices placed one after the other along the road.

Everything is laid out in the offset e from the edge line of the side that stays OPEN, counted towards the closed side, so
that one code serves closures on the left (d = e) and on the right (d = travelled width - e).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.mutcd.spacing import DEVICE_SIZE_M, device_gaps, tangent_spacing_ft, taper_spacing_ft
from wzsumo.mutcd.tapers import (
    buffer_length_ft,
    merging_taper_length_ft,
    shifting_taper_length_ft,
    shoulder_taper_length_ft,
)
from wzsumo.road import Profile, Road
from wzsumo.units import METRES_PER_FOOT, feet_from_metres
from wzsumo.work_zone import DEVICE_COLUMNS, Area, OpenLane, WorkZone, WorkZoneLayout

DOWNSTREAM_TAPER_SPACING_FT = 20.0  # MUTCD 11th ed., Section 6B.08, downstream tapers
# Between two tapers of one zone, as shares of the merging taper's L. TA-37 draws 2 L between merging tapers; for a
# merging taper followed by a shift no number is printed: one length of the shifting taper, 1/2 L.
TANGENT_BETWEEN_MERGING_TAPERS_L = 2.0
TANGENT_BEFORE_SHIFT_L = 0.5


@dataclass(frozen=True, kw_only=True)
class _Piece:
    """One stretch of the zone in metres: what the device line and the open edge line do along it."""

    name: str
    length: float
    device_end: float  # e of the device line at its end
    open_end: float  # e of the open edge line at its end
    spacing: float  # largest device spacing


def lay_out(work_zone: WorkZone, road: Road) -> WorkZoneLayout:
    """The layout of `work_zone` on `road`. Raises SpecError, with the numbers and what would fit, where it cannot be."""
    side = _closed_side(work_zone, road)
    closed = [_in_e(road, side, lane) for lane in _closed_from_outside(work_zone, side, road)]
    shoulder = road.left_shoulder if side == "left" else road.right_shoulder
    outer = road.travelled_width + shoulder
    pieces = _pieces(work_zone, road, side=side, closed=closed, outer=outer)

    stations = work_zone.start_ft * METRES_PER_FOOT + np.cumsum([0.0, *(piece.length for piece in pieces)])
    _refuse_beyond_the_road(stations[-1], road, pieces)
    device_line = Profile(stations=stations, offsets=np.array([outer, *(piece.device_end for piece in pieces)]))
    open_edge = Profile(stations=stations, offsets=np.array([0.0, *(piece.open_end for piece in pieces)]))
    to_d = partial(_mirrored, road=road) if side == "right" else _unchanged
    areas = tuple(
        Area(name=piece.name, start=float(start), end=float(end))
        for piece, start, end in zip(pieces, stations[:-1], stations[1:], strict=True)
    )
    # Past the last device everything is open again: the device line ends there, the edge line goes on.
    limit = Profile(stations=stations, offsets=np.minimum(device_line.offsets, road.travelled_width))
    limit = _with_break_where(limit, device_line, road.travelled_width)
    outer_line = Profile(stations=stations[[0, -1]], offsets=np.array([outer, outer]))
    right, left = _ordered(to_d(open_edge), to_d(limit), side=side)
    closed_right, closed_left = _ordered(to_d(device_line), to_d(outer_line), side=side)
    return WorkZoneLayout(
        work_zone=work_zone,
        road=road,
        areas=areas,
        lanes=_open_lanes(road, side=side, closed=closed, areas=areas, limit=limit, open_edge=open_edge, to_d=to_d),
        drivable_right=right,
        drivable_left=left,
        closed_strips=((float(stations[0]), float(stations[-1]), closed_right, closed_left),),
        devices=_devices(work_zone, road, pieces=pieces, device_line=device_line, side=side),
    )


def _closed_side(work_zone: WorkZone, road: Road) -> str:
    lanes, count = sorted(set(work_zone.closed_lanes)), len(road.lane_widths)
    if lanes and not 0 <= lanes[0] <= lanes[-1] < count:
        raise SpecError(f"closed_lanes={tuple(lanes)} must be lanes of the road, 0..{count - 1} (0 = rightmost)")
    if len(lanes) == count:
        raise SpecError(f"closed_lanes={tuple(lanes)} must leave open at least one of lanes 0..{count - 1} (0 = rightmost)")
    if not lanes and work_zone.closed_shoulder is None:
        raise SpecError('nothing is closed: give closed_lanes or closed_shoulder = "left" or "right"')
    if lanes == list(range(len(lanes))) and lanes:
        side = "right"
    elif lanes == list(range(count - len(lanes), count)) and lanes:
        side = "left"
    elif lanes:
        raise SpecError(
            f"closed_lanes={tuple(lanes)} must run from an outer lane inwards without a gap; for an interior closure "
            "close the lanes beside it on one side too"
        )
    else:
        return str(work_zone.closed_shoulder)
    if work_zone.closed_shoulder not in {None, side}:
        raise SpecError(
            f'closed_shoulder="{work_zone.closed_shoulder}" must be the shoulder beside closed_lanes={tuple(lanes)}, "{side}"'
        )
    return side


def _closed_from_outside(work_zone: WorkZone, side: str, road: Road) -> list[int]:
    lanes = sorted(set(work_zone.closed_lanes), reverse=side == "left")
    return [lane for lane in lanes if lane < len(road.lane_widths)]


def _in_e(road: Road, side: str, lane: int) -> tuple[int, float, float]:
    """(lane, inner e, outer e) of a closed lane."""
    right, left = road.lane_span(lane)
    return (lane, right, left) if side == "left" else (lane, road.travelled_width - left, road.travelled_width - right)


def _pieces(
    work_zone: WorkZone, road: Road, *, side: str, closed: list[tuple[int, float, float]], outer: float
) -> list[_Piece]:
    speed = work_zone.posted_speed_mph
    in_taper, in_tangent = taper_spacing_ft(speed) * METRES_PER_FOOT, tangent_spacing_ft(speed) * METRES_PER_FOOT
    pieces: list[_Piece] = []

    def add(name: str, length_ft: float, device: float, edge: float, spacing: float) -> None:
        if length_ft > 0:
            pieces.append(
                _Piece(name=name, length=length_ft * METRES_PER_FOOT, device_end=device, open_end=edge, spacing=spacing)
            )

    device, edge = road.travelled_width, 0.0
    offset_ft = feet_from_metres(outer - road.travelled_width)
    add("shoulder taper", shoulder_taper_length_ft(speed, offset_ft=offset_ft), device, edge, in_taper)
    for number, (_, inner, lane_outer) in enumerate(closed):
        merging_ft = merging_taper_length_ft(speed, offset_ft=feet_from_metres(lane_outer - inner))
        if number:
            tangent_ft = _given(work_zone.taper_tangent_ft, TANGENT_BETWEEN_MERGING_TAPERS_L * merging_ft)
            add(f"tangent {number}", tangent_ft, device, edge, in_tangent)
        device = inner
        add("merging taper" if not number else f"merging taper {number + 1}", merging_ft, device, edge, in_taper)
    before_shift, open_count = (device, edge), len(road.lane_widths) - len(closed)
    shifted = work_zone.shift_ft > 0 or work_zone.shifted_lane_width_ft is not None
    if shifted:
        device, edge = _after_shift(work_zone, road, side=side, device=device, open_count=open_count)
        moved_ft = max(work_zone.shift_ft, feet_from_metres(abs(edge)))
        if closed:
            full_ft = merging_taper_length_ft(speed, offset_ft=feet_from_metres(closed[-1][2] - closed[-1][1]))
            tangent_ft = _given(work_zone.taper_tangent_ft, TANGENT_BEFORE_SHIFT_L * full_ft)
            add("tangent", tangent_ft, *before_shift, in_tangent)
        add("shifting taper", shifting_taper_length_ft(speed, offset_ft=moved_ft), device, edge, in_taper)
    add("buffer", _given(work_zone.buffer_ft, buffer_length_ft(speed)), device, edge, in_tangent)
    add("activity area", work_zone.work_length_ft, device, edge, in_tangent)
    if shifted:
        device, edge = before_shift
        add("shift back", shifting_taper_length_ft(speed, offset_ft=moved_ft), device, edge, in_taper)
    downstream_ft = work_zone.downstream_taper_ft * max(len(closed), 1)
    device = road.travelled_width if closed else outer
    add("downstream taper", downstream_ft, device, 0.0, DOWNSTREAM_TAPER_SPACING_FT * METRES_PER_FOOT)
    return pieces


def _given(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value


def _after_shift(work_zone: WorkZone, road: Road, *, side: str, device: float, open_count: int) -> tuple[float, float]:
    """(e of the device line, e of the open edge line) where the lanes run shifted."""
    widths = road.lane_widths[:open_count] if side == "left" else road.lane_widths[-open_count:]
    width_ft = work_zone.shifted_lane_width_ft
    needed = sum(widths) if width_ft is None else open_count * width_ft * METRES_PER_FOOT
    device -= work_zone.shift_ft * METRES_PER_FOOT
    edge = device - needed
    open_shoulder = road.right_shoulder if side == "left" else road.left_shoulder
    if edge < -open_shoulder - 1e-6:
        raise SpecError(
            f"shift_ft={work_zone.shift_ft:g}: {open_count} open lane(s), {feet_from_metres(needed):.1f} ft wide together, "
            f"would end {feet_from_metres(-edge):.1f} ft beyond the edge line, on a shoulder of "
            f"{feet_from_metres(open_shoulder):.1f} ft; shift by at most "
            f"{work_zone.shift_ft - feet_from_metres(-edge - open_shoulder):.1f} ft or set a smaller shifted_lane_width_ft"
        )
    return device, max(edge, -open_shoulder)


def _refuse_beyond_the_road(end: float, road: Road, pieces: list[_Piece]) -> None:
    if end > road.length:
        lengths = " + ".join(f"{piece.name} {feet_from_metres(piece.length):.0f}" for piece in pieces)
        raise SpecError(
            f"the zone ends at station {feet_from_metres(end):.0f} ft ({lengths} ft), the road at "
            f"{feet_from_metres(road.length):.0f} ft; lengthen the road by {feet_from_metres(end - road.length):.0f} ft, "
            "or start the zone earlier, or shorten work_length_ft"
        )


def _unchanged(profile: Profile) -> Profile:
    return profile


def _mirrored(profile: Profile, *, road: Road) -> Profile:
    return Profile(stations=profile.stations, offsets=road.travelled_width - profile.offsets)


def _ordered(near_open: Profile, near_closed: Profile, *, side: str) -> tuple[Profile, Profile]:
    """(right, left) of two profiles, the second nearer to the closed side."""
    return (near_open, near_closed) if side == "left" else (near_closed, near_open)


def _with_break_where(limit: Profile, line: Profile, level: float) -> Profile:
    """`limit` = min(line, level) with a break at each station where the line crosses the level inside a piece."""
    stations, offsets = line.stations, line.offsets - level
    crossing = np.flatnonzero(offsets[:-1] * offsets[1:] < 0)
    share = offsets[crossing] / (offsets[crossing] - offsets[crossing + 1])
    extra = stations[crossing] + share * (stations[crossing + 1] - stations[crossing])
    all_stations = np.unique(np.concatenate([stations, extra]))
    return Profile(stations=all_stations, offsets=np.minimum(line(all_stations), level)) if extra.size else limit


def _open_lanes(
    road: Road,
    *,
    side: str,
    closed: list[tuple[int, float, float]],
    areas: tuple[Area, ...],
    limit: Profile,
    open_edge: Profile,
    to_d: Callable[[Profile], Profile],
) -> tuple[OpenLane, ...]:
    lanes = []
    closed_indices = {lane for lane, _, _ in closed}
    staying = [lane for lane in range(len(road.lane_widths)) if lane not in closed_indices]
    nominal_inner = [_in_e(road, side, lane)[1:] for lane in staying]
    nominal_width = max(outer for _, outer in nominal_inner)
    for lane, (inner, outer) in zip(staying, nominal_inner, strict=True):
        # All staying lanes stretch alike between the open edge line and the device line (or their own outer line).
        available = np.minimum(limit.offsets, nominal_width) - open_edge(limit.stations)
        base = open_edge(limit.stations)
        lines = [
            to_d(Profile(stations=limit.stations, offsets=base + share * available))
            for share in (inner / nominal_width, outer / nominal_width)
        ]
        right, left = _ordered(lines[0], lines[1], side=side)
        lanes.append(OpenLane(index=lane, start=0.0, end=road.length, right=right, left=left))
    merging = [area for area in areas if area.name.startswith("merging taper")]
    for (lane, inner, outer), taper in zip(closed, merging, strict=True):
        inner_line = Profile(stations=np.array([0.0]), offsets=np.array([inner]))
        closing = Profile(stations=np.array([taper.start, taper.end]), offsets=np.array([outer, inner]))
        outer_line = Profile(stations=np.array([0.0]), offsets=np.array([outer]))
        for start, end, outside in ((0.0, taper.end, closing), (areas[-1].end, road.length, outer_line)):
            right, left = _ordered(to_d(inner_line), to_d(outside), side=side)
            lanes.append(OpenLane(index=lane, start=start, end=end, right=right, left=left))
    return tuple(sorted(lanes, key=lambda lane: (lane.start, lane.index)))


def _devices(work_zone: WorkZone, road: Road, *, pieces: list[_Piece], device_line: Profile, side: str) -> pd.DataFrame:
    stations = [device_line.stations[:1]]
    for piece, start in zip(pieces, device_line.stations[:-1], strict=True):
        gaps = device_gaps(piece.length, spacing_ft=piece.spacing)
        stations.append(start + np.arange(1, gaps + 1) / gaps * piece.length)
    s = np.concatenate(stations)
    height, radius = DEVICE_SIZE_M[work_zone.device]
    e = device_line(s) + radius * _steepest_secant(device_line, s)
    d = e if side == "left" else road.travelled_width - e
    xy = road.to_xy(s, d)
    table = pd.DataFrame({"kind": str(work_zone.device), "s_m": s, "d_m": d, "x_m": xy[:, 0], "y_m": xy[:, 1]})
    return table.assign(height_m=height, radius_m=radius)[list(DEVICE_COLUMNS)]


def _steepest_secant(line: Profile, s: FloatArray) -> FloatArray:
    """1 / cos of the steeper of the two slopes at each station: a circle moved out by it times its radius clears both."""
    slopes = np.concatenate([[0.0], np.diff(line.offsets) / np.diff(line.stations), [0.0]])
    before = slopes[np.searchsorted(line.stations, s - 1e-6)]
    after = slopes[np.searchsorted(line.stations, s + 1e-6)]
    return np.asarray(np.hypot(1.0, np.maximum(np.abs(before), np.abs(after))))
