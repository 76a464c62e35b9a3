from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces
from case.finished_plans import SAFE_Y, coarse_paper, coarse_site, plan_of, straight_path

from wzsumo.case import case as case_module
from wzsumo.case import evaluation, sources, zone
from wzsumo.case.case import CaseResult, run_case
from wzsumo.case.map_method import LidarMethod, MapMethod
from wzsumo.case.methods import METHODS
from wzsumo.case.watch import Tell, Watch
from wzsumo.grid import OccupancyGrid
from wzsumo.metrics.traffic import TrafficMeasures, measure_traffic
from wzsumo.planning.plan import Plan
from wzsumo.scenario import facility
from wzsumo.scenario.scenario import Scenario
from wzsumo.simulation.trips import TRIP_COLUMNS

LENGTH_M = 1500.0
FLEET = straight_traces(np.linspace(1.5, 5.5, 8), length_m=LENGTH_M, step_m=5.0).assign(length_m=4.8, width_m=1.85)
SCANNED = LidarMethod(name="scanned", title="", form=lambda maps: maps.birds_eye)


def scenario(*, open_goal_lane: int | None = None) -> Scenario:
    paper = coarse_paper()
    return paper.model_copy(update={
        "seed": 5,
        "crowd": paper.crowd.model_copy(update={"penetration": 1.0, "collected": 6, "used": 2}),
        "mixture": paper.mixture.model_copy(update={"k_max": 1}),
        "route": paper.route.model_copy(update={"open_goal_lane": open_goal_lane}),
    })  # fmt: skip


