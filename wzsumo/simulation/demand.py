"""The demand as SUMO's route file: vehicle types whose drivers differ, and one vehicle for each departure.

Departures, vehicle types and lanes are drawn here from the seed, so the route file lists every vehicle. SUMO itself draws only
desired speeds and dawdling, from the seed in its configuration.
"""

from pathlib import Path
from typing import Annotated, Self
from xml.etree import ElementTree as ET

import numpy as np
from pydantic import Field, field_serializer, field_validator, model_validator

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.simulation.drivers import BY_THE_HCM, DRIVER_PRESETS, UNCALIBRATED, DriverSpec
from wzsumo.simulation.edges import Edge, edge_at
from wzsumo.simulation.network import write_xml
from wzsumo.spec import Spec
from wzsumo.units import METRES_PER_FOOT

_DriversName = Annotated[str, Field(json_schema_extra={"enum": list(DRIVER_PRESETS)})]


class DemandSpec(Spec):
    """The traffic that arrives at the road's start, and its drivers."""

    # All lanes together; well below what two open lanes discharge (HCM 7: about 1,800 pc/h each).
    flow_vph: float = Field(1500.0, gt=0, le=50_000)
    flow_profile: tuple[tuple[float, float], ...] = ()  # (from this time [s], veh/h), instead of flow_vph
    opposing_flow_vph: float = Field(0.0, ge=0, le=50_000)  # the other direction of a two-way road, all its lanes together
    truck_share: float = Field(0.10, ge=0, lt=1)  # of the order of the HCM's default for freeways
    lane_use: tuple[float, ...] = ()  # share of vehicles by lane at the road's start from the right; empty: even
    # of the simulated traffic; longer: more vehicles, and more of them equipped
    duration_s: float = Field(1200.0, gt=0, le=86_400)
    # From then on flows are counted and the ego may depart: the slowest vehicle has passed the road (1.8 km at 21 m/s: 87 s).
    warm_up_s: float = Field(120.0, ge=0)
    speed_factor_sd: float = Field(0.1, ge=0, le=0.5)  # SUMO's default for passenger cars
    lateral_sd_m: float = Field(0.2, ge=0, le=1)  # between drivers, of the place in the lane that each aims at
    lateral_wander: float = Field(0.08, ge=0, le=10)  # SUMO's lcSigma: how far a driver strays from that place
    # From how far ahead of the closing lane's end drivers look for a gap, uniformly between these two. At 4.5 m/s2 a car stops
    # from 27 m/s within some 80 m, so the nearest leaves room to stop. The farthest read the sign "LANE CLOSED" of a freeway,
    # 2,500 ft (762 m) ahead of the taper (MUTCD 11th ed., Table 6B-1), from 250 m before it. Chosen by us.
    merge_ahead_m: tuple[float, float] = (100.0, 1100.0)
    # "hcm": fitted to the HCM's queue discharge of the scenario's zone; the name of a preset; or a table of the keys below.
    drivers: DriverSpec = UNCALIBRATED

    @field_validator("drivers", mode="before", json_schema_input_type=_DriversName | DriverSpec)
    @classmethod
    def _preset_from_its_name(cls, given: object) -> object:
        if isinstance(given, str):
            if given not in DRIVER_PRESETS:
                raise ValueError(f"unknown drivers; known presets: {', '.join(DRIVER_PRESETS)}; or give a table of keys")
            return DRIVER_PRESETS[given]
        return given

    @field_serializer("drivers")
    def _name_while_the_zone_decides(self, drivers: DriverSpec) -> str | dict[str, object]:
        return drivers.name if drivers == BY_THE_HCM else drivers.model_dump()

    @model_validator(mode="after")
    def _shares_flows_and_distances_are_possible(self) -> Self:
        if self.lane_use and (min(self.lane_use) < 0 or abs(sum(self.lane_use) - 1) > 1e-6):
            raise ValueError(f"lane_use={self.lane_use} must be shares of 0 or more that add up to 1")
        times = [time for time, _ in self.flow_profile]
        if times and (times[0] != 0 or times != sorted(set(times)) or min(flow for _, flow in self.flow_profile) <= 0):
            raise ValueError(
                f"flow_profile={self.flow_profile} must be pairs of a time [s], rising from 0, and a flow above 0 veh/h"
            )
        if not 0 < self.merge_ahead_m[0] <= self.merge_ahead_m[1]:
            raise ValueError(f"merge_ahead_m={self.merge_ahead_m} must be [nearest, farthest] in metres above 0")
        return self


