from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from builders import paper_work_zone

from wzsumo.mutcd.layout import lay_out
from wzsumo.road import RoadSpec
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.connection import connected_library
from wzsumo.simulation.demand import CAR, DemandSpec
from wzsumo.simulation.drivers import DRIVER_PRESETS
from wzsumo.simulation.files import SimulationSpec, SumoFiles, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.gridlock import CHECK_S, Gridlock

SCENARIOS = Path(__file__).parents[2] / "scenarios"
OWN_GAP_M = 2.5


class Sumo:
    """What `Gridlock` asks of SUMO, for a vehicle "over" in the left of two lanes, which ends; `told` lists its commands."""

    def __init__(self, *, waited_s: float = 60.0, lane: str = "taper_1") -> None:
        self.waited_s, self.on_road = waited_s, ["over", "waits"]
        self.behind = {"waits": 2.0}  # m, gaps to those behind in the lane that leads on
        self.ahead: dict[str, float] = {}  # m, gaps to those ahead in it
        self.speeds = {"over": 0.0, "waits": 0.0}
        self.min_gaps = {"over": OWN_GAP_M, "waits": OWN_GAP_M}
        self.told: list[tuple[str, object]] = []
        self.edge = SimpleNamespace(
            getIDList=lambda: ["taper", "elsewhere"],
            getLastStepHaltingNumber=lambda id_: int(id_ == "taper"),
            getLastStepVehicleIDs=lambda _id: self.on_road,
        )
        self.vehicle = SimpleNamespace(
            getIDList=lambda: self.on_road,
            getWaitingTime=lambda name: self.waited_s if name == "over" else 0.0,
            getSpeed=self.speeds.__getitem__,
            getMinGap=self.min_gaps.__getitem__,
            getLaneID=lambda _name: lane,
            getBestLanes=lambda _name: [("taper_0", 500.0, 0.0, 0, True, ()), ("taper_1", 20.0, 0.0, -1, False, ())],
            getRightFollowers=lambda _name: [(name, gap - self.min_gaps[name]) for name, gap in self.behind.items()],
            getRightLeaders=lambda _name: [(name, gap - OWN_GAP_M) for name, gap in self.ahead.items()],
            setMinGap=self._set_min_gap,
        )

    def _set_min_gap(self, name: str, gap: float) -> None:
        self.min_gaps[name] = gap
        self.told.append((name, pytest.approx(gap)))


MAKES_WAY = [("waits", 1.95)]  # 5 cm less than the 2 m that it has


def told(sumo: Sumo, gridlock: Gridlock | None = None) -> list[tuple[str, object]]:
    """Which vehicles are told which minimum gap now."""
    (gridlock or Gridlock(sumo)).resolve()
    commands, sumo.told = sumo.told, []
    return commands


def test_follower_makes_way_after_ten_seconds_and_keeps_its_own_gap_again_once_it_drives() -> None:
    sumo = Sumo(waited_s=9.9)
    gridlock = Gridlock(sumo)
    assert told(sumo, gridlock) == []
    sumo.waited_s = 10.1
    assert told(sumo, gridlock) == MAKES_WAY
    sumo.speeds["waits"], sumo.waited_s = 0.9, 0.0
    assert told(sumo, gridlock) == []
    sumo.speeds["waits"] = 1.1
    assert told(sumo, gridlock) == [("waits", OWN_GAP_M)]
    assert told(sumo, gridlock) == []


def test_follower_that_makes_way_twice_keeps_its_own_gap_again() -> None:
    sumo = Sumo()
    gridlock = Gridlock(sumo)
    assert told(sumo, gridlock) == MAKES_WAY
    sumo.behind["waits"] = 1.9
    assert told(sumo, gridlock) == [("waits", 1.85)]
    sumo.speeds["waits"] = 1.1
    assert told(sumo, gridlock) == [("waits", OWN_GAP_M)]


def test_none_makes_way_for_a_vehicle_in_the_lane_that_leads_on() -> None:
    assert told(Sumo(lane="taper_0")) == []


def test_only_edges_that_are_looked_at_count() -> None:
    sumo = Sumo()
    assert told(sumo, Gridlock(sumo, ["elsewhere"])) == []
    assert told(sumo, Gridlock(sumo, ["taper", "not in this network"])) == MAKES_WAY


@pytest.mark.parametrize(
    ("gap_m", "makes_way"), [(0.9, False), (1.1, True), (2.4, True), (2.6, False)], ids=["beside", "near", "in time", "far"]
)
def test_follower_makes_way_that_stands_closer_than_its_minimum_gap(gap_m: float, makes_way: bool) -> None:
    sumo = Sumo()
    sumo.behind["waits"] = gap_m
    assert told(sumo) == ([("waits", gap_m - 0.05)] if makes_way else [])


@pytest.mark.parametrize(("gap_m", "makes_way"), [(0.9, False), (1.1, True)])
def test_none_makes_way_for_a_vehicle_with_another_beside_its_front(gap_m: float, makes_way: bool) -> None:
    sumo = Sumo()
    sumo.ahead["beside"] = gap_m
    assert told(sumo) == (MAKES_WAY if makes_way else [])


