"""One running SUMO simulation.

libsumo allows one simulation a process. Points leave this module as vehicle CENTRES and headings; the ego is placed by the
middle of its FRONT edge in each lane.
"""

from collections.abc import Collection, Iterator
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

EGO_ID = "ego"
EMERGENCY_DECEL_MPS2 = 9.0  # what tyres give on a dry road; SUMO's default for cars
# Drivers keep it beside the ego, which is that much wider in SUMO: they keep none to a vehicle that moveToXY placed.
SIDE_CLEARANCE_M = 0.3
# keepRoute of moveToXY (SUMO docs, TraCI): exactly where it is told (2), counted to a lane of its route (1). Without the 1 SUMO
# wants a lane that runs past the point. On the outer side of a kink between two edges none does: the body is then counted to no
# lane or to a wrong one, and SUMO 1.28 has crashed in the step after.
_PLACEMENT = 2 | 1
_MATCH_RADIUS_M = 100.0  # how far off a lane a body may be put
_SPARE_WIDTH_M = 0.1  # of a body that nobody needs


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """What drivers in one lane are shown of the ego: a body that lies within that lane."""

    lane: int  # of the road, 0 = rightmost
    edge: str  # SUMO's, on which the body's front lies
    index: int  # of the lane on that edge
    front: FloatArray  # (3,) pose of the middle of its front edge
    width: float  # m


