"""One running SUMO simulation.

libsumo allows one simulation a process. Points leave this module as vehicle CENTRES and headings. The ego enters it as bodies,
each placed by the middle of its FRONT edge.
"""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wzsumo.frames import FloatArray, advance, heading_from_sumo_angle, sumo_angle_from_heading
from wzsumo.simulation.connection import connected_library, connected_window, follow_in_window
from wzsumo.simulation.gridlock import Gridlock
from wzsumo.simulation.turns import OWN_LINK, SIGNAL_ID
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

EGO_ID = "wzsumo.ego"  # of its vehicle, vType and route, which a network's own demand must not bear
EMERGENCY_DECEL_MPS2 = 9.0  # what tyres give on a dry road; SUMO's default for cars
# By how much the ego's bodies are wider than the ego on either side: SUMO's drivers keep no lateral gap to a vehicle that
# moveToXY placed, move 0.1 m aside in a step, and corners of turned vehicles reach farther. Chosen by us.
SIDE_CLEARANCE_M = 0.5
# keepRoute of moveToXY (SUMO docs, TraCI): 2 puts the body exactly at the given place, 1 counts it to a lane of its route.
# Without the 1 SUMO looks for a lane that runs past the point. On the outer side of a kink between two edges there is none:
# SUMO then counts the body to no lane or to a wrong one, and SUMO 1.28 has crashed in the next step.
_PLACEMENT = 2 | 1
_MATCH_RADIUS_M = 100.0  # how far from a lane a body may be put; SUMO's default
_SPARE_WIDTH_M = 0.1  # of a body that stands for no part of the ego


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneBody:
    """A body that stands for the ego in one lane and lies within that lane."""

    lane: int  # of the road, 0 = rightmost
    edge: str  # SUMO's, on which the body's front lies
    lane_on_edge: int  # the lane's index on that edge
    front: FloatArray  # (3,) pose of the middle of its front edge
    width: float  # m


