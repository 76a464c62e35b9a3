"""One case from the zone to its figures: the page that reads like the paper."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from wzsumo.case.crowd import Crowd, reported_traces
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
    """All that a case came to. `write_case` makes files of it."""

    scenario: Scenario
    fleet: FleetMeasures
    collected: pd.DataFrame  # every trace that was reported
    crowd: Crowd  # made of those among them that are used
    lidar: LidarBaseline | None
    methods: dict[str, MethodResult]
    to_open_lane: dict[str, Plan]  # the plans to the goal in the open lane
    seconds: dict[str, float]  # wall-clock time of each step


def run_case(scenario: Scenario, *, methods: Sequence[MapMethod], sumo_folder: Path, watch: Watch) -> CaseResult:
    """What the methods come to in a scenario. SUMO works in `sumo_folder`, which keeps its files."""
    site = prepare_site(scenario)
    zone, fleet = simulate_zone(scenario, site.layout, folder=sumo_folder, watch=watch)
    collected = reported_traces(zone.over_zone, scenario, which="collected")
    sources = Sources(zone=zone, scenario=scenario, site=site, watch=watch)
    crowd = sources.crowd
    load_kernels()  # so that the first plan's time is a plan's
    results: dict[str, MethodResult] = {}
    to_open_lane: dict[str, Plan] = {}
    for method in methods:
        result = evaluate(method, sources, scenario=scenario, site=site, watch=watch)
        other, goals = plan_to_open_lane(method, result, sources, scenario=scenario, site=site)
        results[method.name] = replace(result, figures=result.figures | {"goals": goals})
        if other is not None:
            to_open_lane[method.name] = other
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
    )
