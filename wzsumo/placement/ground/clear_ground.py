"""The ground that a zone closes, clear of the vehicles beside it: where they swing over it the line of devices is drawn back.

On bends the bodies of vehicles leave their lane. A crew keeps the width open that they sweep, and so does the line here.
"""

from dataclasses import replace

import numpy as np
import shapely

from wzsumo.errors import PlacementError
from wzsumo.placement.demand_files.vehicle_sizes import VehicleSize
from wzsumo.placement.ground.driven_lanes import DrivenLanes, driven_lanes
from wzsumo.placement.ground.line_of_devices import drawn_back
from wzsumo.placement.ground.swept import Swept, swept_over
from wzsumo.placement.lane_plan import LanePlan
from wzsumo.placement.lane_states import ClosedLanes
from wzsumo.work_zone import WorkZoneLayout

HALF_WIDTH_M = 1.1  # of vehicles: SUMO's delivery van, 2.16 m
BRUSHED_M, BRUSHED_M2 = 0.1, 0.3  # ground that is not counted: beside a lane that runs along it, and in a corner of it


def with_clear_ground(plan: LanePlan, closed: ClosedLanes, sizes: frozenset[VehicleSize]) -> tuple[LanePlan, list[str]]:
    """The plan with its line of devices drawn back from the vehicles of these sizes, and a doubt where it had to be.

    Raises PlacementError where a lane leads through the closed ground, and where vehicles swing so far over it that too little
    is left.
    """
    layout, doubts = plan.layout, list[str]()
    if layout.closed_area.is_empty:
        return plan, doubts
    driven = driven_lanes(plan, closed)
    swept = list(swept_over(layout.closed_area.buffer(-BRUSHED_M), driven, sizes))
    if swept:
        layout, farthest = drawn_back(layout, [outline for part in swept for outline in part.outlines])
        if farthest:
            doubts.append(_told(swept, farthest))
    _check_lanes(layout, driven)
    _check_vehicles(layout, swept)
    return replace(plan, layout=layout), doubts


def _told(swept: list[Swept], farthest: float) -> str:
    longest = max((part.size for part in swept), key=lambda size: size.length)
    lanes = sorted({part.lane.id for part in swept})
    return (
        f"vehicles up to {longest.length:g} m long swing over the line of devices where lanes bend ({', '.join(lanes[:3])}"
        f"{', ...' if len(lanes) > 3 else ''}): the line is drawn back there by up to {farthest:.1f} m"
    )


def _check_lanes(layout: WorkZoneLayout, driven: DrivenLanes) -> None:
    ground = layout.closed_area
    inner = ground.buffer(-BRUSHED_M)
    shapely.prepare(inner)
    for lane in driven.lanes.values():
        path = shapely.LineString(lane.points)
        if path.length and path.dwithin(ground, HALF_WIDTH_M):
            over = path.buffer(HALF_WIDTH_M, cap_style="flat").intersection(inner).area
            if over > BRUSHED_M2:
                raise PlacementError(
                    f"vehicles on lane {lane.id!r} would drive over {over:.1f} m2 of the ground that the zone closes; move the "
                    "zone past that lane, or close lanes on the other side"
                )


def _check_vehicles(layout: WorkZoneLayout, swept: list[Swept]) -> None:
    inner = layout.closed_area.buffer(-BRUSHED_M)
    shapely.prepare(inner)
    for part in swept:
        over = part.outlines[shapely.intersects(inner, part.outlines)]
        if len(over):
            area = float(np.max(shapely.area(shapely.intersection(inner, over))))
            raise PlacementError(
                f"{part.size.vehicle_class} vehicles, {part.size.length:g} m long, on lane {part.lane.id!r} would swing over "
                f"{area:.2f} m2 of the ground that the zone closes, with the line of devices drawn back as far as it may be; "
                "move the zone, or mend the lanes' shapes in netedit"
            )
