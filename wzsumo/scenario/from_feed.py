"""A scenario from a road event of a WZDx feed: what the feed says, and what had to be assumed, each said."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wzsumo.errors import FeedError, SpecError
from wzsumo.feeds.road_event import EventLane, RoadEvent
from wzsumo.frames import FloatArray
from wzsumo.geography import LocalFrame, local_frame
from wzsumo.planning.planning_field import MAX_PLANNING_CELLS
from wzsumo.roads.found_road import road_along
from wzsumo.scenario.scenario import Scenario, misfits_of
from wzsumo.spec import parse_spec
from wzsumo.units import METRES_PER_FOOT, feet_from_metres, mph_from_mps

LEAD_FT, TAIL_FT = 2000.0, 2000.0  # of road before and after the event, straight on; as in the library's scenarios
LANE_FT, SHOULDER_FT = 12.0, 10.0  # AASHTO Green Book (2018), 8.2.4: freeway lane and right shoulder
SHIFT_FT = 10.0  # of lanes that the feed calls shifted: onto a shoulder of 12 ft, as in MUTCD 11th ed., TA-36
ASSUMED_SPEED_MPH = 55.0
FLOW_VPH_PER_LANE = 600.0  # below what any work zone carries (HCM 7: 1,353 pc/h/ln and more)
FREEWAY_FROM_MPH = 50.0
MIN_WORK_FT = 100.0
CLOSED = ("closed", "merge-left", "merge-right")
BY_TURNS = {"alternating-one-way": "flaggers", "flagging": "flaggers", "temporary-traffic-signal": "signal"}


@dataclass(kw_only=True)
class _Draft:
    """What a scenario is made of so far, and what was said about it."""

    road: dict[str, Any] = field(default_factory=dict)
    zone: dict[str, Any] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)


def scenario_of_event(event: RoadEvent, *, name: str, source: str) -> tuple[dict[str, Any], list[str], list[str]]:
    """(content of a scenario file, what the feed said, what it left open and was assumed). Raises FeedError or SpecError."""
    if event.kind != "work-zone" or event.movement == "planned-moving-area":
        what = event.movement or event.kind
        raise FeedError(f"{source}#{event.id}: is a {what}; a scenario is made of a work-zone event that stays in place")
    draft = _Draft()
    if event.movement == "moving":
        draft.assumed.append("the operation stays where the feed has it, though it moves")
    _add_speed(draft, event)
    _add_lanes(draft, event, source=source)
    frame, line = _line(event)
    place = f"{source}#{event.id}"
    _add_line(draft, frame, line, source=place)
    try:
        draft.zone["work_length_ft"] = _work_length_ft(draft, feet_from_metres(_length(line)), source=place)
        n_open = draft.road["lane_count"] - len(draft.zone.get("closed_lanes", ()))
        content = _content(draft, n_open=max(n_open, 1), name=name)
        _add_resolution(content, draft, source=place)
        misfits = misfits_of(parse_spec(Scenario, content, source=place))
    except SpecError as error:
        misfits = [str(error).removeprefix(f"{place}: ")]
    if misfits:
        raise SpecError(f"{place}: makes no scenario: {'; '.join(misfits)}")
    return content, draft.said, draft.assumed


def _add_resolution(content: dict[str, Any], draft: _Draft, *, source: str) -> None:
    """Cells as coarse as the ground that is mapped needs."""
    scenario = parse_spec(Scenario, content, source=source)
    layout = scenario.layout()
    road, margin = layout.road, scenario.map.margin_m
    ground = road.strip(*scenario.mapped_ends(layout), -road.right_shoulder - margin, road.left_edge + margin)
    left, low, right, high = ground.buffer(margin).bounds
    coarsest = math.ceil(100 * math.sqrt((right - left) * (high - low) / MAX_PLANNING_CELLS)) / 100
    if coarsest > scenario.map.resolution_m:
        content["map"] = {"resolution_m": coarsest}
        draft.assumed.append(f"map.resolution_m = {coarsest:g}: finer cells would be more than can be planned on")


def _add_speed(draft: _Draft, event: RoadEvent) -> None:
    if event.speed_mps is None:
        speed = ASSUMED_SPEED_MPH
        draft.assumed.append(f"posted_speed_mph = {speed:g}: the event has no reduced_speed_limit_kph")
    else:
        speed = float(np.clip(5 * round(mph_from_mps(event.speed_mps) / 5), 20, 75))
        draft.said.append(f"reduced speed limit {3.6 * event.speed_mps:g} km/h: {speed:g} mph")
    interstate = any(name.upper().startswith(("I-", "I ", "INTERSTATE")) for name in event.road_names)
    freeway = interstate or speed >= FREEWAY_FROM_MPH
    draft.zone |= {"posted_speed_mph": speed, "road_type": "freeway" if freeway else "urban_high_speed"}
    draft.assumed.append(f'road_type = "{draft.zone["road_type"]}": by {"the name of the road" if interstate else "the speed"}')


def _add_lanes(draft: _Draft, event: RoadEvent, *, source: str) -> None:
    """The lanes from the right, those that are closed, a shoulder's closure, a shift."""
    if event.vehicle_impact in BY_TURNS:
        control = BY_TURNS[event.vehicle_impact]
        draft.road |= {"lane_count": 1, "opposing_lane_count": 1, "left_shoulder_ft": 6.0, "right_shoulder_ft": 6.0}
        draft.zone |= {"closed_lanes": [0], "one_lane_two_way": control, "road_type": "rural"}
        draft.said.append(f"vehicle_impact {event.vehicle_impact}: one lane by turns ({control})")
        draft.assumed.append("a lane in each direction, shoulders of 6 ft")
        return
    through = sorted((lane for lane in event.lanes if lane.kind == "general"), key=lambda lane: -lane.order)
    if not through:
        raise FeedError(
            f"{source}#{event.id}: has no `lanes` of type general, which a scenario needs; start from `wzsumo init ZONE`"
        )
    closed = [number for number, lane in enumerate(through) if lane.status in CLOSED]
    if len(closed) == len(through):
        raise FeedError(f"{source}#{event.id}: closes all {len(through)} lanes; a scenario keeps one open")
    shoulders = _shoulders(event, through)
    draft.road |= {"lane_count": len(through), "lane_width_ft": LANE_FT}
    for side in ("left", "right"):
        draft.road[f"{side}_shoulder_ft"] = SHOULDER_FT if side in shoulders or not shoulders else 4.0
    which = ", ".join(f"lane {number}" for number in closed) or "no lane"
    draft.said.append(f"{len(through)} lane(s), counted from 0 on the right; {which} closed")
    others = sorted({lane.kind for lane in event.lanes} - {"general", "shoulder"})
    if others:
        draft.assumed.append(f"lanes of other types are left out: {', '.join(others)}")
    widths = [f"{draft.road[f'{side}_shoulder_ft']:g}" for side in ("left", "right")]
    draft.assumed.append(f"lanes of {LANE_FT:g} ft, shoulders of {' and '.join(widths)} ft")
    if closed:
        draft.zone["closed_lanes"] = closed
    shifts = {lane.status for lane in through if lane.status.startswith("shift-")}
    _add_shift(draft, shifts, closed, shoulders, len(through))


