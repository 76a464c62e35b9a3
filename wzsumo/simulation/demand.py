"""The fleet: vehicle types with scattered drivers, and one explicit vehicle a departure.

Everything is drawn from the seed here, so that a route file says exactly who drives; SUMO's own random numbers only move
speeds and dawdling, by the seed in the configuration.
"""

from pathlib import Path
from typing import Self
from xml.etree import ElementTree as ET

import numpy as np
from pydantic import Field, model_validator

from wzsumo.simulation.network import Edge, write_xml
from wzsumo.spec import Spec


class DemandSpec(Spec):
    """Who arrives at the road's start."""

    flow_vph: float = Field(
        1500.0, gt=0
    )  # all lanes together; well below what two open lanes discharge (HCM 7: about 1,800 pc/h each)
    truck_share: float = Field(0.10, ge=0, lt=1)  # of the order of the HCM's default for freeways
    lane_use: tuple[float, ...] = ()  # share of vehicles by lane at the road's start from the right; empty: even
    duration_s: float = Field(1200.0, gt=0)
    speed_factor_sd: float = Field(0.1, ge=0, le=0.5)  # SUMO's default for passenger cars
    lateral_sd_m: float = Field(0.2, ge=0, le=1)  # of the place in the lane that a driver aims at
    lateral_wander: float = Field(0.08, ge=0)  # SUMO lcSigma, of one driver
    # Drivers begin to look for a gap uniformly this far ahead of the closing lane's end. From 27 m/s at 4.5 m/s2 nobody can
    # stop there from less than about 80 m. At 100 m some late mergers still brake at 9 m/s2 (SUMO's warnings on stderr).
    merge_ahead_m: tuple[float, float] = (100.0, 500.0)

    @model_validator(mode="after")
    def _lane_use_is_a_share(self) -> Self:
        if self.lane_use and (min(self.lane_use) < 0 or abs(sum(self.lane_use) - 1) > 1e-6):
            raise ValueError(f"lane_use={self.lane_use} must be shares of 0 or more that add up to 1")
        if not 0 < self.merge_ahead_m[0] <= self.merge_ahead_m[1]:
            raise ValueError(f"merge_ahead_m={self.merge_ahead_m} must be [nearest, farthest] in metres above 0")
        return self


CAR = {"length_m": 4.8, "width_m": 1.85}  # SUMO "passenger": 5 m; mean US fleet about 4.8 x 1.85 m
TRUCK = {"length_m": 12.0, "width_m": 2.5}  # SUMO "truck" 7.1 x 2.4 m; US single-unit to semi-trailer mix
LOOK_AHEAD_S = 10.0  # SUMO looks lcStrategic x speed x 10 s ahead for changes to the right (LC2013, SL2015), twice to the left
N_DRIVERS = 60  # vTypes a class: each has its own place in the lane and its own habit of merging


def write_demand(edges: tuple[Edge, ...], folder: Path, *, spec: DemandSpec, speed: float, seed: int) -> Path:
    """Write zone.rou.xml: vehicle types, the route through all edges and every vehicle; returns its path.

    `speed` [m/s] is the posted one.
    """
    rng = np.random.default_rng([seed, 1])
    root = ET.Element("routes")
    for kind, size in (("car", CAR), ("truck", TRUCK)):
        for number in range(N_DRIVERS):
            ET.SubElement(root, "vType", _driver(f"{kind}_{number:02d}", kind, size, spec=spec, speed=speed, rng=rng))
    ET.SubElement(root, "route", id="through", edges=" ".join(edge.id for edge in edges))
    departures = np.cumsum(rng.exponential(3600 / spec.flow_vph, size=_enough(spec)))
    n_lanes = len(edges[0].lanes)
    shares = np.array(spec.lane_use or (1 / n_lanes,) * n_lanes)
    for number, time in enumerate(departures[departures < spec.duration_s]):
        is_truck = bool(rng.random() < spec.truck_share)
        lane, driver = int(rng.choice(n_lanes, p=shares)), int(rng.integers(N_DRIVERS))
        if is_truck and n_lanes > 2:
            lane = min(lane, n_lanes - 2)  # trucks keep out of the left lane of three or more, the usual US rule
        ET.SubElement(
            root, "vehicle", id=f"v{number:05d}", type=f"{'truck' if is_truck else 'car'}_{driver:02d}", route="through",
            depart=f"{time:.2f}", departLane=str(lane), departPos="base", departSpeed="desired",
        )  # fmt: skip
    path = folder / "zone.rou.xml"
    write_xml(root, path)
    return path


def _enough(spec: DemandSpec) -> int:
    mean = spec.flow_vph * spec.duration_s / 3600
    return int(mean + 8 * np.sqrt(mean) + 10)  # eight standard deviations of a Poisson count


def _driver(
    id_: str, kind: str, size: dict[str, float], *, spec: DemandSpec, speed: float, rng: np.random.Generator
) -> dict[str, str]:
    offset = float(np.clip(rng.normal(0, spec.lateral_sd_m), -2 * spec.lateral_sd_m, 2 * spec.lateral_sd_m))
    driver = {
        "id": id_,
        "vClass": "passenger" if kind == "car" else "truck",
        "length": str(size["length_m"]),
        "width": str(size["width_m"]),
        "speedFactor": f"normc(1,{spec.speed_factor_sd},0.75,1.3)",
        "latAlignment": f"{offset:.3f}",
        "lcSigma": str(spec.lateral_wander),
        "lcStrategic": f"{rng.uniform(*spec.merge_ahead_m) / (LOOK_AHEAD_S * speed):.3f}",
    }
    if kind == "truck":
        driver |= {"accel": "1.0", "decel": "4.0"}  # loaded truck; cars keep SUMO's defaults
    return driver
