"""The ways from traces to a map that stand side by side, by the names that the command line knows."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.crowd_mapping.augmentation import with_copies
from wzsumo.crowd_mapping.drivable_area import MixtureSpec, samples_inside, squares_map, swept_map
from wzsumo.crowd_mapping.lane_structure import LaneStructureSpec, MapBefore, lane_structured_map
from wzsumo.crowd_mapping.mixture import Mixture
from wzsumo.crowd_mapping.selection import MixtureSweep, sweep_mixtures
from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.plan import PlannerSpec
from wzsumo.road import Road

# Half a metre from the devices is to be left, and the edges of a crowd's map lie up to 0.3 m beyond them. With a wish for 1.2 m
# the least of 100 planned clearances was 0.50 m, on swept maps with 1.0 m 0.45 m (16 zones, seeds 102, 103).
CROWD_CLEARANCE_M = 1.2
PAPER_INFLATION_M = 0.7  # Chen et al. 2022, both mapping branches; the paper plans for a point on that map


@dataclass(frozen=True, kw_only=True, eq=False)
class Crowd:
    """What the crowd's traces gave: the traces, the mixtures tried, the one chosen, the samples drawn from it.

    The mixtures are of stations and offsets [m] on `road`, the samples (n, 2) are x, y [m].
    """

    traces: pd.DataFrame
    road: Road
    sweep: MixtureSweep
    mixture: Mixture
    samples: FloatArray


def learn_from(
    traces: pd.DataFrame, *, road: Road, spec: MixtureSpec, seed: int, progress: Callable[[int, int], None] | None = None
) -> Crowd:
    """The mixture of the traces' points on `road`, chosen by AIC or BIC over K = 1..k_max, and samples from its 95 % region."""
    table = with_copies(traces, copies=spec.copies, driver_sd_m=spec.driver_sd_m, seed=seed) if spec.copies else traces
    points = np.column_stack(road.to_sd(table[["x_m", "y_m"]]))
    sweep = sweep_mixtures(points, seed=seed, k_max=spec.k_max, reg_covar_m2=spec.least_sd_m**2, progress=progress)
    mixture = sweep.best("aic" if spec.criterion == "aic" else "bic")
    samples = road.to_xy(*samples_inside(mixture, spec=spec, seed=seed).T)
    return Crowd(traces=traces, road=road, sweep=sweep, mixture=mixture, samples=samples)


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
    del spec
    lane_spec = LaneStructureSpec(vehicle_width_m=2 * half_width_m)
    return lane_structured_map(crowd.traces, spec=lane_spec, grid=cells, seed=seed, before=before).grid


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