@pytest.fixture
def events(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The calls of SUMO, planner and LiDAR, which all give what they are known to give, in their order."""
    found: list[Any] = []
    files = SimpleNamespace(duration=300.0, step_length=0.25, folder=None, surroundings=None)

    def write_sumo_files(_layout: object, folder: Path, **given: Any) -> SimpleNamespace:
        found.append(("files", folder, given))
        return files

    def simulate_fleet(_files: object, *, on_second: Tell) -> pd.DataFrame:
        found.append("fleet")
        on_second(150.0)
        return FLEET

    def read_trips(_path: object) -> pd.DataFrame:
        rows = [(name, 0.0, True, True, 75.0, 3.0, 3.0, LENGTH_M, 300.0, 0.2, 90.0) for name in FLEET["vehicle_id"].unique()]
        return pd.DataFrame(rows, columns=list(TRIP_COLUMNS))

    def plan_for(method: MapMethod, _grid: OccupancyGrid, **_given: Any) -> Plan:
        found.append(f"plan {method.name}")
        return plan_of(None)

    def map_by_lidar(fleet: pd.DataFrame, *_: object, on_share: Tell, **__: Any) -> SimpleNamespace:
        found.append("lidar")
        assert fleet is FLEET
        on_share(0.5)
        return SimpleNamespace(maps=SimpleNamespace(birds_eye=coarse_site().cells))

    monkeypatch.setattr(facility, "write_sumo_files", write_sumo_files)
    monkeypatch.setattr(zone, "simulate_fleet", simulate_fleet)
    monkeypatch.setattr(zone, "read_trips", read_trips)
    monkeypatch.setattr(zone, "trips_file", lambda files: files)
    monkeypatch.setattr(evaluation, "plan_for", plan_for)
    monkeypatch.setattr(sources, "map_by_lidar", map_by_lidar)
    monkeypatch.setattr(case_module, "load_kernels", lambda: found.append("kernels"))
    return found


def run(*methods: MapMethod, spec: Scenario | None = None, watch: Watch | None = None) -> CaseResult:
    return run_case(spec or scenario(), methods=methods, sumo_folder=Path("sumo"), watch=watch or Watch())


def test_steps_of_a_case_come_in_the_order_of_the_paper(events: list[Any]) -> None:
    result = run(METHODS["hd_map"], METHODS["hd_map_devices"])
    (_, folder, given), *later = events
    assert folder == Path("sumo")
    assert given["seed"] == 5
    assert later == ["fleet", "kernels", "plan hd_map", "plan hd_map_devices"]
    assert list(result.seconds) == [
        "network", "fleet", "traffic measures", "map hd_map", "drive hd_map", "map hd_map_devices",
        "drive hd_map_devices",
    ]  # fmt: skip


def test_case_holds_the_collected_traces_and_a_crowd_of_the_used_ones(events: list[Any]) -> None:
    result = run(METHODS["hd_map"])
    assert events
    ids = set(result.collected["vehicle_id"])
    assert result.crowd is not None
    used = set(result.crowd.traces["vehicle_id"])
    assert (len(ids), len(used)) == (6, 2)
    assert used < ids
    assert result.fleet.summary.n_passed == 8
    assert result.fleet.traffic.summary.n_arrived == 8


@pytest.mark.parametrize("open_goal_lane", [None, 0])
def test_goal_in_the_open_lane_is_planned_to_where_the_scenario_has_one(events: list[Any], open_goal_lane: int | None) -> None:
    result = run(METHODS["hd_map"], spec=scenario(open_goal_lane=open_goal_lane))
    goals = result.methods["hd_map"].figures["goals"]
    assert goals["own_lane"]["lane"] == 2 - 1  # the paper's goal lies in the middle lane of three
    assert events.count("plan hd_map") == (1 if open_goal_lane is None else 2)
    assert list(result.to_open_lane) == ([] if open_goal_lane is None else ["hd_map"])
    assert goals.get("open_lane", {}).get("lane") == open_goal_lane


def test_mapping_drive_is_made_for_a_method_that_needs_it_and_for_no_other(events: list[Any]) -> None:
    assert run(METHODS["hd_map"]).lidar is None
    assert "lidar" not in events
    assert run(METHODS["hd_map"], SCANNED).lidar is not None
    assert events.count("lidar") == 1


def test_progress_of_the_fleet_is_told_in_seconds_of_its_simulation(events: list[Any]) -> None:
    told: list[tuple[str, float, float]] = []

    @contextmanager
    def progress(name: str, total: float) -> Iterator[Tell]:
        yield lambda done: told.append((name, total, done))

    run(SCANNED, watch=Watch(progress=progress))
    assert events
    assert told[0] == ("fleet in SUMO", 300.0, 150.0)
    assert ("LiDAR mapping drive", 1.0, 0.5) in told


def test_drive_of_a_case_is_told_in_metres_of_its_path(events: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[tuple[str, float]] = []

    @contextmanager
    def progress(name: str, total: float) -> Iterator[Tell]:
        opened.append((name, total))
        yield lambda _done: None

    def stop(*_: object, **__: object) -> None:
        return None

    monkeypatch.setattr(evaluation, "plan_for", lambda *_, **__: plan_of(straight_path(SAFE_Y)))
    monkeypatch.setattr(evaluation, "drive_path", stop)
    run(METHODS["hd_map"], watch=Watch(progress=progress))
    assert events
    assert dict(opened)["drive on hd_map"] == pytest.approx(100.0)


def test_traces_of_a_fleet_count_after_the_warm_up_at_its_own_step(events: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}

    def measure(*tables: Any, **given: Any) -> TrafficMeasures:
        asked.update(given)
        return measure_traffic(*tables, **given)

    monkeypatch.setattr(zone, "measure_traffic", measure)
    run(METHODS["hd_map"])
    assert events
    assert asked == {"dt": 0.25, "warm_up_s": scenario().simulation.demand.warm_up_s}


def test_doubts_of_a_map_are_warnings_of_the_case(events: list[Any]) -> None:
    """Two vehicles used, of a road of three lanes: at least one lane that nobody drove."""
    result = run(METHODS["lanes"], METHODS["hd_map"])
    doubts = result.methods["lanes"].made.figures["warnings"]
    assert doubts
    assert [word for word in result.warnings if word.startswith("lanes: ")] == [f"lanes: {word}" for word in doubts]
    assert not [word for word in result.warnings if word.startswith("hd_map")]