class Session:
    """A running simulation; made by `running`."""

    def __init__(self, api: Any, *, begin: float = 0.0, edges: tuple[str, ...] = ()) -> None:
        self._sumo = api
        self._begin = begin
        self._edges = edges
        self._sizes: dict[str, tuple[float, float]] = {}
        self._own: set[str] = set()  # SUMO's vehicles that are the ego's bodies
        self._bodies: dict[int, str] = {}  # the one of them that stands in a lane of the road, by lane
        self._spare = [EGO_ID]  # bodies that stand for no part of the ego at present
        self._widths: dict[str, float] = {}  # m, of each body where it was put last
        self._emergency_braking: set[str] = set()
        self._gridlock = Gridlock(api, edges)

    @property
    def time(self) -> float:
        """Simulated time [s] from the simulation's beginning."""
        return float(self._sumo.simulation.getTime()) - self._begin

    def step(self) -> None:
        """Advance by one step."""
        self._sumo.simulationStep()

    def resolve_gridlock(self) -> None:
        """Let others make way for a vehicle that has been shut in for long where lanes merge (see `gridlock`)."""
        self._gridlock.resolve()

    def traffic(self) -> Traffic:
        """The vehicles on the road now, without the ego's bodies; in a network those on the edges that are looked at."""
        vehicle, edge = self._sumo.vehicle, self._sumo.edge
        there = [v for id_ in self._edges for v in edge.getLastStepVehicleIDs(id_)] if self._edges else vehicle.getIDList()
        ids = tuple(v for v in there if v not in self._own)
        for id_ in ids:
            if id_ not in self._sizes:
                self._sizes[id_] = (vehicle.getLength(id_), vehicle.getWidth(id_))
        size = np.array([self._sizes[v] for v in ids]).reshape(-1, 2)
        bumper = np.array([vehicle.getPosition(v) for v in ids]).reshape(-1, 2)
        heading = heading_from_sumo_angle([vehicle.getAngle(v) for v in ids])
        return Traffic(
            ids=ids,
            poses=advance(np.column_stack([bumper, heading]), -size[:, 0] / 2),
            speeds=np.array([vehicle.getSpeed(v) for v in ids], dtype=float),
            accelerations=np.array([vehicle.getAcceleration(v) for v in ids], dtype=float),
            lengths=size[:, 0],
            widths=size[:, 1],
        )

    def limit_speed(self, name: str, speed: float | None) -> None:
        """From now on the vehicle wants to drive no faster than `speed` [m/s]; None: as fast as its type may."""
        api = self._sumo.vehicle
        own = self._sumo.vehicletype.getMaxSpeed(_own_type(api.getTypeID(name), name))
        api.setMaxSpeed(name, own if speed is None else speed)

    def may_enter_shared_lane(self) -> bool:
        """Whether the signal of a shared lane is green for traffic along the stations; true where no lane is shared."""
        lights = self._sumo.trafficlight
        return SIGNAL_ID not in lights.getIDList() or lights.getRedYellowGreenState(SIGNAL_ID)[OWN_LINK] in "gG"

    def request_ego(self, vehicle: VehicleGeometry, *, edges: Sequence[str], lane: int, position: float, speed: float) -> None:
        """Ask SUMO to insert the ego, front bumper at `position` [m] of a lane, as soon as traffic leaves a gap for it.

        `edges` are those from the one where it enters to the end of its way.
        """
        api = self._sumo
        api.vehicletype.copy("DEFAULT_VEHTYPE", EGO_ID)
        api.vehicletype.setLength(EGO_ID, vehicle.length_m)
        api.vehicletype.setWidth(EGO_ID, vehicle.width_m + 2 * SIDE_CLEARANCE_M)
        api.route.add(EGO_ID, list(edges))
        self._own.add(EGO_ID)
        api.vehicle.add(
            EGO_ID,
            EGO_ID,
            typeID=EGO_ID,
            depart="now",
            departLane=str(lane),
            departPos=f"{position:.3f}",
            departSpeed=f"{speed:.3f}",
        )

    def has_ego(self) -> bool:
        """Whether the ego is on the road."""
        return EGO_ID in self._sumo.vehicle.getIDList()

    def take_over_ego(self) -> None:
        """From now on the ego goes where `place_ego` puts it and nowhere else; a window follows it."""
        self._take_over(EGO_ID)
        if self._sumo.hasGUI():
            follow_in_window(self._sumo, EGO_ID)

    def allow_emergency_braking(self, names: Collection[str]) -> None:
        """From now on these vehicles may brake as hard as tyres allow, and all others only as hard as their type does.

        Among themselves SUMO's drivers never need more than the service brake, and with more they stop dead where lanes merge
        and shut each other in. The ego is no driver of SUMO's and may make others brake harder.
        """
        api = self._sumo.vehicle
        for name in set(names) - self._emergency_braking:
            api.setEmergencyDecel(name, EMERGENCY_DECEL_MPS2)
        for name in (self._emergency_braking - set(names)) & set(api.getIDList()):
            own = self._sumo.vehicletype.getEmergencyDecel(_own_type(api.getTypeID(name), name))
            api.setEmergencyDecel(name, own)
        self._emergency_braking = set(names)

    def place_ego(self, bodies: tuple[LaneBody, ...], *, speed: float) -> None:
        """Put these bodies where they are to be at the end of the coming step.

        The first is in the lane nearest to the ego's front.

        SUMO counts a vehicle that moveToXY placed to one lane, and drivers in the next lane pass through whatever reaches into
        theirs. So each lane has a body of its own: the vehicle that SUMO inserted, and more of its kind. No body reaches into a
        second lane. Of a vehicle that does, SUMO 1.28 keeps a list of the lanes beside it, and it has crashed over an old list
        when the vehicle had lost its place on the road at a node (MSVehicle::getBackPositionOnLane).

        A body stays in its lane while the ego reaches into that lane. After that it stays in the simulation, inside the first
        body: drivers remember the vehicles beside them until they act again, and SUMO 1.28 has crashed over remembered bodies
        that had been removed or taken off the road.
        """
        for lane in sorted(self._bodies.keys() - {body.lane for body in bodies}):
            self._spare.append(self._bodies.pop(lane))
        for body in bodies:
            if body.lane not in self._bodies:
                self._bodies[body.lane] = self._spare.pop() if self._spare else self._add_body()
            self._place(self._bodies[body.lane], body, width=body.width, speed=speed)
        for name in self._spare:
            self._place(name, bodies[0], width=_SPARE_WIDTH_M, speed=speed)

    def _place(self, name: str, body: LaneBody, *, width: float, speed: float) -> None:
        x, y, heading = body.front
        angle = float(sumo_angle_from_heading(heading))
        api = self._sumo.vehicle
        # A new width holds at once, a new place only after the step: until then the body must fit into the old place too.
        api.setWidth(name, min(width, self._widths.get(name, width)))
        self._widths[name] = width
        # SUMO is told the lane because the nearest middle line may be that of a narrow lane beside.
        api.moveToXY(
            name, body.edge, body.lane_on_edge, x, y, angle=angle, keepRoute=_PLACEMENT, matchThreshold=_MATCH_RADIUS_M
        )
        # Without this SUMO infers the speed from the move, with spikes of 1 m/s.
        api.setSpeed(name, speed)

    def _add_body(self) -> str:
        name = f"{EGO_ID}.{len(self._own)}"
        self._own.add(name)
        self._sumo.vehicle.add(name, EGO_ID, typeID=EGO_ID, depart="now")
        self._take_over(name)
        return name

    def _take_over(self, name: str) -> None:
        self._sumo.vehicle.setSpeedMode(name, 0)
        self._sumo.vehicle.setLaneChangeMode(name, 0)


def _own_type(type_id: str, name: str) -> str:
    """The type that a vehicle was inserted with: SUMO gives a vehicle with a value of its own a copy, type@vehicle."""
    return type_id.removesuffix(f"@{name}")


@contextmanager
def running(
    config: Path, *, options: tuple[str, ...] = (), in_window: bool = False, begin: float = 0.0, edges: tuple[str, ...] = ()
) -> Iterator[Session]:
    """A simulation of a SUMO configuration, closed at the end of the block; with `in_window` it is shown in sumo-gui.

    `begin` is SUMO's time [s] at the beginning, from which the session's times count; `edges` are those whose vehicles are
    looked at, all where none are named.
    Raises SumoMissingError, and DisplayError where no window can be opened or it is closed before the end.
    """
    arguments = ["--configuration-file", str(config), *options]
    with connected_window(arguments) if in_window else connected_library(arguments) as api:
        yield Session(api, begin=begin, edges=edges)