def _add_shift(draft: _Draft, shifts: set[str], closed: list[int], shoulders: dict[str, str], n_lanes: int) -> None:
    if not shifts and not closed:
        sides = [side for side, status in shoulders.items() if status == "closed"]
        side = sides[0] if sides else "right"
        draft.zone["closed_shoulder"] = side
        (draft.said if sides else draft.assumed).append(f"no lane is closed: the {side} shoulder is")
        return
    if not shifts:
        return
    away = "right" if "shift-right" in shifts else "left"
    side = "left" if away == "right" else "right"
    if closed and (n_lanes - 1 if side == "left" else 0) not in closed:
        draft.assumed.append(f"lanes stay in place: the feed shifts them to the {away}, towards the closed side")
        return
    draft.zone |= {"shift_ft": SHIFT_FT, "closed_shoulder": side}
    draft.road[f"{away}_shoulder_ft"] = SHIFT_FT + 2.0
    draft.said.append(f"lanes shift to the {away}")
    draft.assumed.append(f"shift_ft = {SHIFT_FT:g} onto a shoulder of {SHIFT_FT + 2:g} ft: the feed does not say how far")


def _shoulders(event: RoadEvent, through: list[EventLane]) -> dict[str, str]:
    """Status of the shoulders that the feed lists, by their side."""
    found = {}
    for lane in event.lanes:
        if lane.kind == "shoulder":
            found["left" if lane.order < through[-1].order else "right"] = lane.status
    return found


