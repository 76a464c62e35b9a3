"""WorkZone, the spec of a temporary traffic control zone, and WorkZoneLayout, what the MUTCD makes of it.

Stations s run along the road's reference line, offsets d to its left (see `road`). Lane 0 is the rightmost.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Literal

import pandas as pd
from pydantic import Field
from shapely import Polygon, union_all
from shapely.geometry.base import BaseGeometry

from wzsumo.road import Profile, Road
from wzsumo.spec import Spec

DEVICE_COLUMNS = ("kind", "s_m", "d_m", "x_m", "y_m", "height_m", "radius_m")


class DeviceKind(StrEnum):
    """Channelizing devices of MUTCD 11th ed., Sections 6K.03 to 6K.10."""

    CONE_28_IN = "cone_28in"
    CONE_36_IN = "cone_36in"
    DRUM = "drum"


class WorkZone(Spec):
    """What is closed, where and at what posted speed. Lengths that are left out come from the MUTCD."""

    posted_speed_mph: float = Field(ge=20, le=75)  # the range of MUTCD 11th ed. Table 6B-2
    start_ft: float = Field(ge=0)  # station of the first device
    closed_lanes: tuple[int, ...] = ()  # 0 = rightmost; from the outer edge inwards, without a gap
    closed_shoulder: Literal["left", "right"] | None = None
    shift_ft: float = Field(0.0, ge=0)  # the open lanes move away from the closed side by this
    shifted_lane_width_ft: float | None = Field(None, ge=10, le=16)  # None: as before; 10 ft: MUTCD 6G, narrowest
    work_length_ft: float = Field(gt=0)
    taper_tangent_ft: float | None = Field(None, ge=0)  # between merging and shifting taper; None: L/2
    buffer_ft: float | None = Field(None, ge=0)  # longitudinal buffer ahead of the work space; None: stopping sight distance
    downstream_taper_ft: float = Field(100.0, ge=50, le=100)  # per lane, MUTCD 11th ed. Table 6B-3
    device: DeviceKind = DeviceKind.CONE_36_IN
    manual: Literal["MUTCD 11th edition"] = "MUTCD 11th edition"


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

    index: int  # of the road's own lane, 0 = rightmost
    start: float
    end: float
    right: Profile
    left: Profile


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
    closed_strips: tuple[tuple[float, float, Profile, Profile], ...]  # start, end, right, left
    devices: pd.DataFrame  # DEVICE_COLUMNS

    @property
    def start(self) -> float:
        """Station [m] of the first device."""
        return self.areas[0].start

    @property
    def end(self) -> float:
        """Station [m] where the last taper ends."""
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
        return union_all([self.road.strip(*strip) for strip in self.closed_strips])

    @cached_property
    def pavement(self) -> BaseGeometry:
        """All of the road's surface but the closed area."""
        whole = self.road.strip(0.0, self.road.length, -self.road.right_shoulder, self.road.left_edge)
        return whole - self.closed_area

    def drivable_between(self, start: float, end: float) -> Polygon:
        """The drivable area from station `start` to `end` [m]: the truth that a map of that stretch is held against."""
        return self.road.strip(start, end, self.drivable_right, self.drivable_left)
