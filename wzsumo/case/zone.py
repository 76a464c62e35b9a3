"""SimulatedZone: the traces of the fleet that SUMO drove through the zone, and the files to simulate it again."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from wzsumo.case.crowd import traces_over_zone
from wzsumo.case.watch import Watch
from wzsumo.metrics.fleet import FleetSummary, summarise_fleet
from wzsumo.metrics.traffic import TrafficMeasures, measure_traffic
from wzsumo.scenario.scenario import Scenario
from wzsumo.simulation.files import SumoFiles, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.trips import read_trips, trips_file
from wzsumo.work_zone import WorkZoneLayout


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedZone:
    """The traffic of a zone without the ego. The traces are true positions, without GNSS errors."""

    over_zone: pd.DataFrame  # traces over the zone, of the vehicles that passed it (see `traces_over_zone`)
    whole_fleet: Callable[[], pd.DataFrame]  # traces over the whole road, of all vehicles
    sumo_files: Callable[[], AbstractContextManager[SumoFiles]]  # the files of the same simulation, for the ego to drive in


@dataclass(frozen=True, kw_only=True, eq=False)
class FleetMeasures:
    """Measures of the fleet's drive through the zone."""

    summary: FleetSummary
    traffic: TrafficMeasures


def simulate_zone(
    scenario: Scenario, layout: WorkZoneLayout, *, folder: Path, watch: Watch
) -> tuple[SimulatedZone, FleetMeasures]:
    """The simulated zone of a scenario, and measures of its fleet. SUMO's files are written to `folder`."""
    simulation = scenario.zone_simulation()
    with watch.timing("network"):
        files = write_sumo_files(layout, folder, spec=simulation, seed=scenario.seed)
    with watch.timing("fleet"), watch.progress("fleet in SUMO", files.duration) as tell:
        fleet = simulate_fleet(files, on_second=tell)
    with watch.timing("traffic measures"):
        trips = read_trips(trips_file(files))
        traffic = measure_traffic(fleet, trips, layout, dt=files.step_length, warm_up_s=simulation.demand.warm_up_s)
    zone = SimulatedZone(
        over_zone=traces_over_zone(fleet, layout), whole_fleet=lambda: fleet, sumo_files=lambda: nullcontext(files)
    )
    return zone, FleetMeasures(summary=summarise_fleet(fleet, layout), traffic=traffic)
