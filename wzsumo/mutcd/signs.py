"""The signs ahead of a zone and behind it."""

import math

import pandas as pd

from wzsumo.mutcd.closure import Closure
from wzsumo.mutcd.spacing import SIGN_SPACING_FT
from wzsumo.units import METRES_PER_FOOT
from wzsumo.work_zone import SIGN_COLUMNS, Area, RoadType, TakingTurns, WorkZone

BEYOND_THE_EDGE_FT = 6.0  # from the pavement's edge to the sign: MUTCD 11th ed., Section 2A.16, beside a shoulder
END_SIGN_FT = 500.0  # from the end of the zone to END ROAD WORK, as the freeway applications of Chapter 6P draw it

REVERSE_CURVE_BY_LANES = {1: "W1-4", 2: "W1-4b"}  # W1-4c shows three arrows, the most of any: Figure 6P-36
Sign = tuple[str, str]  # code and text; the texts of symbol signs are their names
ROAD_WORK_AHEAD, END_ROAD_WORK = ("W20-1", "ROAD WORK AHEAD"), ("G20-2", "END ROAD WORK")


def advance_signs(work_zone: WorkZone, closure: Closure) -> tuple[Sign, Sign, Sign]:
    """The signs ahead of the first taper, the nearest first.

    Source: MUTCD 11th ed., Chapter 6H for the signs, Chapter 6P for which of them a kind of zone has.
    """
    side = closure.side.upper()
    if work_zone.one_lane_two_way:
        nearest = ("W3-3", "SIGNAL AHEAD") if work_zone.one_lane_two_way == "signal" else ("W20-7", "FLAGGER")
        return nearest, ("W20-4", "ONE LANE ROAD AHEAD"), ROAD_WORK_AHEAD
    if closure.count:  # an interior closure too: its outer lanes close first, Figure 6P-38
        lanes = f"{side} LANE" if closure.count == 1 else f"{closure.count} {side} LANES"
        closed = (f"W20-5{side[0]}" if closure.count == 1 else f"W20-5a{side[0]}", f"{lanes} CLOSED AHEAD")
        return (f"W4-2{side[0]}", f"{side} LANE ENDS"), closed, ROAD_WORK_AHEAD
    if work_zone.shift_ft:
        away = "R" if closure.side == "left" else "L"
        reverse_curve = REVERSE_CURVE_BY_LANES.get(closure.n_open, "W1-4c")
        return (f"{reverse_curve}{away}", "REVERSE CURVE"), ("R4-9", "STAY IN LANE"), ROAD_WORK_AHEAD
    text = f"{side} SHOULDER CLOSED"
    return (f"W21-5a{side[0]}", text), (f"W21-5b{side[0]}", f"{text} AHEAD"), ROAD_WORK_AHEAD


def sign_table(work_zone: WorkZone, closure: Closure, *, areas: tuple[Area, ...], turns: TakingTurns | None) -> pd.DataFrame:
    """Signs (SIGN_COLUMNS) in the order in which traffic meets them; those for the other direction come last.

    A sign of a freeway stands on both sides. The distances A, B and C count from the first device, or the stop line.
    """
    signs = advance_signs(work_zone, closure)
    first, last = areas[0].start, areas[-1].end
    if turns:
        first, last = min(first, turns.start), max(last, turns.end)
    ahead_ft, placed = 0.0, []
    for sign, spacing_ft in zip(signs, SIGN_SPACING_FT[work_zone.road_type], strict=True):
        ahead_ft += spacing_ft
        placed.append((sign, ahead_ft * METRES_PER_FOOT))
    behind = END_SIGN_FT * METRES_PER_FOOT
    rows = [row for sign, ahead in reversed(placed) for row in _rows(sign, first - ahead, closure, work_zone)]
    rows += _rows(END_ROAD_WORK, last + behind, closure, work_zone)
    if turns:
        rows += [_opposing_row(sign, last + ahead, closure) for sign, ahead in reversed(placed)]
        rows.append(_opposing_row(END_ROAD_WORK, first - behind, closure))
    return pd.DataFrame(rows, columns=list(SIGN_COLUMNS))


def _rows(
    sign: Sign, s: float, closure: Closure, work_zone: WorkZone
) -> list[tuple[str, str, float, float, float, float, float]]:
    road, beyond = closure.road, BEYOND_THE_EDGE_FT * METRES_PER_FOOT
    sides = [-road.right_shoulder - beyond]
    if work_zone.road_type is RoadType.FREEWAY:
        sides.append(road.left_edge + beyond)
    return [_row(sign, s, d, closure, turned=0.0) for d in sides]


def _opposing_row(sign: Sign, s: float, closure: Closure) -> tuple[str, str, float, float, float, float, float]:
    return _row(sign, s, closure.road.left_edge + BEYOND_THE_EDGE_FT * METRES_PER_FOOT, closure, turned=math.pi)


def _row(
    sign: Sign, s: float, d: float, closure: Closure, *, turned: float
) -> tuple[str, str, float, float, float, float, float]:
    x, y = closure.road.to_xy(s, d)
    return (*sign, s, d, float(x), float(y), float(closure.road.heading_at(s)) + turned)
