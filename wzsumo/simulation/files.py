"""A scenario's folder of SUMO files: network, demand, shapes to draw, and the configuration that sumo-gui opens."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self
from xml.etree import ElementTree as ET

from pydantic import Field, model_validator

from wzsumo.simulation.demand import DemandSpec, write_demand
from wzsumo.simulation.drawing.zone_drawing import write_drawing, write_view
from wzsumo.simulation.drivers import UNCALIBRATED
from wzsumo.simulation.edges import Edge, edges_of, opposing_edges_of
from wzsumo.simulation.network import write_network, write_xml
from wzsumo.spec import Spec
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import WorkZoneLayout


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


def write_sumo_files(
    layout: WorkZoneLayout, folder: Path, *, spec: SimulationSpec, seed: int, closed_at: float | None = None
) -> SumoFiles:
    """Write zone.{net,rou,add,view}.xml, signs/ and zone.sumocfg into `folder`; the configuration carries the seed.

    `closed_at` is the station [m] at which the road is closed: vehicles leave it ahead of that.
    """
    edges = edges_of(layout)
    net = write_network(layout, folder)
    routes = write_demand(
        edges, folder, spec=spec.demand, speed=mps_from_mph(layout.work_zone.posted_speed_mph), seed=seed,
        opposing=opposing_edges_of(layout), closed_at=closed_at,
    )  # fmt: skip
    additional = write_drawing(layout, folder / "zone.add.xml")
    view = write_view(layout, folder / "zone.view.xml", step_length=spec.step_length_s)
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
        "gui_only": {"gui-settings-file": view.name},  # sumo itself passes over it
        "report": {"xml-validation": "never", "no-step-log": "true", "duration-log.disable": "true"},
    }
    for section, options in sections.items():
        item = ET.SubElement(root, section)
        for name, value in options.items():
            ET.SubElement(item, name, value=value)
    config = folder / "zone.sumocfg"
    write_xml(root, config)
    return SumoFiles(config=config, edges=edges, step_length=spec.step_length_s, duration=spec.demand.duration_s)