def _line(event: RoadEvent) -> tuple[LocalFrame, FloatArray]:
    """(a frame around the event, its line [m] with a straight road before and after it)."""
    frame = local_frame(event.lonlat)
    line = frame.from_lonlat(event.lonlat if event.in_order else event.lonlat[[0, -1]])
    return frame, line[np.concatenate([[True], np.hypot(*np.diff(line, axis=0).T) > 0.5])]


def _length(line: FloatArray) -> float:
    return float(np.sum(np.hypot(*np.diff(line, axis=0).T)))


def _add_line(draft: _Draft, frame: LocalFrame, line: FloatArray, *, source: str) -> None:
    if len(line) < 2:
        raise FeedError(f"{source}: its geometry is one place; a scenario needs where it starts and ends")
    first, last = line[0] - line[1], line[-1] - line[-2]
    lead = line[0] + first / np.hypot(*first) * LEAD_FT * METRES_PER_FOOT
    tail = line[-1] + last / np.hypot(*last) * TAIL_FT * METRES_PER_FOOT
    lanes = draft.road["lane_count"] + draft.road.get("opposing_lane_count", 0)
    shoulders = [draft.road[f"{side}_shoulder_ft"] * METRES_PER_FOOT for side in ("left", "right")]
    road, _ = road_along(
        np.vstack([lead, line, tail]), lane_widths=[LANE_FT * METRES_PER_FOOT] * lanes,
        shoulders=(shoulders[0], shoulders[1]), speed_mps=None, source=source,
    )  # fmt: skip
    draft.road |= {"reference_points_m": np.round(road.reference_line, 3).tolist(), "crs": frame.crs}
    draft.zone["start_ft"] = LEAD_FT
    draft.said.append(f"the line of the event, {_length(line):.0f} m long")
    draft.assumed.append(
        f"the event's line is the middle of the lanes, with {LEAD_FT:g} ft of straight road before and after it"
    )


def _work_length_ft(draft: _Draft, event_ft: float, *, source: str) -> float:
    """The work space's length with which the zone is as long as the event, by the manual's tapers and buffer."""
    trial = {"road": draft.road, "work_zone": draft.zone | {"work_length_ft": MIN_WORK_FT}}
    layout = parse_spec(Scenario, _content_of(trial, n_open=1, name="trial"), source=source).layout()
    rest = feet_from_metres(layout.end - layout.start) - MIN_WORK_FT
    if event_ft - rest < MIN_WORK_FT:
        draft.assumed.append(
            f"work_length_ft = {MIN_WORK_FT:g}: the manual's tapers and buffer alone take {rest:.0f} of the event's "
            f"{event_ft:.0f} ft"
        )
        return MIN_WORK_FT
    draft.said.append(f"the zone is {event_ft:.0f} ft long; tapers and buffer are the manual's, {rest:.0f} ft")
    return float(round(event_ft - rest))


def _content(draft: _Draft, *, n_open: int, name: str) -> dict[str, Any]:
    draft.assumed.append(
        f"flow_vph = {FLOW_VPH_PER_LANE * n_open:g}, 10 % trucks, uncalibrated drivers: the feed knows no traffic"
    )
    return _content_of({"road": draft.road, "work_zone": draft.zone}, n_open=n_open, name=name)


def _content_of(parts: dict[str, Any], *, n_open: int, name: str) -> dict[str, Any]:
    closed = set(parts["work_zone"].get("closed_lanes", ()))
    lanes = range(parts["road"]["lane_count"])
    lane = next((lane for lane in lanes if lane not in closed), 0)
    demand: dict[str, Any] = {"flow_vph": FLOW_VPH_PER_LANE * n_open, "truck_share": 0.1, "duration_s": 900}
    if parts["road"].get("opposing_lane_count"):
        demand["opposing_flow_vph"] = FLOW_VPH_PER_LANE / 3
        demand["flow_vph"] = FLOW_VPH_PER_LANE / 3
    return {
        "name": name, "seed": 1, "road": parts["road"], "work_zone": parts["work_zone"], "simulation": {"demand": demand},
        "crowd": {"penetration": 0.2, "collected": 30, "used": 5}, "route": {"start_lane": lane, "goal_lane": lane},
    }  # fmt: skip
