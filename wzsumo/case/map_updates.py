"""Maps that reach the ego while it drives, as the scenario's section `map_updates` says."""

from dataclasses import dataclass, replace
from functools import partial

import pandas as pd

from wzsumo.case.baselines import stale_map
from wzsumo.case.crowd import Crowd, learn_from, reported_traces
from wzsumo.case.map_and_plan import map_of_zone, plan_for
from wzsumo.case.replanning import NewMap
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.plan import Plan
from wzsumo.scenario.scenario import Pose, Scenario
from wzsumo.scenario.site import Site


@dataclass(frozen=True, kw_only=True, eq=False)
class ArrivingCrowd:
    """What more traces gave, and when the map of them reaches the ego."""

    after_s: float
    crowd: Crowd


def arriving_crowds(over_zone: pd.DataFrame, scenario: Scenario, site: Site) -> tuple[ArrivingCrowd, ...]:
    """The crowds of the maps that arrive on the way; `over_zone` is what `traces_over_zone` gives.

    Raises SpecError where fewer equipped vehicles passed than a map asks for.
    """
    if scenario.map_updates is None:
        return ()
    found = []
    for arrival in scenario.map_updates.arrivals:
        more = scenario.model_copy(update={"crowd": scenario.crowd.model_copy(update={"used": arrival.used})})
        traces = reported_traces(over_zone, more, which="used")
        crowd = learn_from(traces, road=site.layout.road, spec=scenario.mixture, seed=scenario.seed)
        found.append(ArrivingCrowd(after_s=arrival.after_s, crowd=crowd))
    return tuple(found)


def plan_to_set_out_with(method: str, grid: OccupancyGrid, *, scenario: Scenario, site: Site, crowd: Crowd | None) -> Plan:
    """The first plan: on `grid`, the method's own map, or where the scenario says so on that of the road without the zone."""
    updates = scenario.map_updates
    if updates is not None and updates.sets_out_with == "map_of_before":
        grid, crowd = stale_map(site), None
    return plan_for(method, grid, scenario=scenario, site=site, crowd=crowd)


def new_maps(crowds: tuple[ArrivingCrowd, ...], method: str, *, scenario: Scenario, site: Site) -> tuple[NewMap, ...]:
    """The maps that a method makes of crowds on the way, each with the way to plan on it."""
    return tuple(
        NewMap(
            after_s=arriving.after_s,
            plan=partial(
                _plan_from,
                method=method,
                grid=map_of_zone(method, arriving.crowd, scenario=scenario, site=site),
                scenario=scenario,
                site=site,
                crowd=arriving.crowd,
            ),
        )
        for arriving in crowds
    )


def _plan_from(start: Pose, *, method: str, grid: OccupancyGrid, scenario: Scenario, site: Site, crowd: Crowd | None) -> Plan:
    return plan_for(method, grid, scenario=scenario, site=replace(site, start=start), crowd=crowd)
