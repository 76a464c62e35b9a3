"""Length and width of the vehicle types of a demand."""

from collections.abc import Iterable
from dataclasses import dataclass

from wzsumo.placement.demand_files.vehicles import DEFAULT_CLASS, DEFAULT_TYPE, number_in
from wzsumo.placement.net import ROAD_CLASSES
from wzsumo.placement.xml_file import Element, XmlFile

# (length, width) [m] of SUMO's vehicle classes (SUMO docs, Vehicle Type Parameter Defaults).
CLASS_SIZES = {
    "passenger": (5.0, 1.8), "private": (5.0, 1.8), "taxi": (5.0, 1.8), "hov": (5.0, 1.8), "evehicle": (5.0, 1.8),
    "vip": (5.0, 1.8), "army": (5.0, 1.8), "authority": (5.0, 1.8), "custom1": (5.0, 1.8), "custom2": (5.0, 1.8),
    "ignoring": (5.0, 1.8), "emergency": (6.5, 2.16), "delivery": (6.5, 2.16), "truck": (7.1, 2.4), "trailer": (16.5, 2.55),
    "bus": (12.0, 2.5), "coach": (14.0, 2.6), "motorcycle": (2.2, 0.9), "moped": (2.1, 0.78), "bicycle": (1.6, 0.65),
    "scooter": (1.2, 0.5), "wheelchair": (1.2, 0.72), "tram": (22.0, 2.4), "rail_urban": (109.5, 3.0), "subway": (109.5, 3.0),
    "rail": (135.0, 2.84), "rail_electric": (200.0, 2.95), "rail_fast": (200.0, 2.95), "ship": (17.0, 4.0),
    "cable_car": (5.0, 1.8), "aircraft": (72.7, 79.8), "drone": (0.5, 0.5),
}  # fmt: skip
# SUMO's own types by their class (ibid.).
OWN_TYPES = {
    DEFAULT_TYPE: DEFAULT_CLASS, "DEFAULT_TAXITYPE": "taxi", "DEFAULT_BIKETYPE": "bicycle", "DEFAULT_RAILTYPE": "rail",
}  # fmt: skip


# Length [m] of the first part of vehicles that bend (SUMO 1.28; its other road vehicles are rigid).
FIRST_PARTS_M = {"trailer": 9.25}


@dataclass(frozen=True, kw_only=True)
class VehicleSize:
    """Length and width [m] of vehicles of a class; `first_part` is the length of what drives ahead of a trailer, else all."""

    vehicle_class: str
    length: float
    width: float
    first_part: float

    @property
    def parts(self) -> tuple[tuple[float, float], ...]:
        """Where each rigid part begins and ends, in metres behind the front."""
        first = (0.0, self.first_part)
        return (first,) if self.first_part >= self.length else (first, (self.first_part, self.length))


CARS = frozenset({VehicleSize(vehicle_class=DEFAULT_CLASS, length=5.0, width=1.8, first_part=5.0)})


def vehicle_sizes(files: Iterable[XmlFile]) -> dict[str, tuple[float, float]]:
    """(length, width) [m] by the id of each vehicle type of the files, SUMO's own types included."""
    own = {name: CLASS_SIZES[vehicle_class] for name, vehicle_class in OWN_TYPES.items()}
    return own | {id_: (size.length, size.width) for id_, size in vehicle_types(files).items()}


def sizes_on_roads(files: Iterable[XmlFile]) -> frozenset[VehicleSize]:
    """The sizes of the files' vehicle types that drive on carriageways, and cars."""
    return CARS | {size for size in vehicle_types(files).values() if size.vehicle_class in ROAD_CLASSES}


def vehicle_types(files: Iterable[XmlFile]) -> dict[str, VehicleSize]:
    """The vehicle types of the files by their ids."""
    types: dict[str, VehicleSize] = {}

    def take(element: Element) -> None:
        for item in element.walk():
            if item.tag == "vType":
                vehicle_class = item.get("vClass", DEFAULT_CLASS)
                length, width = CLASS_SIZES.get(vehicle_class, CLASS_SIZES[DEFAULT_CLASS])
                own = number_in(item.get("length"), length) or length, number_in(item.get("width"), width) or width
                first = number_in(item.get("locomotiveLength"), FIRST_PARTS_M.get(vehicle_class)) or own[0]
                types[item.get("id")] = VehicleSize(
                    vehicle_class=vehicle_class, length=own[0], width=own[1], first_part=min(first, own[0])
                )

    for file in files:
        file.root_and_children(take)
    return types
