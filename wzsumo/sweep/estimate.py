"""Estimate: how many cases and simulations a study still needs, and about how long they take."""

from collections.abc import Container, Iterable
from dataclasses import dataclass

from wzsumo.case.map_method import Source
from wzsumo.scenario.outlook import vehicles_expected_to_pass
from wzsumo.scenario.scenario import Scenario
from wzsumo.sweep.study_file import Study
from wzsumo.units import mps_from_mph

# Processor seconds on one core of 2020, as analysis/benchmarks/sweep.py measures them. They depend on the machine, so the
# command line prints a study's time as "about".
CPU_S_PER_VEHICLE_STEP = 28e-6  # SUMO's sublane model, with the log of the fleet
CPU_S_PER_DRIVE = 8.0
VEHICLES_IN_NETWORK = 300  # taken to be under way in a network: some 10 km of a busy freeway; chosen by us
CPU_S_PER_LIDAR_DRIVE = 60.0  # a mapping drive of 500 scans
PROCESS_START_S = 4.0
# The sections of a scenario that decide how many vehicles are under way, and for how long.
ZONE_AND_DEMAND = {"road", "network", "work_zone", "live", "simulation"}


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Numbers of cases and simulations, and about how much processor time the missing cases take."""

    n_cases: int
    n_missing: int
    n_simulations: int  # of the missing cases
    processor_s: float

    def wall_clock_s(self, workers: int) -> float:
        """About how long [s] the missing cases take on `workers` free cores."""
        return self.processor_s / workers + PROCESS_START_S


def estimate(study: Study, *, finished: Container[str]) -> Estimate:
    """The work that a study still needs where the cases named in `finished` are finished."""
    missing = [case for case in study.cases if case.id not in finished]
    simulated = {case.simulation: case.scenario for case in missing}
    seconds = sum(len(alike) * _simulation_s(alike[0]) for alike in _alike_in_traffic(simulated.values()))
    evaluated = {case.evaluation: case for case in missing}.values()
    seconds += CPU_S_PER_LIDAR_DRIVE * len({case.source for case in missing if case.map_method.source is Source.LIDAR})
    seconds += sum(case.map_method.cpu_s + CPU_S_PER_DRIVE * case.drive for case in evaluated)
    return Estimate(
        n_cases=len(study.cases), n_missing=len(missing), n_simulations=len(simulated), processor_s=round(seconds, 1)
    )


def n_cases_lacking_traces(study: Study) -> int:
    """How many cases ask for more traces (`crowd.used`) than equipped vehicles can be expected to pass."""
    n_lacking = 0
    for alike in _alike_in_traffic(case.scenario for case in study.cases):
        passing = vehicles_expected_to_pass(alike[0])
        n_lacking += sum(scenario.crowd.used > scenario.crowd.penetration * passing for scenario in alike)
    return n_lacking


def _alike_in_traffic(scenarios: Iterable[Scenario]) -> list[list[Scenario]]:
    """The scenarios in groups of the same zone and demand: to lay out a zone takes milliseconds, and a study has many cases."""
    groups: dict[str, list[Scenario]] = {}
    for scenario in scenarios:
        groups.setdefault(scenario.model_dump_json(include=ZONE_AND_DEMAND), []).append(scenario)
    return list(groups.values())


def _simulation_s(scenario: Scenario) -> float:
    demand, road = scenario.simulation.demand, scenario.layout().road
    if scenario.network is not None:  # simulated with and without the zone
        steps = 2 * demand.duration_s / scenario.simulation.step_length_s
        return CPU_S_PER_VEHICLE_STEP * VEHICLES_IN_NETWORK * steps
    vehicles = demand.flow_vph * demand.duration_s / 3600
    crossing_s = road.length / mps_from_mph(scenario.work_zone.posted_speed_mph)
    return CPU_S_PER_VEHICLE_STEP * vehicles * crossing_s / scenario.simulation.step_length_s
