"""The crowd: what equipped vehicles of the fleet report, what is learned of it, and which ground they surely drove over."""

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import cached_property
from math import dist
from typing import Any, Literal

import numpy as np
import pandas as pd
import shapely
from shapely import LineString

from wzsumo.case.watch import Tell
from wzsumo.crowd_mapping.mixture.augmentation import with_copies
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec, driven_lines, samples_inside
from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.crowd_mapping.mixture.selection import MixtureSweep, sweep_mixtures
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import OccupancyGrid, cells_inside
from wzsumo.metrics.fleet import passages
from wzsumo.road import Road
from wzsumo.scenario.scenario import Scenario
from wzsumo.sensing.equipped import choose_equipped, first_traces
from wzsumo.sensing.gnss import report
from wzsumo.work_zone import WorkZoneLayout

# Traces begin this far ahead of the zone, where MUTCD TA-33 tells drivers which lane closes ("1/2 mile"): many leave it there
TRACE_AHEAD_M = 805.0
TRACE_MARGIN_M = 50.0  # they reach this far beyond it, and so do mixtures on either side, to join the nominal map; chosen by us
MIN_WITNESSES = 2  # vehicles; one alone may have been out of its lane
POSITION_ERROR_SDS = 2.0  # standard deviations that a reported position may be off; 95 % of normal errors are smaller
MAX_TRACE_ERROR_M = 0.01  # by which a simplified trace may leave the reported one
# A fix nearer than this to the one before says nothing new of the ground. The fixes of a vehicle that waits are a knot as wide
# as its receiver's noise, and the ground around the thousands of a long wait takes minutes to find. Chosen by us.
MIN_FIX_SPACING_M = 0.5
LINK_STEP_M = 5.0  # between the points of a link: on a radius of 300 m its chords leave the arc by 1 cm


def traces_over_zone(fleet: pd.DataFrame, layout: WorkZoneLayout) -> pd.DataFrame:
    """True traces from TRACE_AHEAD_M ahead of the zone to TRACE_MARGIN_M beyond it, of the vehicles that passed all of it."""
    station, _ = layout.road.to_sd(fleet[["x_m", "y_m"]])
    in_zone = (station >= layout.start - TRACE_AHEAD_M) & (station <= layout.end + TRACE_MARGIN_M)
    return fleet[in_zone & fleet["vehicle_id"].isin(passages(fleet, layout)).to_numpy()].reset_index(drop=True)


def reported_traces(over_zone: pd.DataFrame, scenario: Scenario, *, which: Literal["collected", "used"]) -> pd.DataFrame:
    """The collected traces, or the used ones among them, which make the map, with the errors of their receivers.

    `over_zone` is what `traces_over_zone` gives. Raises SpecError where fewer equipped vehicles passed than are asked for.
    """
    equipped, _ = equipped_vehicles(over_zone, scenario)
    chosen = first_traces(equipped, getattr(scenario.crowd, which), key=f"crowd.{which}")
    return report(over_zone[over_zone["vehicle_id"].isin(chosen)], spec=scenario.gnss, seed=scenario.seed)


def equipped_vehicles(over_zone: pd.DataFrame, scenario: Scenario) -> tuple[list[str], pd.Series]:
    """The equipped vehicles in the order in which their traces are used, and the time [s] at which each vehicle has passed."""
    passed_at_s = over_zone.groupby("vehicle_id")["time_s"].max()
    equipped = choose_equipped(passed_at_s.index, penetration=scenario.crowd.penetration, seed=scenario.seed)
    if scenario.crowd.known == "passed":
        equipped = list(passed_at_s[equipped].sort_values(kind="stable").index)
    return equipped, passed_at_s


