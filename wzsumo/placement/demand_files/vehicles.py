"""Who drives where: the vehicles of all demand files with their vehicle class and their route, or its ends."""

import math
from collections import Counter
from dataclasses import dataclass, field

from wzsumo.placement.xml_file import Element, XmlFile

DEFAULT_TYPE = "DEFAULT_VEHTYPE"  # SUMO's, of vehicles that name none
DEFAULT_CLASS = "passenger"  # SUMO's, of vehicle types that name none
A_DAY_S = 86_400.0  # how long a flow without an end is taken to last


@dataclass(frozen=True, kw_only=True)
class Trip:
    """What vehicles have in common: their edges in full, or (`routed` False) those between which SUMO looks for a route."""

    edges: tuple[str, ...]
    routed: bool
    vehicle_class: str


@dataclass(eq=False)
class Demand:
    """The demand of a configuration."""

    routes: dict[str, list[str]] = field(default_factory=dict)  # edges by the id of a route
    trips: Counter[Trip] = field(default_factory=Counter)  # number of vehicles
    uses_default_type: bool = False
    defines_default_type: bool = False
    missing_routes: set[str] = field(default_factory=set)  # ids of routes that vehicles name and no file has
    named: set[str] = field(default_factory=set)  # ids of polygons, points to draw and rerouters
    outputs: set[str] = field(default_factory=set)  # names of files that detectors and the like write
    _classes: dict[str, str] = field(default_factory=dict)
    _vehicles: list[tuple[Element, str]] = field(default_factory=list)

    @classmethod
    def read(cls, files: list[XmlFile]) -> "Demand":
        """The demand that these files hold together."""
        demand = cls()
        for file in files:
            file.root_and_children(demand._take)
        for element in demand._vehicles:
            demand._count(*element)
        demand._vehicles.clear()
        return demand

    @property
    def classes(self) -> set[str]:
        """The vehicle classes of all vehicles; that of cars where there is none."""
        return {trip.vehicle_class for trip in self.trips} or {DEFAULT_CLASS}

    def _take(self, element: Element) -> None:
        for item in element.walk():
            if item.tag == "vType":
                self._classes[item.get("id")] = item.get("vClass", DEFAULT_CLASS)
                self.defines_default_type |= item.get("id") == DEFAULT_TYPE
            elif item.tag == "route" and item.get("id"):
                self.routes[item.get("id")] = item.get("edges").split()
            elif item.tag in {"poly", "poi", "rerouter"}:
                self.named.add(item.get("id"))
            self.outputs.update(item.get(key) for key in ("file", "output") if item.get(key))
        if element.tag == "vTypeDistribution":
            members = [child.get("id") for child in element.children] + element.get("vTypes").split()
            self._classes[element.get("id")] = next((self._classes[m] for m in members if m in self._classes), DEFAULT_CLASS)
        elif element.tag == "routeDistribution":
            members = [child.get("refId") or child.get("id") for child in element.children] + element.get("routes").split()
            self.routes.setdefault(element.get("id"), next((self.routes[m] for m in members if m in self.routes), []))
        elif element.tag in {"vehicle", "trip", "flow"}:
            self.uses_default_type |= element.get("type", DEFAULT_TYPE) == DEFAULT_TYPE
            self._vehicles.append((element, element.get("type", DEFAULT_TYPE)))

    def _count(self, element: Element, type_id: str) -> None:
        embedded = [child for child in element.children if child.tag == "route"]
        edges = embedded[0].get("edges").split() if embedded else self.routes.get(element.get("route"), [])
        routed = bool(edges)
        if element.get("route") and element.get("route") not in self.routes:
            self.missing_routes.add(element.get("route"))
        if not routed:
            ends = [element.get("from"), *element.get("via").split(), element.get("to")]
            edges = [edge for edge in ends if edge]
        vehicle_class = self._classes.get(type_id, DEFAULT_CLASS)
        self.trips[Trip(edges=tuple(edges), routed=routed, vehicle_class=vehicle_class)] += vehicles_of(element)


def vehicles_of(element: Element) -> int:
    """How many vehicles a vehicle, trip or flow stands for, as far as its attributes say."""
    if element.tag != "flow":
        return 1
    if number := number_in(element.get("number")):
        return int(number)
    duration = max(seconds_in(element.get("end"), A_DAY_S) - seconds_in(element.get("begin"), 0.0), 0.0)
    if per_hour := number_in(element.get("vehsPerHour") or element.get("perHour")):
        return round(duration * per_hour / 3600)
    if probability := number_in(element.get("probability")):
        return round(duration * probability)
    period = element.get("period")
    if period.startswith("exp("):
        return round(duration * (number_in(period[4:-1]) or 0.0))
    seconds = number_in(period)
    return round(duration / seconds) if seconds and seconds > 0 else 1


def number_in(text: str, default: float | None = None) -> float | None:
    """The number that an attribute holds; `default` for none, for infinity and for words such as "random"."""
    try:
        number = float(text)
    except ValueError:
        return default
    return number if math.isfinite(number) else default


def seconds_in(text: str, default: float) -> float:
    """Seconds of a time as SUMO writes it, 90 or 0:01:30; `default` for none and for words."""
    try:
        parts = [float(part) for part in text.split(":")]
    except ValueError:
        return default
    if not all(map(math.isfinite, parts)) or len(parts) > 4:
        return default
    while len(parts) < 4:
        parts.insert(0, 0.0)
    return ((parts[0] * 24 + parts[1]) * 60 + parts[2]) * 60 + parts[3]
