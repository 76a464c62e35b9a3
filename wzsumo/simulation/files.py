"""A scenario's folder of SUMO files: network, demand, shapes to draw, and the configuration that sumo-gui opens."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self
from xml.etree import ElementTree as ET

import shapely
import shapely.ops
from pydantic import Field, model_validator
from shapely.geometry.base import BaseGeometry

from wzsumo.simulation.demand import DemandSpec, write_demand
from wzsumo.simulation.drivers import UNCALIBRATED
from wzsumo.simulation.edges import Edge, edges_of, opposing_edges_of
from wzsumo.simulation.network import write_network, write_xml
from wzsumo.spec import Spec
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import WorkZoneLayout

OUTLINE_TOLERANCE_M = 0.01  # of a device's outline as it is drawn
_AREA_COLOURS = {"closed_area": "230,159,0,120", "drivable": "0,158,115,60"}  # Okabe-Ito orange, green


class SimulationSpec(Spec):
    """How SUMO runs: its step, its lateral resolution and the demand."""

    step_length_s: float = Field(
        0.1, ge=0.01, le=1
    )  # drivers act, and positions are logged, at these 10 Hz; drivers are fitted at it
    lateral_resolution_m: float = Field(0.45, ge=0.1, le=2)  # SUMO's sublanes: an eighth of a 12 ft lane
    demand: DemandSpec = DemandSpec()

    @model_validator(mode="after")
    def _drivers_are_calibrated_for_this(self) -> Self:
        drivers = self.demand.drivers
        for key in ("step_length_s", "lateral_resolution_m"):
            fitted, given = getattr(drivers, f"calibrated_{key}"), getattr(self, key)
            if fitted is not None and fitted != given:
                raise ValueError(
                    f'{key}={given:g} does not go with drivers "{drivers.name}", which were calibrated at {key}={fitted:g} '
                    f'and discharge otherwise at any other; set {key} = {fitted:g} or drivers = "{UNCALIBRATED.name}"'
                )
        return self


@dataclass(frozen=True, kw_only=True, eq=False)
class Surroundings:
    """What a network has beside the road of the zone, and the same simulation without the zone."""

    along: tuple[str, ...]  # ids of SUMO's edges on which vehicles are on the road
    around: tuple[str, ...]  # those, and the edges from which vehicles come onto the road or cross it
    vehicle_sizes: Mapping[str, tuple[float, float]]  # (length, width) [m] by vehicle type
    whole_edges: Mapping[str, str]  # the edge of which an edge is a piece
    shapes: Mapping[str, str]  # of every whole edge between junctions, as SUMO writes lines: x,y x,y ... [m]
    additionals: tuple[Path, ...]  # additional files of the configuration
    without_zone: Path  # the configuration without the zone


@dataclass(frozen=True, kw_only=True)
class SumoFiles:
    """A folder of SUMO files; `config` names the others."""

    config: Path
    edges: tuple[Edge, ...]  # of the road
    step_length: float  # s
    duration: float  # s
    begin: float = 0.0  # s, SUMO's time at the beginning, from which all other times count
    surroundings: Surroundings | None = None  # None: the network is the road


def write_sumo_files(layout: WorkZoneLayout, folder: Path, *, spec: SimulationSpec, seed: int) -> SumoFiles:
    """Write zone.{net,rou,add}.xml and zone.sumocfg into `folder`; the configuration carries the seed."""
    edges = edges_of(layout)
    net = write_network(layout, folder)
    routes = write_demand(
        edges, folder, spec=spec.demand, speed=mps_from_mph(layout.work_zone.posted_speed_mph), seed=seed,
        opposing=opposing_edges_of(layout),
    )  # fmt: skip
    additional = write_drawing(layout, folder / "zone.add.xml")
    root = ET.Element("configuration")
    sections = {
        "input": {"net-file": net.name, "route-files": routes.name, "additional-files": additional.name},
        "time": {"begin": "0", "end": f"{spec.demand.duration_s:g}", "step-length": f"{spec.step_length_s:g}"},
        "processing": {
            "lateral-resolution": f"{spec.lateral_resolution_m:g}",
            "time-to-teleport": "-1",  # no teleports: the trace of one would lead through the devices
            "collision.action": "none",  # SUMO's collisions count minGap: contact is computed from outlines
            "collision.check-junctions": "false",
        },
        "random_number": {"seed": str(seed)},
        "report": {"xml-validation": "never", "no-step-log": "true", "duration-log.disable": "true"},
    }
    for section, options in sections.items():
        item = ET.SubElement(root, section)
        for name, value in options.items():
            ET.SubElement(item, name, value=value)
    config = folder / "zone.sumocfg"
    write_xml(root, config)
    return SumoFiles(config=config, edges=edges, step_length=spec.step_length_s, duration=spec.demand.duration_s)


def write_drawing(layout: WorkZoneLayout, path: Path) -> Path:
    """Write the zone as polygons and points that sumo-gui draws and SUMO's vehicles do not see; returns the file's path."""
    root = ET.Element("additional")
    for name, colour in _AREA_COLOURS.items():
        area: BaseGeometry = getattr(layout, name)
        for number, part in enumerate(_without_holes(area)):
            shape = " ".join(f"{x:.3f},{y:.3f}" for x, y in part.exterior.coords)
            ET.SubElement(root, "poly", id=f"{name}_{number}", color=colour, fill="1", layer="-1", shape=shape, type=name)
    for number, (kind, outline) in enumerate(zip(layout.devices["kind"], layout.device_outlines, strict=True)):
        shape = " ".join(f"{x:.3f},{y:.3f}" for x, y in outline.simplify(OUTLINE_TOLERANCE_M).exterior.coords)
        ET.SubElement(
            root, "poly", id=f"device_{number:03d}", color="213,94,0", fill="1", layer="5", shape=shape, type=str(kind)
        )  # fmt: skip
    for number, sign in enumerate(layout.signs.to_dict("records")):
        id_ = f"sign_{number:02d}_{sign['text'].replace(' ', '_')}"
        place = {"x": f"{sign['x_m']:.3f}", "y": f"{sign['y_m']:.3f}"}
        ET.SubElement(root, "poi", place, id=id_, type=sign["code"], color="255,128,0", layer="6")
    write_xml(root, path)
    return path


def _without_holes(area: BaseGeometry) -> list[shapely.Polygon]:
    """The same ground as polygons without holes, which SUMO cannot draw: each is cut in two through its first hole."""
    parts = []
    for polygon in getattr(area, "geoms", [area]):
        if polygon.interiors:
            x, (_, lowest, _, highest) = polygon.interiors[0].centroid.x, polygon.bounds
            cut = shapely.LineString([(x, lowest - 1), (x, highest + 1)])
            parts += _without_holes(shapely.ops.split(polygon, cut))
        else:
            parts.append(polygon)
    return parts