def with_traces_at_hand(scenario: Scenario, over_zone: pd.DataFrame) -> tuple[Scenario, list[str]]:
    """(the scenario with as many traces as equipped vehicles passed, where it asks for more; what was changed).

    Where the zone changes nothing is: then all traces count. Raises SpecError where none passed.
    """
    if scenario.live is not None:
        return scenario, []
    equipped, _ = equipped_vehicles(over_zone, scenario)
    if not equipped:
        first_traces(equipped, scenario.crowd.collected, key="crowd.collected")
    n = len(equipped)
    fewer = {key: n for key in ("collected", "used") if getattr(scenario.crowd, key) > n}
    said = [
        f"crowd.{key}={getattr(scenario.crowd, key)}: {n} equipped vehicles passed the zone, whose {n} traces were taken"
        for key in fewer
    ]
    return scenario.model_copy(update={"crowd": scenario.crowd.model_copy(update=fewer)}), said


def sets_out_s(over_zone: pd.DataFrame, scenario: Scenario) -> float:
    """Time [s] at which the ego asks to enter the road: after the warm-up, and when the traces of its map have left the zone.

    All methods of a case set out at this time, in the same traffic. Where the scenario's traces are of the whole run, or fewer
    passed than are used, the ego sets out after the warm-up. Where the zone changes, it sets out when the section [live] says.
    """
    if scenario.live is not None:
        return scenario.live.ego_sets_out_s
    warm_up_s, used = scenario.simulation.demand.warm_up_s, scenario.crowd.used
    equipped, passed_at_s = equipped_vehicles(over_zone, scenario)
    if scenario.crowd.known != "passed" or len(equipped) < used:
        return warm_up_s
    return max(warm_up_s, float(np.ceil(passed_at_s[equipped[:used]].max())))


def collection_figures(over_zone: pd.DataFrame, scenario: Scenario) -> dict[str, Any]:
    """How many equipped vehicles passed, and the minutes from the first vehicle's passing to that of the last one that is used.

    Raises SpecError where fewer passed than are used.
    """
    equipped, passed_at_s = equipped_vehicles(over_zone, scenario)
    first_traces(equipped, scenario.crowd.used, key="crowd.used")
    waited_s = passed_at_s[equipped].sort_values().to_numpy()[scenario.crowd.used - 1] - passed_at_s.min()
    return {"n_equipped": len(equipped), "minutes_to_collect": float(waited_s) / 60}


@contextmanager
def _untold() -> Iterator[Tell]:
    yield lambda _share: None


@dataclass(frozen=True, kw_only=True, eq=False)
class Crowd:
    """The reported traces that make a map, and the mixtures of their points on `road`, fitted when one is first asked for.

    The mixtures are of stations and offsets [m], from the station `mixed_from_m` [m] on. `fitting` surrounds the fit, and gives
    what is told the share that is done.
    """

    traces: pd.DataFrame
    road: Road
    spec: MixtureSpec
    seed: int
    mixed_from_m: float = -np.inf
    fitting: Callable[[], AbstractContextManager[Tell]] = _untold

    @cached_property
    def sweep(self) -> MixtureSweep:
        """One mixture for each number of components 1..k_max."""
        spec = self.spec
        station, _ = self.road.to_sd(self.traces[["x_m", "y_m"]])
        mixed = self.traces[station >= self.mixed_from_m]
        with self.fitting() as tell:
            table = (
                with_copies(mixed, copies=spec.copies, driver_sd_m=spec.driver_sd_m, seed=self.seed) if spec.copies else mixed
            )
            return sweep_mixtures(
                np.column_stack(self.road.to_sd(table[["x_m", "y_m"]])),
                k_max=spec.k_max,
                reg_covar_m2=spec.least_sd_m**2,
                progress=lambda done, total: tell(done / total if total else 1.0),
            )

    @cached_property
    def mixture(self) -> Mixture:
        """The mixture that AIC or BIC chooses."""
        return self.sweep.best("aic" if self.spec.criterion == "aic" else "bic")

    @cached_property
    def samples(self) -> FloatArray:
        """Points x, y (n, 2) [m] drawn from the chosen mixture inside its 95 % region."""
        return self.road.to_xy(*samples_inside(self.mixture, spec=self.spec, seed=self.seed).T)

    @property
    def is_fitted(self) -> bool:
        """Whether a mixture has been asked for."""
        return "sweep" in vars(self)


