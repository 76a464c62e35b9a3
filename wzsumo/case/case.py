"""One case, from the zone to the figures of every map method: the steps of the paper in their order."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from wzsumo.case.crowd import Crowd, with_traces_at_hand
from wzsumo.case.evaluation import MethodResult, evaluate, plan_to_open_lane
from wzsumo.case.lidar_baseline import LidarBaseline
from wzsumo.case.map_method import MapMethod, Source
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Watch
from wzsumo.case.zone import FleetMeasures, simulate_zone
from wzsumo.planning.plan import Plan, load_kernels
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import prepare_site


@dataclass(frozen=True, kw_only=True, eq=False)
class CaseResult:
    """Everything that a case gives; `write_case` writes it to files."""

    scenario: Scenario  # as it was run
    fleet: FleetMeasures
    collected: pd.DataFrame  # the reported traces
    crowd: Crowd | None  # made of the used ones among them; None where the zone changes
    lidar: LidarBaseline | None
    methods: dict[str, MethodResult]
    to_open_lane: dict[str, Plan]  # the plans to the goal in the open lane
    seconds: dict[str, float]  # wall-clock time of each step
    warnings: list[str]  # what the case could not have, and took instead; what a map is in doubt of, with its method


def run_case(scenario: Scenario, *, methods: Sequence[MapMethod], sumo_folder: Path, watch: Watch) -> CaseResult:
    """The results of the methods in a scenario. SUMO's files are written to `sumo_folder` and stay there."""
    site = prepare_site(scenario)
    zone, fleet = simulate_zone(scenario, site.layout, folder=sumo_folder, watch=watch)
    scenario, warnings = with_traces_at_hand(scenario, zone.over_zone)
    sources = Sources(zone=zone, scenario=scenario, site=site, watch=watch)
    collected, crowd = sources.collected, sources.crowd if scenario.live is None else None
    load_kernels()  # before the first plan, whose time would include it
    results: dict[str, MethodResult] = {}
    to_open_lane: dict[str, Plan] = {}
    for method in methods:
        result = evaluate(method, sources, scenario=scenario, site=site, watch=watch)
        open_plan, goals = plan_to_open_lane(method, result, scenario=scenario, site=site)
        results[method.name] = replace(result, figures=result.figures | {"goals": goals})
        warnings = [*warnings, *(f"{method.name}: {word}" for word in result.made.figures.get("warnings", ()))]
        if open_plan is not None:
            to_open_lane[method.name] = open_plan
    scanned = any(method.source is Source.LIDAR for method in methods)
    return CaseResult(
        scenario=scenario,
        fleet=fleet,
        collected=collected,
        crowd=crowd,
        lidar=sources.lidar if scanned else None,
        methods=results,
        to_open_lane=to_open_lane,
        seconds=watch.seconds,
        warnings=warnings,
    )
