"""The ways from traces to a map that stand side by side, by the names that the command line knows."""

from wzsumo.case.crowd import Crowd
from wzsumo.crowd_mapping.closing.map_before import MapBefore
from wzsumo.crowd_mapping.lane_structure import LaneStructureSpec, lane_structured_map
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec, squares_map, swept_map
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.planner_spec import PlannerSpec

# Half a metre from the devices is to be left, and the edges of a crowd's map lie up to 0.3 m beyond them. With a wish for 1.2 m
# the least of 100 planned clearances was 0.50 m, on swept maps with 1.0 m 0.45 m (16 zones, seeds 102, 103).
CROWD_CLEARANCE_M = 1.2
PAPER_INFLATION_M = 0.7  # Chen et al. 2022, both mapping branches; the paper plans for a point on that map


def paper_literal(
    crowd: Crowd, *, spec: MixtureSpec, cells: OccupancyGrid, half_width_m: float, before: MapBefore | None, seed: int
) -> OccupancyGrid:
    """The paper's inverse grid with its 5 x 5 inch squares."""
    del half_width_m, before, seed
    return squares_map(crowd.samples, side_m=spec.literal_square_m, grid=cells)


def paper(
    crowd: Crowd, *, spec: MixtureSpec, cells: OccupancyGrid, half_width_m: float, before: MapBefore | None, seed: int
) -> OccupancyGrid:
    """The paper's inverse grid with squares so large that the samples join."""
    del half_width_m, before, seed
    return squares_map(crowd.samples, side_m=spec.square_m, grid=cells)


def swept(
    crowd: Crowd, *, spec: MixtureSpec, cells: OccupancyGrid, half_width_m: float, before: MapBefore | None, seed: int
) -> OccupancyGrid:
    """The 95 % region of vehicle centres, swept by the vehicle's width."""
    del before, seed
    return swept_map(crowd.mixture, road=crowd.road, half_width_m=half_width_m, spec=spec, grid=cells)


def lanes(
    crowd: Crowd, *, spec: MixtureSpec, cells: OccupancyGrid, half_width_m: float, before: MapBefore | None, seed: int
) -> OccupancyGrid:
    """The lanes that the traces were driven in, with a probability in every cell."""
    del spec, seed
    lane_spec = LaneStructureSpec(vehicle_width_m=2 * half_width_m)
    return lane_structured_map(crowd.traces, spec=lane_spec, grid=cells, before=before).grid


MAP_METHODS = {method.__name__: method for method in (paper_literal, paper, swept, lanes)}


def planner_for(method: str, planner: PlannerSpec) -> PlannerSpec:
    """The planner that belongs to a method.

    As in the paper its maps are inflated and searched for a point, without a guide. On the crowd's other maps more clearance is
    wished for.
    """
    if method in {"paper_literal", "paper"}:
        return planner.model_copy(update={"body": "point", "inflation_radius_m": PAPER_INFLATION_M, "guide_cost": 0.0})
    if method in {"swept", "lanes"}:
        wish = max(planner.preferred_clearance_m, CROWD_CLEARANCE_M)
        return planner.model_copy(update={"preferred_clearance_m": wish})
    return planner
