from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.files import write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.gridlock import Gridlock

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SPARE_OF_ONE_THAT_WAITS = -0.5  # m, what it has beyond its minimum gap of 2.5 m: it stands 2 m behind


class Sumo:
    """What `Gridlock` asks of SUMO, for a vehicle "over" in the left of two lanes, which ends; `told` lists its commands."""

    def __init__(self, *, waited_s: float = 60.0, speed: float = 0.0, lane: str = "taper_1") -> None:
        self.waited_s, self.speed, self.on_road = waited_s, speed, ["over", "waits"]
        self.behind: dict[str, float] = {"waits": SPARE_OF_ONE_THAT_WAITS}  # m, spare gaps in the lane that leads on
        self.ahead: dict[str, float] = {}
        self.speeds_of_others: dict[str, float] = {}
        self.told: list[tuple[object, ...]] = []
        self.edge = SimpleNamespace(
            getIDList=lambda: ["taper", "elsewhere"],
            getLastStepHaltingNumber=lambda id_: int(id_ == "taper"),
            getLastStepVehicleIDs=lambda _id: self.on_road,
        )
        self.vehicle = SimpleNamespace(
            getIDList=lambda: self.on_road,
            getWaitingTime=lambda name: self.waited_s if name == "over" else 0.0,
            getSpeed=lambda name: self.speed if name == "over" else self.speeds_of_others.get(name, 0.0),
            getMinGap=lambda _name: 2.5,
            getLaneIndex=lambda _name: 1,
            getLaneID=lambda _name: lane,
            getBestLanes=lambda _name: [("taper_0", 500.0, 0.0, 0, True, ()), ("taper_1", 20.0, 0.0, -1, False, ())],
            getRightFollowers=lambda _name: self._neighbours(self.behind),
            getRightLeaders=lambda _name: self._neighbours(self.ahead),
            setLaneChangeMode=lambda name, mode: self.told.append((name, "mode", mode)),
            changeLane=lambda name, lane, duration: self.told.append((name, "lane", lane, duration)),
            getParameter=lambda _name, _key: "0.07",
            setParameter=lambda name, key, value: self.told.append((name, key, value)),
        )

    @staticmethod
    def _neighbours(spare_gaps: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
        return tuple(spare_gaps.items())


ASIDE = "laneChangeModel.lcMaxSpeedLatStanding"
LET_GO = [("over", "mode", 1), ("over", "lane", 0, 10.0), ("over", ASIDE, "0.5")]


def told(sumo: Sumo, gridlock: Gridlock | None = None) -> list[tuple[object, ...]]:
    """What the vehicle is told now."""
    (gridlock or Gridlock(sumo)).resolve()
    commands, sumo.told = sumo.told, []
    return commands


def test_vehicle_is_let_go_after_ten_seconds_and_changes_lanes_as_before_once_it_drives() -> None:
    sumo = Sumo(waited_s=9.9)
    gridlock = Gridlock(sumo)
    assert told(sumo, gridlock) == []
    sumo.waited_s = 10.1
    assert told(sumo, gridlock) == LET_GO
    sumo.speed, sumo.waited_s = 0.9, 0.0
    assert told(sumo, gridlock) == []
    sumo.speed = 1.1
    # SUMO docs, TraCI: 1621 is the default of lane change modes.
    assert told(sumo, gridlock) == [("over", "mode", 1621), ("over", ASIDE, "0.07")]
    assert told(sumo, gridlock) == []


def test_vehicle_in_the_lane_that_leads_on_is_not_let_go() -> None:
    assert told(Sumo(lane="taper_0")) == []


def test_only_edges_that_are_looked_at_count() -> None:
    sumo = Sumo()
    assert told(sumo, Gridlock(sumo, ["elsewhere"])) == []
    assert told(sumo, Gridlock(sumo, ["taper", "not in this network"])) == LET_GO


@pytest.mark.parametrize(
    ("gap_m", "goes"), [(0.9, False), (1.1, True), (2.4, True), (2.6, False)], ids=["beside", "near", "shut in", "free to go"]
)
def test_vehicle_goes_first_where_another_stands_closer_behind_it_than_its_minimum_gap(gap_m: float, goes: bool) -> None:
    sumo = Sumo()
    sumo.behind["waits"] = gap_m - 2.5
    assert (told(sumo) == LET_GO) == goes


@pytest.mark.parametrize(("gap_m", "goes"), [(-3.0, False), (0.9, False), (1.1, True)])
def test_vehicle_stays_that_has_another_beside_it_or_right_ahead_of_it(gap_m: float, goes: bool) -> None:
    ahead, behind = Sumo(), Sumo()
    ahead.ahead["other"] = behind.behind["other"] = gap_m - 2.5
    assert (told(ahead) == LET_GO) == (told(behind) == LET_GO) == goes


@pytest.mark.parametrize(("speed", "goes"), [(0.09, True), (0.11, False)])
def test_vehicle_that_drives_faster_than_0_1_mps_does_not_wait(speed: float, goes: bool) -> None:
    sumo = Sumo()
    sumo.speeds_of_others["waits"] = speed
    assert (told(sumo) == LET_GO) == goes


def test_vehicle_for_which_none_waits_is_not_let_go() -> None:
    sumo = Sumo()
    sumo.behind, sumo.ahead = {}, {"waits": 0.0}
    assert told(sumo) == []


def test_vehicle_that_has_left_the_road_is_forgotten() -> None:
    sumo = Sumo()
    gridlock = Gridlock(sumo)
    assert told(sumo, gridlock) == LET_GO
    sumo.on_road = ["waits"]
    assert told(sumo, gridlock) == []
    sumo.on_road, sumo.speed, sumo.waited_s = ["over", "waits"], 2.0, 0.0
    assert told(sumo, gridlock) == []


def test_vehicles_at_the_end_of_a_lane_do_not_wait_for_each_other_for_good(tmp_path: Path) -> None:
    # Without the rule two vehicles stand from 118 s on: one astride the line where its lane ends, one 2 m behind it.
    street = load_scenario(SCENARIOS / "street_interior_lane.toml", seed=161)
    own = street.zone_simulation()
    demand = own.demand.model_copy(update={"flow_vph": 2100.0})
    files = write_sumo_files(street.layout(), tmp_path, spec=own.model_copy(update={"demand": demand}), seed=161)
    late = simulate_fleet(replace(files, duration=280.0), on_second=lambda _: None).query("time_s > 200").groupby("vehicle_id")
    moved, seen_s = late["x_m"].agg(np.ptp), late["time_s"].agg(np.ptp)
    assert moved[seen_s > 60].min() > 5
