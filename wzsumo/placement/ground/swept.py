"""The ground that SUMO's vehicles cover as they drive along lanes.

A vehicle is a rigid body with SUMO's heading: its front lies on its lane and it heads away from the place, one length behind,
where its back lies on the lane or on one before. Of a vehicle with a trailer each part lies so. Where lanes bend or do not
meet, bodies leave them. Positions count by the lanes' lengths, which leave out gaps between lanes and may differ from the
lengths of their shapes.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from wzsumo.frames import FloatArray, arc_length
from wzsumo.placement.demand_files.vehicle_sizes import VehicleSize
from wzsumo.placement.ground.driven_lanes import DrivenLane, DrivenLanes

STEP_M = 0.25  # from one place of a vehicle to the next; places where its front or back passes from lane to lane come besides
AFTER_M = 1e-4  # by which the beginning of a lane lies behind the end of the one before


@dataclass(frozen=True, kw_only=True, eq=False)
class Swept:
    """Outlines (n,) of one size of vehicle whose front is on a lane, those that touch a given ground."""

    lane: DrivenLane
    size: VehicleSize
    outlines: npt.NDArray[np.object_]


def swept_over(ground: shapely.Geometry, driven: DrivenLanes, sizes: frozenset[VehicleSize]) -> Iterator[Swept]:
    """What vehicles of these sizes cover of a ground, by lane and size."""
    shapely.prepare(ground)
    for lane in driven.lanes.values():
        may = [size for size in sizes if lane.allows(size.vehicle_class)]
        if not may or not shapely.LineString(lane.points).dwithin(ground, max(size.length + size.width for size in may)):
            continue
        for size in sorted(may, key=lambda size: (size.length, size.width, size.first_part)):
            for way in driven.ways_to(lane.id, size.length):
                if all(part.allows(size.vehicle_class) for part in way):
                    outlines = vehicles_along(way, size)
                    touching = outlines[shapely.intersects(ground, outlines)]
                    if len(touching):
                        yield Swept(lane=lane, size=size, outlines=touching)


def vehicles_along(way: tuple[DrivenLane, ...], size: VehicleSize) -> npt.NDArray[np.object_]:
    """Outlines (n,) of vehicles, part by part, whose front is on the last of the lanes, as far as the part is on one."""
    positions, points, begins = [], [], [0.0]
    for lane in way:
        along = arc_length(lane.points)
        on_lane = along / max(along[-1], 1e-9) * max(lane.length - AFTER_M, AFTER_M)
        positions.append(begins[-1] + on_lane)
        points.append(lane.points)
        begins.append(begins[-1] + max(lane.length, 2 * AFTER_M))
    ends = np.array([position[[0, -1]] for position in positions]).ravel()
    at, line = np.concatenate(positions), np.vstack(points)
    parts = []
    for begin, end in size.parts:
        front = np.concatenate([np.arange(ends[-2], ends[-1], STEP_M), ends + begin, ends + end])
        front = np.unique(front[(front >= ends[-2]) & (front <= ends[-1]) & (front >= end)])
        nose, tail = (np.column_stack([np.interp(front - behind, at, column) for column in line.T]) for behind in (begin, end))
        parts.append(_boxes(nose, tail, length=end - begin, width=size.width))
    return np.concatenate(parts)


def _boxes(nose: FloatArray, tail: FloatArray, *, length: float, width: float) -> npt.NDArray[np.object_]:
    """Rectangles (n,) from the middles of their front edges (n, 2), with the heading from `tail` to there."""
    ahead = nose - tail
    ahead /= np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    across = np.column_stack([-ahead[:, 1], ahead[:, 0]]) * width / 2
    back = nose - length * ahead
    return np.asarray(shapely.polygons(np.stack([nose + across, nose - across, back - across, back + across], axis=1)))
