"""How much work a study is, before anything of it is done."""

from collections.abc import Container
from dataclasses import dataclass

from wzsumo.case.map_method import Source
from wzsumo.scenario.scenario import Scenario
from wzsumo.sweep.study_file import Study
from wzsumo.units import mps_from_mph

# Processor seconds on one core of 2020 (analysis/benchmarks/sweep.py measures them again). They depend on the machine: a
# study's time is told as "about".
SIMULATION_S_PER_VEHICLE_STEP = 28e-6  # sublane model, log of the fleet included
DRIVE_S = 8.0
LIDAR_S = 60.0  # a mapping drive of 500 scans
START_S = 4.0  # of a worker process


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Cases, simulations, and about how long what is missing takes."""

    n_cases: int
    n_missing: int
    n_simulations: int  # that the missing cases need
    processor_s: float

    def wall_clock_s(self, workers: int) -> float:
        """About how long [s] it takes on so many free cores."""
        return self.processor_s / workers + START_S


def estimate(study: Study, *, finished: Container[str]) -> Estimate:
    """The work that is left of a study once the cases named in `finished` are done."""
    missing = [case for case in study.cases if case.id not in finished]
    simulated = {case.simulation: case.scenario for case in missing}
    seconds = sum(_simulation_s(scenario) for scenario in simulated.values())
    evaluated = {case.evaluation: case for case in missing}.values()
    seconds += LIDAR_S * len({case.source for case in missing if case.map_method.source is Source.LIDAR})
    seconds += sum(case.map_method.cpu_s + DRIVE_S * case.drive for case in evaluated)
    return Estimate(
        n_cases=len(study.cases), n_missing=len(missing), n_simulations=len(simulated), processor_s=round(seconds, 1)
    )


def _simulation_s(scenario: Scenario) -> float:
    demand, road = scenario.simulation.demand, scenario.layout().road
    vehicles = demand.flow_vph * demand.duration_s / 3600
    crossing_s = road.length / mps_from_mph(scenario.work_zone.posted_speed_mph)
    return SIMULATION_S_PER_VEHICLE_STEP * vehicles * crossing_s / scenario.simulation.step_length_s
