"""The sections of a scenario that belong to no single stage: crowd, route, map, control, LiDAR baseline."""

import math
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field
from shapely import Polygon

from wzsumo.behaviour.speed_plan_spec import SpeedPlanSpec
from wzsumo.control.controller import ControlSpec
from wzsumo.errors import SpecError
from wzsumo.lidar_mapping.loam import LoamSpec
from wzsumo.lidar_mapping.slam_map import SlamMapSpec
from wzsumo.planning.planning_field import MAX_PLANNING_CELLS
from wzsumo.sensing.imu import ImuSpec, MappingGnssSpec
from wzsumo.sensing.lidar import LidarSpec
from wzsumo.sensing.scene import SceneSpec
from wzsumo.spec import Spec


class Decides(StrEnum):
    """What a section of a scenario, or a key in it, decides. `Scenario` and the sections annotate their fields with it."""

    NOTHING = "nothing"  # the scenario's name
    SIMULATION = "simulation"  # the traffic of the fleet, and so everything else
    COLLECTION = "collection"  # when enough traces are collected, but not their content
    REPORTS = "reports"  # the traces of which the map is made, and what is learned from them
    LIDAR = "LiDAR"  # the scans of a LiDAR mapping drive and their map
    SITE = "site"  # the cells of the maps, start and goal
    DRIVE = "drive"  # the plan on a map, and the drive along it


class MapSpec(Spec):
    """The size of the cells, and how far the map reaches beyond the pavement."""

    resolution_m: float = Field(0.127, gt=0, le=1)  # 5 in, the sample of Chen et al. 2022
    margin_m: float = Field(2.0, ge=0, le=1000)  # beyond the pavement's edges

    def checked(self, ground: Polygon) -> Polygon:
        """The ground to be mapped. Raises SpecError where it has more cells than the planner takes."""
        left, low, right, high = ground.bounds
        width, height = right - left, high - low
        n_cells = width / self.resolution_m * (height / self.resolution_m)  # the square of a tiny edge is 0
        if n_cells <= MAX_PLANNING_CELLS:
            return ground
        coarser = math.ceil(100 * math.sqrt(width * height / MAX_PLANNING_CELLS)) / 100
        raise SpecError(
            f"map.resolution_m={self.resolution_m:g} makes {n_cells / 1e6:.0f} million cells of the {width:.0f} x {height:.0f} "
            f"m around the road, "
            f"of which at most {MAX_PLANNING_CELLS / 1e6:.0f} million can be planned on; give {coarser:g} or more"
        )


class SlamSpec(Spec):
    """One mapping drive: a 128-layer LiDAR, high-precision GNSS and IMU (Chen et al. 2022) through the zone and its traffic."""

    traffic: bool = True  # whether the scans show the other vehicles
    scene: SceneSpec = SceneSpec()
    lidar: LidarSpec = LidarSpec()
    imu: ImuSpec = ImuSpec()
    gnss: MappingGnssSpec = MappingGnssSpec()
    loam: LoamSpec = LoamSpec()
    maps: SlamMapSpec = SlamMapSpec()


class CrowdSpec(Spec):
    """How many vehicles report their traces, and how many traces are collected and used for the map."""

    # A vehicle that is equipped at some penetration is also equipped at every higher one.
    penetration: Annotated[float, Decides.COLLECTION] = Field(0.15, gt=0, le=1)  # share of vehicles that report
    collected: Annotated[int, Decides.COLLECTION] = Field(30, ge=1)  # vehicles whose traces are kept; Chen et al. 2022
    used: int = Field(5, ge=1)  # traces that make the map; ibid.
    # "passed": the map is made of the first traces to leave the zone, and the ego sets out when they have; "any": of traces
    # of the whole run, drawn by the seed, also of vehicles that pass after the ego.
    known: Literal["passed", "any"] = "passed"


class RouteSpec(Spec):
    """Start and goal of the ego: lane centres before and after the zone, 0 = rightmost lane."""

    start_lane: int = Field(ge=0)  # in which the ego begins, one that stays open or closes
    start_before_zone_m: float = Field(150.0, gt=0)  # ahead of the first device; chosen by us
    goal_lane: int = Field(ge=0)  # in which the ego ends
    goal_after_zone_m: float = Field(100.0, gt=0)  # beyond the last taper; chosen by us
    open_goal_lane: int | None = Field(None, ge=0)  # lane of a second goal, one that continues an open lane


class ControlSection(ControlSpec):
    """How the ego is controlled: along its path, to its speed, and among other vehicles."""

    minds_others: bool = True  # false: it drives as if it were alone
    others: SpeedPlanSpec = SpeedPlanSpec()
