"""SimulatedZone: the traces of the fleet that SUMO drove through the zone, and the files to simulate it again."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from wzsumo.case.crowd import traces_over_zone
from wzsumo.case.watch import Watch
from wzsumo.metrics.fleet import FleetSummary, summarise_fleet
from wzsumo.metrics.network_traffic import (
    NetworkMeasures,
    NetworkSummary,
    compare_edges,
    summarise_network,
    trips_on_road,
)
from wzsumo.metrics.traffic import TrafficMeasures, TrafficSummary, measure_traffic
from wzsumo.scenario.scenario import Scenario
from wzsumo.simulation.edge_records import read_edge_records, road_edge_ids, without_zone
from wzsumo.simulation.files import SumoFiles
from wzsumo.simulation.fleet import record_options, run_to_end, simulate_fleet
from wzsumo.simulation.trips import read_trips, trips_file
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import WorkZoneLayout


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedZone:
    """The traffic of a zone without the ego. The traces are true positions, without GNSS errors."""

    over_zone: pd.DataFrame  # traces over the zone, of the vehicles that passed it (see `traces_over_zone`)
    whole_fleet: Callable[[], pd.DataFrame]  # traces over the whole road, of all vehicles
    sumo_files: Callable[[], AbstractContextManager[SumoFiles]]  # the files of the same simulation, for the ego to drive in
    fleet_before: Callable[[], pd.DataFrame]  # as whole_fleet, as if the zone had not changed (see `Scenario.live`)


@dataclass(frozen=True, kw_only=True, eq=False)
class FleetMeasures:
    """Measures of the fleet's drive through the zone."""

    summary: FleetSummary
    traffic: TrafficMeasures
    network: NetworkMeasures | None = None  # None where the road is all that there is


def simulate_zone(
    scenario: Scenario, layout: WorkZoneLayout, *, folder: Path, watch: Watch
) -> tuple[SimulatedZone, FleetMeasures]:
    """The simulated zone of a scenario, and measures of its fleet. SUMO's files are written to `folder`."""
    facility, warm_up_s = scenario.facility(), scenario.simulation.demand.warm_up_s
    with watch.timing("network"):
        files = scenario.write_sumo_files(folder)
    with watch.timing("fleet"), watch.progress("fleet in SUMO", files.duration) as tell:
        fleet = simulate_fleet(files, on_second=tell)
    with watch.timing("traffic measures"):
        trips = read_trips(trips_file(files))
        over_road = _over_road(trips, fleet, files, layout)
        traffic = measure_traffic(fleet, over_road, layout, dt=files.step_length, warm_up_s=warm_up_s)
    network = _with_and_without(files, trips, watch) if files.surroundings else None
    if network is not None:
        traffic = replace(traffic, summary=_with_emissions(traffic.summary, network.with_zone))
    standing = fleet[fleet["time_s"].between(*facility.standing)]
    zone = SimulatedZone(
        over_zone=traces_over_zone(standing, layout), whole_fleet=lambda: fleet, sumo_files=lambda: nullcontext(files),
        fleet_before=lambda: fleet_before_the_change(scenario, folder),
    )  # fmt: skip
    return zone, FleetMeasures(summary=summarise_fleet(standing, layout), traffic=traffic, network=network)


def fleet_before_the_change(scenario: Scenario, folder: Path) -> pd.DataFrame:
    """Traces over the whole road of all vehicles, as if the zone had not changed. SUMO's files go to a folder in `folder`."""
    of_before = folder / "before"
    of_before.mkdir()
    files = scenario.before_the_change().write_sumo_files(of_before)
    return simulate_fleet(files, on_second=lambda _time: None)


def _over_road(trips: pd.DataFrame, fleet: pd.DataFrame, files: SumoFiles, layout: WorkZoneLayout) -> pd.DataFrame:
    """The trips as far as they lead along the road."""
    if files.surroundings is None:
        return trips
    posted = mps_from_mph(layout.work_zone.posted_speed_mph)
    return trips_on_road(fleet, trips, free_speed=posted, dt=files.step_length)


def _with_and_without(files: SumoFiles, trips: pd.DataFrame, watch: Watch) -> NetworkMeasures:
    """The network with the zone, as it was simulated, and without it, simulated now with the same seed."""
    open_files = without_zone(files)
    with watch.timing("fleet without the zone"), watch.progress("without the zone in SUMO", files.duration) as tell:
        run_to_end(open_files, options=record_options(open_files), on_second=tell)
    edges = [read_edge_records(of) for of in (files, open_files)]
    both = [
        summarise_network(table, records, road=road_edge_ids(files))
        for table, records in zip((trips, read_trips(trips_file(open_files))), edges, strict=True)
    ]
    shapes = files.surroundings.shapes if files.surroundings else {}
    return NetworkMeasures(with_zone=both[0], without_zone=both[1], edges=compare_edges(*edges, shapes=shapes))


def _with_emissions(summary: TrafficSummary, network: NetworkSummary) -> TrafficSummary:
    """The summary with the emissions by vehicle kilometre on the road, which SUMO records by edge."""
    kilometres = network.corridor_vkm or float("nan")
    return replace(
        summary,
        co2_g_per_vkm=1000 * network.corridor_co2_kg / kilometres,
        nox_g_per_vkm=1000 * network.corridor_nox_kg / kilometres,
        fuel_g_per_vkm=1000 * network.corridor_fuel_kg / kilometres,
    )
