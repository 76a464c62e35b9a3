"""WorkZone: the spec of a temporary traffic control zone. WorkZoneLayout: the zone as the MUTCD lays it out.

Stations s run along the road's reference line, offsets d to its left (see `road`). Lane 0 is the rightmost.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
import pandas as pd
import shapely
from pydantic import Field, field_validator, model_validator
from shapely import union_all
from shapely.geometry.base import BaseGeometry

from wzsumo.road import MAX_ROAD_FT, Profile, Road
from wzsumo.spec import Spec

# A device is a disc of radius_m where length_m is 0, else a box that long along heading_rad and 2 radius_m wide.
DEVICE_COLUMNS = ("kind", "s_m", "d_m", "x_m", "y_m", "heading_rad", "height_m", "radius_m", "length_m")
SIGN_COLUMNS = ("code", "text", "s_m", "d_m", "x_m", "y_m", "heading_rad")  # heading of the traffic that reads it

Side = Literal["left", "right"]


class DeviceKind(StrEnum):
    """Channelizing devices of MUTCD 11th ed., Sections 6K.03 to 6K.10, and the temporary traffic barrier of Section 6M.02."""

    CONE_28_IN = "cone_28in"
    CONE_36_IN = "cone_36in"
    DRUM = "drum"
    BARRIER = "barrier"


class RoadType(StrEnum):
    """Kinds of road by which MUTCD 11th ed., Table 6B-1 spaces advance-warning signs."""

    URBAN_LOW_SPEED = "urban_low_speed"
    URBAN_HIGH_SPEED = "urban_high_speed"
    RURAL = "rural"
    FREEWAY = "freeway"  # or expressway


class WorkZone(Spec):
    """What is closed, where and at what posted speed. Lengths left out are those of the MUTCD."""

    posted_speed_mph: float = Field(ge=20, le=75)  # the range of MUTCD 11th ed. Table 6B-2
    # Decides the distances of the signs; drivers = "hcm" goes with a freeway alone. The paper's road is a freeway.
    road_type: RoadType = RoadType.FREEWAY
    typical_application: str | None = None  # such as "TA-33"; a zone that differs from the figure in the manual is refused
    start_ft: float = Field(ge=0, le=MAX_ROAD_FT)  # station of the first device; in a network [network] says the place
    closed_lanes: tuple[int, ...] = ()  # 0 = rightmost; adjacent lanes
    closed_shoulder: Side | None = None  # for an interior closure: the side whose outer lane closes first
    shift_ft: float = Field(0.0, ge=0, le=100)  # by which the open lanes move away from the closed side
    shifted_lane_width_ft: float | None = Field(None, ge=10, le=16)  # None: the lane's own; 10 ft: MUTCD 6G, narrowest
    one_lane_two_way: Literal["signal", "flaggers"] | None = None  # both directions take turns on the opposing lane
    work_length_ft: float = Field(gt=0, le=MAX_ROAD_FT)  # of the work space, between the buffer and the downstream taper
    taper_tangent_ft: float | None = Field(
        None, le=MAX_ROAD_FT
    )  # between two tapers; None: 2 L between merging tapers, L/2 before a shift
    one_lane_two_way_taper_ft: float = Field(100.0, ge=50, le=100)  # MUTCD 11th ed. Table 6B-3
    buffer_ft: float | None = Field(
        None, ge=0, le=MAX_ROAD_FT
    )  # longitudinal buffer ahead of the work space; None: stopping sight distance
    downstream_taper_ft: float = Field(100.0, ge=50, le=100)  # per lane, MUTCD 11th ed. Table 6B-3
    device: DeviceKind = DeviceKind.CONE_36_IN  # along tapers and, where work_space_device is left out, everywhere
    work_space_device: DeviceKind | None = None  # beside the activity area; None: as `device`
    device_gaps_ft: tuple[tuple[float, float], ...] = ()  # stretches, from start_ft on, where devices are missing
    manual: Literal["MUTCD 11th edition"] = "MUTCD 11th edition"  # whose lengths and spacings are laid out

    @field_validator("taper_tangent_ft")
    @classmethod
    def _tapers_do_not_overlap(cls, value: float | None) -> float | None:
        if value is not None and value < 0:
            raise ValueError(f"the two tapers would overlap by {-value:g} ft; give 0 or more, or leave it out for the manual's")
        return value

    @field_validator("device")
    @classmethod
    def _tapers_are_no_wall(cls, value: DeviceKind) -> DeviceKind:
        if value is DeviceKind.BARRIER:
            raise ValueError(
                "a barrier must not form the tapers (MUTCD 11th ed., Section 6M.02); give a cone or drum here and "
                'work_space_device = "barrier"'
            )
        return value

    @model_validator(mode="after")
    def _gaps_are_stretches(self) -> Self:
        for start, end in self.device_gaps_ft:
            if not 0 <= start < end:
                raise ValueError(f"device_gaps_ft: [{start:g}, {end:g}] must be [from, to] in feet from start_ft on, from < to")
        return self


@dataclass(frozen=True, kw_only=True)
class Area:
    """A named stretch of the zone, stations in metres."""

    name: str
    start: float
    end: float

    @property
    def length(self) -> float:
        """Length [m]."""
        return self.end - self.start


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenLane:
    """A lane that traffic may use from station `start` to `end` [m]: lateral offsets of its two lines as functions of s."""

    index: int  # of the lane of the road in which it begins, 0 = rightmost
    start: float
    end: float
    right: Profile
    left: Profile
    opposing: bool = False  # driven against the stations; right and left are as seen along them


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedStrip:
    """Ground that devices fence off from station `start` to `end` [m], between two lateral offsets as functions of s."""

    start: float
    end: float
    right: Profile
    left: Profile
    interior: bool = False  # with open lanes on both sides


@dataclass(frozen=True, kw_only=True)
class TakingTurns:
    """A stretch on which both directions take turns on one lane: stations [m] of its two stop lines, and its control."""

    start: float
    end: float
    control: Literal["signal", "flaggers"]


@dataclass(frozen=True, kw_only=True, eq=False)
class WorkZoneLayout:
    """Stations, lane lines, areas and devices of a work zone on its road.

    `drivable` lies between the line of devices and the right (left) edge line of the open lanes; `pavement` adds the
    shoulders that stay open; `closed_area` is what devices fence off. Polygons are in world metres over the whole road.
    A device stands with its outline touching the line from the closed side.
    """

    work_zone: WorkZone
    road: Road
    areas: tuple[Area, ...]
    lanes: tuple[OpenLane, ...]
    drivable_right: Profile
    drivable_left: Profile
    closed_strips: tuple[ClosedStrip, ...]
    devices: pd.DataFrame  # DEVICE_COLUMNS
    signs: pd.DataFrame  # SIGN_COLUMNS; those that stand ahead of the modelled road have a negative station
    taking_turns: TakingTurns | None = None

    @property
    def start(self) -> float:
        """Station [m] of the first device."""
        return self.areas[0].start

    @property
    def end(self) -> float:
        """Station [m] of the end of the last taper."""
        return self.areas[-1].end

    def area(self, name: str) -> Area:
        """The area of that name; KeyError where the zone has none."""
        for area in self.areas:
            if area.name == name:
                return area
        raise KeyError(name)

    @cached_property
    def drivable(self) -> BaseGeometry:
        """Area between the device line and the edge lines of the open lanes."""
        return self.drivable_between(0.0, self.road.length)

    @cached_property
    def closed_area(self) -> BaseGeometry:
        """Area that devices fence off."""
        return union_all([self._area_of(strip) for strip in self.closed_strips])

    @cached_property
    def pavement(self) -> BaseGeometry:
        """The road's surface without the closed area."""
        whole = self.road.strip(0.0, self.road.length, -self.road.right_shoulder, self.road.left_edge)
        # Along a bend, rounding leaves slivers along edges that the two share.
        parts = shapely.get_parts(whole - self.closed_area)
        return union_all(parts[shapely.area(parts) > 1e-4])

    @cached_property
    def device_outlines(self) -> npt.NDArray[Any]:
        """Polygons (n,) of the devices' outlines on the ground, in the order of the table."""
        return device_outlines(self.devices)

    def drivable_between(self, start: float, end: float) -> BaseGeometry:
        """The drivable area from station `start` to `end` [m]: the truth for a map of that stretch."""
        whole = self.road.strip(start, end, self.drivable_right, self.drivable_left)
        return whole - union_all([self._area_of(strip) for strip in self.closed_strips if strip.interior])

    def _area_of(self, strip: ClosedStrip) -> BaseGeometry:
        return self.road.strip(strip.start, strip.end, strip.right, strip.left)


def device_outlines(devices: pd.DataFrame) -> npt.NDArray[Any]:
    """Polygons (n,) of the outlines on the ground of devices in DEVICE_COLUMNS: discs, and boxes where they have a length."""
    columns = ["x_m", "y_m", "heading_rad", "radius_m", "length_m"]
    x, y, heading, radius, length = devices[columns].to_numpy(dtype=float).T
    along = np.column_stack([np.cos(heading), np.sin(heading)]) * (length / 2)[:, None]
    across = np.column_stack([-np.sin(heading), np.cos(heading)]) * radius[:, None]
    centre = np.column_stack([x, y])
    corners = [centre - along - across, centre + along - across, centre + along + across, centre - along + across]
    boxes = shapely.polygons(np.stack(corners, axis=1))
    # A polygon with 64 corners is within 0.1 % of the disc's radius.
    discs = shapely.buffer(shapely.points(centre), radius, quad_segs=16)
    return np.where(length > 0, np.asarray(boxes), np.asarray(discs))
