"""Zones whose SUMO fleets the crowd map is measured on: one simulation a zone and seed, kept in a folder."""

from collections.abc import Mapping
from hashlib import blake2b
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from wzsumo.case.crowd import traces_over_zone
from wzsumo.road import Bend, RoadSpec
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.sections import RouteSpec
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.files import SimulationSpec, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.work_zone import WorkZone

DURATION_S = 600.0  # of 1,000 veh/h and more: over 100 vehicles pass the zone from end to end
PAPER = Path(__file__).parents[2] / "scenarios" / "paper.toml"


def _road(lanes: int, *, radius_ft: float | None = None, left_ft: float = 10.0, right_ft: float = 12.0) -> RoadSpec:
    """A road that is straight, or that bends all through the zone with a radius [ft] (positive: to the left)."""
    shape: Mapping[str, Any] = {"length_ft": 7000}
    if radius_ft is not None:
        transition = Bend(length_ft=600, end_radius_ft=radius_ft)
        shape = {"alignment": (Bend(length_ft=1000), transition, Bend(length_ft=5400, radius_ft=radius_ft))}
    return RoadSpec(lane_count=lanes, left_shoulder_ft=left_ft, right_shoulder_ft=right_ft, **shape)


def _zone(name: str, road: RoadSpec, *, flow_vph: float, start_lane: int, goal_lane: int, **work_zone: Any) -> Scenario:
    """A scenario at 60 mph with 650 ft of work, unless `work_zone` says otherwise."""
    zone = WorkZone(**{"posted_speed_mph": 60, "start_ft": 1500, "work_length_ft": 650} | work_zone)
    demand = DemandSpec(flow_vph=flow_vph, duration_s=DURATION_S)
    route = RouteSpec(start_lane=start_lane, goal_lane=goal_lane)
    return Scenario(
        name=name, seed=1, road=road, work_zone=zone, simulation=SimulationSpec(demand=demand), route=route
    )  # fmt: skip


def _paper() -> Scenario:
    paper = load_scenario(PAPER)
    demand = paper.simulation.demand.model_copy(update={"duration_s": DURATION_S})
    return paper.model_copy(update={"simulation": paper.simulation.model_copy(update={"demand": demand})})


# Seeds 1-6 of the first four zones are development seeds of the lanes map; the last two zones were never looked at.
ZONES = {
    "straight": _paper(),
    "bend": _zone(
        "bend", _road(3, radius_ft=-3000), posted_speed_mph=55, closed_lanes=(2,), closed_shoulder="left", shift_ft=8,
        flow_vph=1500, start_lane=1, goal_lane=1,
    ),
    "one_lane": _zone(
        "one_lane", _road(2), closed_lanes=(1,), closed_shoulder="left", shift_ft=10, flow_vph=1000, start_lane=0, goal_lane=0
    ),
    "right_closed": _zone(
        "right_closed", _road(3), posted_speed_mph=55, closed_lanes=(0,), closed_shoulder="right", flow_vph=1500, start_lane=1,
        goal_lane=1,
    ),
    "two_closed_bend": _zone(
        "two_closed_bend", _road(3, radius_ft=4000), posted_speed_mph=50, closed_lanes=(1, 2), closed_shoulder="left",
        flow_vph=1000, start_lane=0, goal_lane=0,
    ),
    "right_shift_bend": _zone(
        "right_shift_bend", _road(2, radius_ft=3000, left_ft=12, right_ft=8), posted_speed_mph=65, closed_lanes=(0,),
        closed_shoulder="right", shift_ft=10, work_length_ft=1000, flow_vph=1000, start_lane=1, goal_lane=1,
    ),
}  # fmt: skip


def _fingerprint(scenario: Scenario) -> str:
    """A short hash of all that the traffic depends on but the seed: another road or another demand is another fleet."""
    layout = scenario.layout()
    lines = [layout.road.reference_line, *(p.offsets for lane in layout.lanes for p in (lane.right, lane.left))]
    digest = blake2b(scenario.simulation.model_dump_json().encode(), digest_size=4)
    for line in lines:
        digest.update(line.round(6).tobytes())
    return digest.hexdigest()


def true_traces(name: str, seed: int, *, cache: Path) -> pd.DataFrame:
    """True 10 Hz traces over the zone of all vehicles that passed it, simulated once and kept in `cache`."""
    path = cache / f"{name}_{seed}_{_fingerprint(ZONES[name])}.parquet"
    if not path.exists():
        scenario = ZONES[name]
        with TemporaryDirectory() as folder:
            files = write_sumo_files(scenario.layout(), Path(folder), spec=scenario.zone_simulation(), seed=seed)
            fleet = simulate_fleet(files, on_second=lambda _time: None)
        traces = traces_over_zone(fleet, scenario.layout())
        cache.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(".unfinished")
        traces.to_parquet(unfinished, index=False)
        unfinished.replace(path)
    return pd.read_parquet(path)