CAR = {"length_m": 4.8, "width_m": 1.85}  # SUMO "passenger": 5 m; mean US fleet about 4.8 x 1.85 m
TRUCK = {"length_m": 12.0, "width_m": 2.5}  # SUMO "truck" 7.1 x 2.4 m; US single-unit to semi-trailer mix
# Service brake: SUMO's default for cars; a loaded truck. emergencyDecel is set to the same. With SUMO's 9 m/s2, vehicles that
# merge across the short edges of a taper brake at 9 m/s2 for a single step of 0.1 s with no vehicle ahead (SUMO 1.28, SL2015;
# 26 times among 1105 vehicles). With the service brake the same fleets do not collide, stay out of the closed area and merge at
# the same places.
CAR_DECEL_MPS2, TRUCK_DECEL_MPS2 = 4.5, 4.0
# SL2015 parameters. With SUMO's defaults drivers overtake astride a line between two lanes and stay there while it is faster,
# whatever lies ahead, and where lanes merge they pass one that is still astride in its own lane. With these they do not prefer
# to straddle a line, and return to their place in the lane at ten times the loss of speed that they would accept by default.
LANE_KEEPING = {"lcLaneDiscipline": "1", "lcSublane": "10"}
# SUMO's vehicle moves aside as a whole, the rear of a real one trails its front: on a path of slope m by m times the length.
# It must not be in its old lane any more where SUMO has it in the new one, so m is at most half of what a lane of 12 ft leaves
# free beside the vehicle, over its length. By itself SUMO sets no such limit, and one that stands slides aside at 1 m/s.
LANE_WIDTH_M = 12 * METRES_PER_FOOT
# Where its lane ends SUMO's vehicle has no room ahead to move aside in, so it must do so from a stand. With 0 the library's
# street locks (three times its demand, seed 161); with 0.2 trucks that creep lie across two lanes. Chosen by us.
STANDING_LATERAL_MPS = 0.1
# Left to itself SUMO looks for the end of a lane over at most 8 edges, or 4 edges and 3 km: every driver knows the whole road.
# They don't go back to the right lane after overtaking, SUMO's default and the rule in Europe.
LOOK_AHEAD_M = 20000.0
# How far a driver slows down for others who must merge. With SUMO's default of 1 a driver of an open lane lets in everybody and
# stands while the closing lane drives past; with 0 the closing lane stands. At three times the demand of two zones (seed 143) a
# vehicle stood for a minute with either, with 0.5 none did.
COOPERATION = 0.5
LOOK_AHEAD_S = 10.0  # SUMO looks lcStrategic x speed x 10 s ahead for changes to the right (LC2013, SL2015)
LEAVE_AHEAD_M = 60.0  # of a closed road: where traffic is led off it; chosen by us
DRIVERS_PER_CLASS = 60  # vTypes of cars, and of trucks, each with its place in the lane and merging distance; chosen by us


def write_demand(
    edges: tuple[Edge, ...], folder: Path, *, spec: DemandSpec, speed: float, seed: int, opposing: tuple[Edge, ...] = (),
    closed_at: float | None = None,
) -> Path:  # fmt: skip
    """Write zone.rou.xml: vehicle types, a route in each direction and every vehicle; returns its path.

    `speed` [m/s] is the posted one; `opposing` are the edges of the other direction. Where the road is closed at a station
    [m], its vehicles leave it LEAVE_AHEAD_M ahead of that, as by an exit.
    """
    if spec.drivers == BY_THE_HCM:
        raise SpecError(f'drivers="{BY_THE_HCM.name}" is decided by the zone: write the demand of Scenario.zone_simulation()')
    rng, root = np.random.default_rng([seed, 1]), ET.Element("routes")
    merge_ahead = {kind: rng.uniform(*spec.merge_ahead_m, size=DRIVERS_PER_CLASS) for kind in ("car", "truck")}
    for kind, size in (("car", CAR), ("truck", TRUCK)):
        for number, ahead in enumerate(merge_ahead[kind]):
            driver = _driver(f"{kind}_{number:02d}", kind, size, spec=spec, speed=speed, merge_ahead=ahead, rng=rng)
            ET.SubElement(root, "vType", driver)
    last = None if closed_at is None else edge_at(edges, closed_at - LEAVE_AHEAD_M)
    driven = edges if last is None else edges[: edges.index(last) + 1]
    ET.SubElement(root, "route", id="through", edges=" ".join(edge.id for edge in driven))
    flows = spec.flow_profile or ((0.0, spec.flow_vph),)
    vehicles = _vehicles(edges, "through", flows=flows, merge_ahead=merge_ahead, spec=spec, rng=rng)
    if last is not None and closed_at is not None:
        for vehicle in vehicles:
            vehicle.set("arrivalPos", f"{closed_at - LEAVE_AHEAD_M - last.start:.2f}")
    if opposing and spec.opposing_flow_vph:
        ET.SubElement(root, "route", id="opposing", edges=" ".join(edge.id for edge in opposing))
        other = np.random.default_rng([seed, 2])
        flows = ((0.0, spec.opposing_flow_vph),)
        vehicles += _vehicles(opposing, "opposing", flows=flows, merge_ahead=merge_ahead, spec=spec, rng=other)
    root.extend(sorted(vehicles, key=lambda vehicle: float(vehicle.get("depart", ""))))  # SUMO reads them in this order
    path = folder / "zone.rou.xml"
    write_xml(root, path)
    return path


