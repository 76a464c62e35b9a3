"""The section [network] of a scenario, in place of [road]: a SUMO network with its demand, and where the zone stands in it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from pydantic import Field, model_validator

from wzsumo.errors import check_name
from wzsumo.spec import Spec
from wzsumo.work_zone import Side

_FILES = ("net", "sumocfg", "routes", "additionals")


class NetworkSection(Spec):
    """Files are named relative to the scenario's file. Times count from the simulation's beginning."""

    net: Path  # a .net.xml of SUMO
    sumocfg: Path | None = None  # a configuration of the network, with all its files; else `routes` and `additionals`
    routes: tuple[Path, ...] = ()  # route files: the demand
    additionals: tuple[Path, ...] = ()  # additional files: detectors, stops, ...
    edge: str | None = None  # on which the first device stands, at position_m
    position_m: float | None = None  # of the first device along `edge`; negative: from the edge's end
    latitude_deg: float | None = Field(
        None, ge=-90, le=90
    )  # instead of `edge`: the first device stands nearest to this place, WGS 84
    longitude_deg: float | None = Field(None, ge=-180, le=180)  # of that place
    lane_side: Side | None = None  # on which as many lanes close as [work_zone] says; None: those that it names
    left_shoulder_ft: float = Field(0.0, ge=0, le=30)  # paved, of the road; a network has none
    right_shoulder_ft: float = Field(0.0, ge=0, le=30)  # as on the left
    closed_from_s: float = Field(0.0, ge=0)  # when the set-up of the zone begins
    closed_for_s: float | None = Field(None, gt=0)  # from then until all lanes are open again; None: to the end

    @model_validator(mode="after")
    def _one_place_and_one_demand(self) -> Self:
        on_edge = (self.edge is not None, self.position_m is not None)
        on_earth = (self.latitude_deg is not None, self.longitude_deg is not None)
        if not (all(on_edge) and not any(on_earth)) and not (all(on_earth) and not any(on_edge)):
            raise ValueError("give the place of the zone either as edge and position_m, or as latitude_deg and longitude_deg")
        if self.sumocfg and (self.routes or self.additionals):
            raise ValueError("sumocfg names its routes and additionals itself; leave routes and additionals out")
        if not self.sumocfg and not self.routes:
            raise ValueError("no demand; give routes, or a sumocfg that names them")
        return self

    @property
    def latlon(self) -> tuple[float, float]:
        """Latitude and longitude [deg] of the zone's beginning."""
        return self.latitude_deg or 0.0, self.longitude_deg or 0.0

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that the section names."""
        return tuple(path for path in (self.net, self.sumocfg, *self.routes, *self.additionals) if path)


def beside(content: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The section's content with its files named from `folder`, as paths that hold anywhere.

    Raises InputError where no file can be called so.
    """

    def found(key: str, value: object) -> object:
        if isinstance(value, list):
            return [found(key, item) for item in value]
        if not isinstance(value, str):
            return value
        check_name(folder / value, named_by=f"network.{key}")
        return str((folder / value).resolve())

    return {key: found(key, value) if key in _FILES else value for key, value in content.items()}