def witness_reach_m(scenario: Scenario) -> float:
    """How far [m] to either side of a reported centre the vehicle surely drove over the ground; 0 or less: nowhere.

    Half a vehicle's width, plus the scatter of drivers in their lane, less POSITION_ERROR_SDS standard deviations of the
    position as the receivers state them.
    """
    stated_sd_m = float(np.hypot.reduce(scenario.gnss.standard_deviations_m))
    return scenario.vehicle.width_m / 2 + scenario.mixture.driver_sd_m - POSITION_ERROR_SDS * stated_sd_m


def free_witnessed_ground(grid: OccupancyGrid, traces: pd.DataFrame, *, reach_m: float) -> OccupancyGrid:
    """The map with the ground free that MIN_WITNESSES vehicles drove over (see `witnessed_ground`)."""
    return grid.with_p_occupied(np.where(witnessed_ground(grid, traces, reach_m=reach_m), 0.0, grid.p_occupied))


def witnessed_ground(cells: OccupancyGrid, traces: pd.DataFrame, *, reach_m: float) -> BoolArray:
    """Cells (rows, cols) within `reach_m` of the traces of MIN_WITNESSES vehicles or more."""
    count = np.zeros(cells.shape, dtype=np.int16)
    if reach_m > 0:
        for _, trace in traces.groupby("vehicle_id"):
            driven = _without_knots(trace.sort_values("time_s")[["x_m", "y_m"]].to_numpy())
            if len(driven) > 1:
                line = LineString(driven).simplify(MAX_TRACE_ERROR_M)
                count += cells_inside(cells, line.buffer(reach_m, cap_style="flat"))
    return count >= MIN_WITNESSES


def linked_ground(cells: OccupancyGrid, crowd: Crowd, *, half_width_m: float) -> BoolArray:
    """Cells (rows, cols) from the end of each stretch of the mixture to the next one's beginning, where a vehicle drove so.

    Components end where the lane bends, and the next one may begin later. A gap is shorter than both stretches, and a link is
    straight and as wide as a stretch is at least.
    """
    lines, _ = driven_lines(crowd.mixture)
    begins, ends = np.take_along_axis(lines, np.argsort(lines[:, :, :1], axis=1), axis=1).swapaxes(0, 1)
    reach = crowd.spec.driver_sd_m * math.sqrt(-2 * math.log(1 - crowd.spec.mass_share))
    driven = []
    for _, trace in crowd.traces.groupby("vehicle_id"):
        station, offset = crowd.road.to_sd(trace[["x_m", "y_m"]])
        order = np.argsort(station, kind="stable")
        driven.append((station[order], offset[order]))

    def drove(points: FloatArray) -> bool:
        return any(
            (np.abs(np.interp(points[:, 0], *line, left=np.nan, right=np.nan) - points[:, 1]) <= reach).all() for line in driven
        )

    links = []
    for end, of_one in zip(ends, (ends - begins)[:, 0], strict=True):
        later = [n for n in np.flatnonzero(begins[:, 0] > end[0]) if drove(np.stack([end, begins[n]]))]
        following = min(later, key=lambda n: float(begins[n, 0]), default=None)
        if following is None:
            continue
        gap, of_next = begins[following, 0] - end[0], (ends - begins)[following, 0]
        if gap < min(of_one, of_next):
            link = shapely.segmentize(LineString([end, begins[following]]), LINK_STEP_M)
            links += [link] if drove(shapely.get_coordinates(link)) else []
    on_ground = shapely.transform(np.array(links, dtype=object), lambda points: crowd.road.to_xy(*points.T))
    return cells_inside(cells, shapely.union_all(shapely.buffer(on_ground, half_width_m + reach)))


def _without_knots(places: FloatArray) -> FloatArray:
    """Those of the places (n, 2) [m] that are MIN_FIX_SPACING_M from the last one that is kept, and the first."""
    first, *others = places.tolist()
    kept = [first]
    for place in others:
        if dist(place, kept[-1]) >= MIN_FIX_SPACING_M:
            kept.append(place)
    return np.array(kept)