@pytest.mark.parametrize(("speed", "waits"), [(0.09, True), (0.11, False)])
def test_vehicle_that_drives_faster_than_0_1_mps_does_not_wait(speed: float, waits: bool) -> None:
    sumo = Sumo()
    sumo.speeds["waits"] = speed
    assert told(sumo) == (MAKES_WAY if waits else [])


def test_vehicle_that_has_left_the_road_is_forgotten() -> None:
    sumo = Sumo()
    gridlock = Gridlock(sumo)
    assert told(sumo, gridlock) == MAKES_WAY
    sumo.on_road = ["over"]
    assert told(sumo, gridlock) == []
    sumo.on_road, sumo.waited_s, sumo.speeds["waits"] = ["over", "waits"], 0.0, 2.0
    assert told(sumo, gridlock) == []


@pytest.fixture(scope="module", params=["left", "right"])
def closing(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[SumoFiles, int]:
    """A road of three lanes of which that on one side closes, and the side to which its vehicles must change (1: left)."""
    lane = 2 if request.param == "left" else 0
    zone = paper_work_zone(closed_lanes=(lane,), closed_shoulder=request.param, shift_ft=0, shifted_lane_width_ft=None)
    layout = lay_out(zone, RoadSpec(lane_count=3, left_shoulder_ft=12, right_shoulder_ft=12, length_ft=6000).build())
    spec = SimulationSpec(
        demand=DemandSpec(drivers=DRIVER_PRESETS["hcm_3_to_2_urban"], flow_vph=0.01, duration_s=60.0, warm_up_s=0)
    )
    files = write_sumo_files(layout, tmp_path_factory.mktemp("closing"), spec=spec, seed=1)
    return files, -1 if request.param == "left" else 1


@pytest.mark.parametrize(("over_m", "gap_m", "aside_m"), [(0.9, 1.2, 0.9), (0.9, 2.0, 0.5), (0.9, 3.5, 0.5), (0.9, 3.5, 0.9)])
def test_vehicle_at_the_end_of_its_lane_drives_on_wherever_the_one_that_waits_for_it_stands(
    closing: tuple[SumoFiles, int], over_m: float, gap_m: float, aside_m: float
) -> None:
    """Without a rule all eight pairs stand for good; with an order to the first to change lanes, others disregarded, too."""
    files, side = closing
    number = next(n for n, edge in enumerate(files.edges) if len(edge.through_lanes) < len(edge.lanes)) - 1
    edge = files.edges[number]
    ends = len(edge.lanes) - 1 if side < 0 else 0
    astride_m = side * ((edge.lanes[ends].width - CAR["width_m"]) / 2 + over_m)
    end = edge.end - edge.start - 0.01
    behind = end - CAR["length_m"] - gap_m
    places = {"over": (ends, end, astride_m), "waits": (ends + side, behind, -side * aside_m)}
    places |= {f"queue_{n}": (ends + side, behind - 8.5 * n, 0.0) for n in range(1, 5)}
    routes = files.config.with_name("zone.rou.xml")
    root = ET.parse(routes).getroot()
    at = {"type": "car_00", "route": "through", "depart": "0", "departEdge": str(number), "departSpeed": "0"}
    for name, (lane, position, aside) in places.items():
        where = {"departLane": str(lane), "departPos": f"{position:.2f}", "departPosLat": f"{aside:.2f}"}
        ET.SubElement(root, "vehicle", at | where, id=name, insertionChecks="none")
    given = routes.with_name("given.rou.xml")
    ET.ElementTree(root).write(given)
    with connected_library(["--configuration-file", str(files.config), "--route-files", str(given), "--no-warnings"]) as api:
        gridlock = Gridlock(api)
        for time in np.arange(CHECK_S, 60.0, CHECK_S):
            api.simulationStep(time)
            gridlock.resolve()
        on_road = set(places) & set(api.vehicle.getIDList())
        assert {name for name in on_road if api.vehicle.getWaitingTime(name) > 10} == set()


def test_vehicles_at_the_end_of_a_lane_do_not_wait_for_each_other_for_good(tmp_path: Path) -> None:
    # Without the rule two vehicles stand from 118 s on: one astride the line where its lane ends, one 2 m behind it.
    street = load_scenario(SCENARIOS / "street_interior_lane.toml", seed=161)
    own = street.zone_simulation()
    demand = own.demand.model_copy(update={"flow_vph": 2100.0})
    files = write_sumo_files(street.layout(), tmp_path, spec=own.model_copy(update={"demand": demand}), seed=161)
    late = simulate_fleet(replace(files, duration=280.0), on_second=lambda _: None).query("time_s > 200").groupby("vehicle_id")
    moved, seen_s = late["x_m"].agg(np.ptp), late["time_s"].agg(np.ptp)
    assert moved[seen_s > 60].min() > 5