class Session:
    """A running simulation; made by `running`."""

    def __init__(self, api: Any) -> None:
        self._sumo = api
        self._sizes: dict[str, tuple[float, float]] = {}
        self._bodies: dict[int, str] = {}  # by the lane in which each shows the ego
        self._spare = [EGO_ID]  # bodies that nobody needs
        self._widths: dict[str, float] = {}  # m, of each body where it was put last
        self._brake_hard: set[str] = set()
        self._gridlock = Gridlock(api)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._sumo.simulation.getTime())

    def step(self) -> None:
        """Advance by one step."""
        self._sumo.simulationStep()

    def resolve_gridlock(self, traffic: Traffic) -> None:
        """Let go on who has been shut in for long where lanes merge."""
        self._gridlock.resolve(traffic.ids, traffic.poses, traffic.lengths, traffic.speeds)

    def traffic(self) -> Traffic:
        """The vehicles on the road now, without the ego and what stands in for it."""
        vehicle = self._sumo.vehicle
        ids = tuple(v for v in vehicle.getIDList() if not v.startswith(EGO_ID))
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
        own = self._sumo.vehicletype.getMaxSpeed(_own_type(api.getTypeID(name)))
        api.setMaxSpeed(name, own if speed is None else speed)

    def may_enter_shared_lane(self) -> bool:
        """Whether it is the turn of those who drive along the stations, or no lane is shared."""
        lights = self._sumo.trafficlight
        return SIGNAL_ID not in lights.getIDList() or lights.getRedYellowGreenState(SIGNAL_ID)[OWN_LINK] in "gG"

    def request_ego(self, vehicle: VehicleGeometry, *, edge: str, lane: int, position: float, speed: float) -> None:
        """Ask SUMO to insert the ego, front bumper at `position` [m] of a lane, as soon as a driver could."""
        api = self._sumo
        api.vehicletype.copy("DEFAULT_VEHTYPE", EGO_ID)
        api.vehicletype.setLength(EGO_ID, vehicle.length_m)
        api.vehicletype.setWidth(EGO_ID, vehicle.width_m + 2 * SIDE_CLEARANCE_M)
        edges = api.route.getEdges("through")
        api.route.add(EGO_ID, edges[edges.index(edge) :])
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
        """Whether the ego drives."""
        return EGO_ID in self._sumo.vehicle.getIDList()

    def take_over_ego(self) -> None:
        """From now on the ego goes where `place_ego` puts it and nowhere else; a window follows it."""
        self._take_over(EGO_ID)
        if self._sumo.hasGUI():
            follow_in_window(self._sumo, EGO_ID)

    def let_brake_hard(self, names: Collection[str]) -> None:
        """From now on these vehicles brake as hard as tyres allow where they must, and all others as hard as their type does.

        Among themselves drivers never need more than their service brake, and with more they stop dead where lanes merge and
        shut each other in. What the ego does, which is none of them, may ask for more.
        """
        api = self._sumo.vehicle
        for name in set(names) - self._brake_hard:
            api.setEmergencyDecel(name, EMERGENCY_DECEL_MPS2)
        for name in (self._brake_hard - set(names)) & set(api.getIDList()):
            own = self._sumo.vehicletype.getEmergencyDecel(_own_type(api.getTypeID(name)))
            api.setEmergencyDecel(name, own)
        self._brake_hard = set(names)

    def place_ego(self, parts: tuple[Part, ...], *, speed: float) -> None:
        """Show drivers these parts of the ego at the end of the coming step; its front is nearest to the first one's lane.

        SUMO counts a vehicle that moveToXY placed to one lane: drivers in the next pass through whatever reaches into theirs.
        So each lane has a body of its own: the vehicle that SUMO let in, and more of its kind. None reaches into a second lane:
        of a vehicle that does SUMO 1.28 keeps the lanes beside it, and has crashed over an old list of them when the vehicle
        had lost its place on the road at a node (MSVehicle::getBackPositionOnLane).

        A body stays in its lane as long as the ego is shown there, and in the simulation when it is not: drivers keep whom they
        saw beside them until they act again, and SUMO 1.28 has crashed over bodies that had been removed, or taken off the
        road, under their eyes. It rides inside the first part then.
        """
        for lane in sorted(self._bodies.keys() - {part.lane for part in parts}):
            self._spare.append(self._bodies.pop(lane))
        for part in parts:
            if part.lane not in self._bodies:
                self._bodies[part.lane] = self._spare.pop() if self._spare else self._add_body()
            self._place(self._bodies[part.lane], part, width=part.width, speed=speed)
        for name in self._spare:
            self._place(name, parts[0], width=_SPARE_WIDTH_M, speed=speed)

    def _place(self, name: str, part: Part, *, width: float, speed: float) -> None:
        x, y, heading = part.front
        angle = float(sumo_angle_from_heading(heading))
        api = self._sumo.vehicle
        # A new width holds at once, the new place after the step: until then the body must fit into the old one too.
        api.setWidth(name, min(width, self._widths.get(name, width)))
        self._widths[name] = width
        # The lane is told because the nearest centre line may be another's, as beside a narrow one.
        api.moveToXY(name, part.edge, part.index, x, y, angle=angle, keepRoute=_PLACEMENT, matchThreshold=_MATCH_RADIUS_M)
        # Without it SUMO infers a speed from the move, with spikes of 1 m/s.
        api.setSpeed(name, speed)

    def _add_body(self) -> str:
        name = f"{EGO_ID}.{len(self._bodies)}"
        self._sumo.vehicle.add(name, EGO_ID, typeID=EGO_ID, depart="now")
        self._take_over(name)
        return name

    def _take_over(self, name: str) -> None:
        self._sumo.vehicle.setSpeedMode(name, 0)
        self._sumo.vehicle.setLaneChangeMode(name, 0)


def _own_type(type_id: str) -> str:
    """The type that a vehicle came with: SUMO makes a copy, type@vehicle, of which single values are set."""
    return type_id.split("@", maxsplit=1)[0]


@contextmanager
def running(config: Path, *, options: tuple[str, ...] = (), in_window: bool = False) -> Iterator[Session]:
    """A simulation of a SUMO configuration, closed at the end of the block; where asked for, to be watched in sumo-gui.

    Raises SumoMissingError, and DisplayError where there is no window to be had or it is closed before the end.
    """
    arguments = ["--configuration-file", str(config), *options]
    with connected_window(arguments) if in_window else connected_library(arguments) as api:
        yield Session(api)