def _vehicles(
    edges: tuple[Edge, ...],
    route: str,
    *,
    flows: tuple[tuple[float, float], ...],
    merge_ahead: dict[str, FloatArray],
    spec: DemandSpec,
    rng: np.random.Generator,
) -> list[ET.Element]:
    """Every vehicle that departs along a route; `flows` are as in DemandSpec.flow_profile.

    With `lane_use` each has its lane. Without, SUMO puts a car onto the lane that has most room when it departs, as a driver
    farther upstream would have chosen it: with fixed lanes all of a closing lane's demand enters while that of the lane beside
    waits. A driver whose `merge_ahead` [m] reaches from the road's start to the end of a lane has merged already, and departs
    on a lane that goes on. Trucks keep out of the left lane of three or more, the usual US rule.
    """
    n_lanes, vehicles, ahead = len(edges[0].lanes), [], _lengths_of_lanes(edges)
    use = spec.lane_use if route == "through" else ()
    for number, time in enumerate(_departures(flows, spec.duration_s, rng)):
        kind = "truck" if rng.random() < spec.truck_share else "car"
        lane, driver = int(rng.choice(n_lanes, p=use or None)), int(rng.integers(DRIVERS_PER_CLASS))
        has_merged = ahead <= merge_ahead[kind][driver]
        if kind == "truck" and n_lanes > 2:
            lanes = [n for n in range(n_lanes - 1) if not has_merged[n]]
            lane = min(lane, n_lanes - 2) if use or not lanes else int(rng.choice(lanes))
            depart_lane = str(lane)
        elif use:
            depart_lane = str(lane)
        else:
            depart_lane = "best" if has_merged.any() else "free"
        attributes = {
            "id": f"{'v' if route == 'through' else 'o'}{number:05d}",
            "type": f"{kind}_{driver:02d}",
            "route": route,
            "depart": f"{time:.2f}",
            "departLane": depart_lane,
            "departPos": "base",
            "departSpeed": "avg",
        }
        vehicles.append(ET.Element("vehicle", attributes))
    return vehicles


def _lengths_of_lanes(edges: tuple[Edge, ...]) -> FloatArray:
    """How far (n,) [m] each lane of the first edge goes on from the road's start; without end those that reach the road's."""
    going_on = [lane.of for lane in edges[-1].lanes]
    ends = [[edge.end for edge in edges if lane.of in [q.of for q in edge.lanes]] for lane in edges[0].lanes]
    return np.array([np.inf if lane.of in going_on else max(end) for lane, end in zip(edges[0].lanes, ends, strict=True)])


def _departures(flows: tuple[tuple[float, float], ...], duration_s: float, rng: np.random.Generator) -> FloatArray:
    """Times (n,) [s] of Poisson arrivals before `duration_s`.

    A Poisson process of rate 1, mapped from the expected count of vehicles up to a time to that time.
    """
    starts, vph = np.array(flows).T
    times = np.append(starts, max(duration_s, starts[-1] + 1.0))
    expected = np.concatenate([[0.0], np.cumsum(vph / 3600 * np.diff(times))])
    mean = float(np.interp(duration_s, times, expected))
    enough = int(mean + 8 * np.sqrt(mean) + 10)  # eight standard deviations of a Poisson count
    departures = np.interp(np.cumsum(rng.exponential(size=enough)), expected, times, right=np.inf)
    return np.asarray(departures[departures < duration_s])


def _driver(
    id_: str, kind: str, size: dict[str, float], *, spec: DemandSpec, speed: float, merge_ahead: float, rng: np.random.Generator
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
        "lcStrategic": f"{merge_ahead / (LOOK_AHEAD_S * speed):.3f}",
    }
    truck, drivers = kind == "truck", spec.drivers
    decel = TRUCK_DECEL_MPS2 if truck else CAR_DECEL_MPS2
    return driver | {
        **LANE_KEEPING,
        "lcMaxSpeedLatStanding": f"{STANDING_LATERAL_MPS:g}",
        "lcMaxSpeedLatFactor": f"{(LANE_WIDTH_M - size['width_m']) / 2 / size['length_m']:.3f}",
        "lcStrategicLookahead": f"{LOOK_AHEAD_M:g}",
        "lcKeepRight": "0",
        "lcCooperative": f"{COOPERATION:g}",
        "tau": f"{drivers.truck_tau_s if truck else drivers.tau_s:g}",
        "accel": f"{drivers.truck_accel_mps2 if truck else drivers.accel_mps2:g}",
        "decel": f"{decel:g}",
        "emergencyDecel": f"{decel:g}",
        "minGap": f"{drivers.min_gap_m:g}",
        "sigma": f"{drivers.sigma:g}",
        "lcAssertive": f"{drivers.lc_assertive:g}",
        "lcLookaheadLeft": f"{drivers.lc_lookahead_left:g}",
    }
