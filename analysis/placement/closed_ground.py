"""Vehicles that drive over the ground that a placed zone closes, counted from SUMO's own FCD output."""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

TOUCH_M = 0.1  # a vehicle that touches the line of devices by less is beside it
CAR = (5.0, 1.8)  # SUMO's passenger car, length and width [m]


def entered(
    fcd: Path, placed: Path, *, sizes: dict[str, tuple[float, float]] | None = None, edges: set[str] | None = None
) -> set[str]:
    """Ids of the vehicles whose outline reached into the closed ground. `sizes`: (length, width) [m] by vehicle type.

    With `edges`, only while they are on one of these: what crosses at another level is not over the ground.
    """
    ground = closed_ground(placed)
    core = ground.buffer(-TOUCH_M)
    shapely.prepare(core)
    left, low, right, high = ground.bounds
    found: set[str] = set()
    for _, step in ET.iterparse(fcd):
        if step.tag != "timestep":
            continue
        for vehicle in step:
            if edges is not None and vehicle.get("lane", "").rpartition("_")[0] not in edges:
                continue
            x, y = float(vehicle.get("x", "nan")), float(vehicle.get("y", "nan"))
            if left - 20 <= x <= right + 20 and low - 20 <= y <= high + 20:
                length, width = (sizes or {}).get(vehicle.get("type", ""), CAR)
                if core.intersects(outline(x, y, float(vehicle.get("angle", "nan")), length, width)):
                    found.add(vehicle.get("id", ""))
        step.clear()
    return found


def closed_ground(placed: Path) -> BaseGeometry:
    """The ground that the devices fence off, in the network's metres, as a folder of `wzsumo place` draws it."""
    drawing = ET.parse(placed / "closed" / "wzsumo.zone.add.xml")
    shapes = [poly.get("shape", "") for poly in drawing.iter("poly") if poly.get("type") == "closed_area"]
    polygons = [shapely.Polygon([tuple(map(float, point.split(","))) for point in shape.split()]) for shape in shapes]
    return shapely.union_all(polygons)


def outline(x: float, y: float, angle_deg: float, length: float, width: float) -> shapely.Polygon:
    """Outline of a vehicle by the middle of its front bumper and SUMO's angle, degrees clockwise from north."""
    ahead = np.array([np.sin(np.deg2rad(angle_deg)), np.cos(np.deg2rad(angle_deg))])
    across = np.array([-ahead[1], ahead[0]]) * width / 2
    front, back = np.array([x, y]), np.array([x, y]) - length * ahead
    return shapely.Polygon([front + across, front - across, back - across, back + across])
