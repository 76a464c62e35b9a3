"""What decides a scenario's result, said before it runs: the values that it leaves to defaults, and what it cannot have."""

import numpy as np

from wzsumo.scenario.scenario import Scenario
from wzsumo.simulation.demand import DemandSpec
from wzsumo.units import mph_from_mps, mps_from_mph

MAP_OF_BEFORE = "the road without the zone, which maps join outside the announced zone"


def deciding_values(scenario: Scenario) -> list[str]:
    """A line for the ego's speed, the road type, drivers, traces and the map of before; "default" where the file is silent."""
    zone, crowd, demand, speed = (
        scenario.work_zone,
        scenario.crowd,
        scenario.simulation.demand,
        scenario.control.target_speed_mps,
    )
    posted = np.isclose(speed, mps_from_mph(zone.posted_speed_mph))
    receivers = f"{scenario.gnss.error_m:g} m error" if scenario.gnss.error_m is not None else "errors by parts"
    lines = {
        "ego": f"drives {mph_from_mps(speed):.0f} mph ({speed:.1f} m/s){', the posted speed' if posted else ''}",
        "road type": f"{zone.road_type}{_default(zone.model_fields_set, 'road_type')}",
        "traces": f"{crowd.used} used of {crowd.collected} collected, {100 * crowd.penetration:g} % of the vehicles equipped"
        f"{_default(crowd.model_fields_set, 'penetration', 'collected', 'used')}; receivers with {receivers}"
        f"{_default(scenario.model_fields_set, 'gnss')}",
        "map of before": MAP_OF_BEFORE,
    }
    if scenario.road is not None:
        lines["drivers"] = f"{demand.drivers.name}{_default(demand.model_fields_set, 'drivers')}"
    return [f"{name}: {said}" for name, said in lines.items()]


def foreseen_lacks(scenario: Scenario) -> list[str]:
    """What the scenario asks for and probably cannot have. The vehicles of a network's own routes are not foreseen."""
    crowd = scenario.crowd
    expected = crowd.penetration * vehicles_expected_to_pass(scenario)
    asked = {key: getattr(crowd, key) for key in ("collected", "used")}
    return [
        f"crowd.{key}={count}: some {expected:.3g} equipped vehicles can be expected to pass; the run takes what there is "
        "(raise crowd.penetration or simulation.demand.duration_s for more)"
        for key, count in asked.items()
        if count > expected
    ]


def vehicles_expected_to_pass(scenario: Scenario) -> float:
    """Vehicles that enter early enough to pass the zone at the posted speed before the simulation ends; inf in a network."""
    if scenario.road is None:
        return float("inf")
    demand, layout = scenario.simulation.demand, scenario.layout()
    last = demand.duration_s - layout.end / mps_from_mph(scenario.work_zone.posted_speed_mph)
    return sum(flow * max(min(until, last) - since, 0.0) for since, until, flow in _flows(demand)) / 3600


def _flows(demand: DemandSpec) -> list[tuple[float, float, float]]:
    """(from [s], to [s], veh/h) of the demand."""
    profile = demand.flow_profile or ((0.0, demand.flow_vph),)
    ends = [since for since, _ in profile[1:]] + [demand.duration_s]
    return [(since, until, flow) for (since, flow), until in zip(profile, ends, strict=True)]


def _default(given: set[str], *keys: str) -> str:
    return "" if set(keys) & given else " (default)"
