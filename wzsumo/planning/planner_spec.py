"""PlannerSpec: how paths are searched for."""

from typing import Literal

from pydantic import Field

from wzsumo.grid import FREE_THRESHOLD
from wzsumo.spec import Spec
from wzsumo.vehicle import VehicleGeometry


class PlannerSpec(Spec):
    """How a path is searched for on a map. Lengths in metres.

    The paper's way (Chen et al. 2022) is body="point" with inflation_radius_m=0.7, less than half a car's width.
    """

    # It limits the curvature. In a scenario that gives none: the speed of [control]. 10 m/s: Chen et al. 2022.
    planned_speed_mps: float = Field(default=10.0, ge=0, le=60)
    slowest_share: float = Field(default=0.1, gt=0, le=1)  # of the planned speed, down to which a path is looked for if need be
    max_lateral_acceleration_mps2: float = Field(default=2.0, gt=0)  # comfort limit, chosen by us
    # plans for the exact outline, or for a point on an inflated map, as Chen et al. 2022
    body: Literal["outline", "point"] = "outline"
    inflation_radius_m: float = Field(default=0.0, ge=0)  # by which occupied cells grow; goes with body "point"
    max_p_occupied: float = Field(default=FREE_THRESHOLD, gt=0, le=1)  # cells from here on are blocked: unknown is not free
    preferred_clearance_m: float = Field(default=1.0, gt=0)  # of the outline; a path with less of it costs more
    clearance_cost: float = Field(default=8.0, ge=0)  # a metre without clearance costs 1 + this
    occupancy_cost: float = Field(default=10.0, ge=0)  # a metre over cells of p costs 1 + this * p
    guide_cost: float = Field(default=12.0, ge=0)  # a metre far off the guide costs 1 + this; of 0, 2, 6, 12 paths weave least
    guide_slack_m: float = Field(default=0.3, ge=0)  # so near the guide costs nothing: drivers scatter by 0.2-0.4 m in a lane
    guide_reach_m: float = Field(default=1.83, gt=0)  # half a 12 ft lane (AASHTO Green Book); being farther off costs no more
    heuristic_weight: float = Field(default=1.2, ge=1)  # 1: cheapest path; more: found sooner
    max_expansions: int = Field(default=100_000, ge=1)  # takes about half a second
    smooth: bool = True  # whether the path found is smoothed
    max_curvature_jump_1pm: float = Field(default=0.002, gt=0)  # between poses of the path, 0.5 m apart at most

    def max_curvature(self, vehicle: VehicleGeometry, *, speed_mps: float) -> float:
        """Largest curvature [1/m] by steering angle and by lateral acceleration at a speed."""
        steering = 1 / vehicle.min_turning_radius_m
        if steering * speed_mps**2 <= self.max_lateral_acceleration_mps2:  # also where a square underflows
            return steering
        return self.max_lateral_acceleration_mps2 / speed_mps**2

    @property
    def max_metre_cost(self) -> float:
        """Largest cost of a metre of path: without clearance, over cells at the threshold of p, far off the guide."""
        return 1 + self.clearance_cost + self.occupancy_cost * self.max_p_occupied + self.guide_cost
