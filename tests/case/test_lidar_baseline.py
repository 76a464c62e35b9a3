from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pandas as pd
import pytest
from scipy import ndimage

from wzsumo.case.assessment import lidar_figures
from wzsumo.case.lidar_baseline import mapping_drive, others_at
from wzsumo.case.methods import METHODS
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Tell, Watch
from wzsumo.case.zone import SimulatedZone
from wzsumo.errors import SpecError
from wzsumo.grid import OccupancyGrid, cells_inside
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.site import prepare_site
from wzsumo.sensing.lidar import Drive
from wzsumo.spec import parse_spec, read_toml

PAPER = Path(__file__).parents[2] / "scenarios" / "paper.toml"


def short_scenario(**slam: Any) -> Scenario:
    """A zone of 150 m at 25 mph that closes the left lane of three, and a coarse, slow LiDAR."""
    content = read_toml(PAPER)
    content["road"] |= {"length_ft": 1200}
    content["work_zone"] |= {"posted_speed_mph": 25, "start_ft": 300, "work_length_ft": 100, "shift_ft": 0, "buffer_ft": 50}
    del content["work_zone"]["shifted_lane_width_ft"]
    content["route"] |= {"start_before_zone_m": 30, "goal_after_zone_m": 30}
    content["map"] = {"resolution_m": 0.25}
    content["slam"] = {"lidar": {"layers": 48, "azimuth_count": 600, "rate_hz": 5}, **slam}
    return parse_spec(Scenario, content, source="test")


def fleet_of(*tracks: tuple[str, float, float], length_m: float = 4.6, start_s: float = 130.0) -> pd.DataFrame:
    """Trace table of cars along x at 15 m/s, one (id, y, seconds behind the first) each."""
    x = np.arange(0.0, 360.0, 1.5)
    cars = [
        pd.DataFrame({"vehicle_id": name, "time_s": start_s + behind + x / 15, "x_m": x, "y_m": float(y), "heading_rad": 0.0,
                      "speed_mps": 15.0, "length_m": length_m, "width_m": 1.8})
        for name, y, behind in tracks
    ]  # fmt: skip
    return pd.concat(cars, ignore_index=True)


SCENARIO = short_scenario()
SITE = prepare_site(SCENARIO)
LANE = SITE.layout.road.lane_centre(1)


def test_mapping_car_is_the_first_that_begins_in_the_egos_lane_and_its_drive_is_of_its_rear_axle() -> None:
    fleet = fleet_of(("late", LANE, 9.0), ("beside", SITE.layout.road.lane_centre(0), 0.0), ("first", LANE, 4.0))
    vehicle_id, drive = mapping_drive(fleet, scenario=SCENARIO, site=SITE)
    assert vehicle_id == "first"
    at = np.interp(140.0, drive.time_s, drive.poses[:, 0])
    assert at == pytest.approx(15 * (140.0 - 134.0) - SCENARIO.vehicle.axle_to_centre_m)


def test_fleet_without_a_car_in_the_egos_lane_is_refused_with_the_remedy() -> None:
    for fleet in (fleet_of(("truck", LANE, 0.0), length_m=12.0), fleet_of(("early", LANE, 0.0), start_s=20.0)):
        with pytest.raises(SpecError, match=r"no car began in lane 1 .* raise simulation\.demand\.flow_vph"):
            mapping_drive(fleet, scenario=SCENARIO, site=SITE)


PAPER_SITE = prepare_site(load_scenario(PAPER))
START_M, GOAL_M = PAPER_SITE.layout.road.to_sd([PAPER_SITE.start[:2], PAPER_SITE.goal[:2]])[0]


def car(*, start_s: float = 130.0, late_m: float = 0.0, early_m: float = 0.0, length_m: float = 4.6) -> pd.DataFrame:
    """A car in the ego's lane whose trace begins `late_m` after the ego's start and ends `early_m` before its goal."""
    x = np.arange(START_M + late_m, GOAL_M - early_m + 1e-6, 1.0)
    return pd.DataFrame({
        "vehicle_id": "car", "time_s": start_s + (x - x[0]) / 20, "x_m": x, "y_m": float(PAPER_SITE.start[1]),
        "heading_rad": 0.0, "speed_mps": 20.0, "length_m": length_m, "width_m": 1.8,
    })  # fmt: skip


def is_mapping_car(fleet: pd.DataFrame) -> bool:
    try:
        mapping_drive(fleet, scenario=load_scenario(PAPER), site=PAPER_SITE)
    except SpecError:
        return False
    return True


@pytest.mark.parametrize(("start_s", "taken"), [(119.9, False), (120.0, True)])
def test_mapping_car_enters_after_two_minutes(start_s: float, taken: bool) -> None:
    assert is_mapping_car(car(start_s=start_s)) == taken


@pytest.mark.parametrize(("late_m", "early_m", "taken"), [(8.5, 8.5, True), (10.5, 0.0, False), (0.0, 11.5, False)])
def test_mapping_car_drives_from_start_to_goal_within_10_m(late_m: float, early_m: float, taken: bool) -> None:
    assert is_mapping_car(car(late_m=late_m, early_m=early_m)) == taken


@pytest.mark.parametrize(("length_m", "taken"), [(6.9, True), (7.0, False)])
def test_vehicle_from_7_m_on_is_a_truck_and_no_mapping_car(length_m: float, taken: bool) -> None:
    assert is_mapping_car(car(length_m=length_m)) == taken


def test_vehicles_of_a_moment_are_carried_on_from_their_last_fix() -> None:
    drive = Drive(time_s=np.array([130.0, 150.0]), poses=np.zeros((2, 3)))
    vehicles = others_at(fleet_of(("a", 2.0, 0.0), ("b", 5.0, 3.0)), drive)
    at = vehicles(135.05).set_index("y_m")["x_m"]
    assert at.to_dict() == pytest.approx({2.0: 15 * 5.05, 5.0: 15 * 2.05})
    assert vehicles(129.0).empty


@pytest.mark.parametrize(("before_s", "there"), [(0.9, True), (1.1, False)])
def test_vehicle_whose_last_fix_is_a_second_before_the_drive_is_still_there(before_s: float, there: bool) -> None:
    drive = Drive(time_s=np.array([130.0, 150.0]), poses=np.zeros((2, 3)))
    fleet = fleet_of(("gone", 2.0, 0.0), start_s=130.0 - before_s).head(1)
    vehicles = others_at(fleet, drive)(130.0)
    assert len(vehicles) == there
    if there:
        assert vehicles["x_m"].item() == pytest.approx(15 * before_s)
        assert vehicles["length_m"].item() == 4.6
        assert vehicles["width_m"].item() == 1.8


def test_moment_between_fixes_of_two_vehicles_has_those_of_the_last_time_alone() -> None:
    drive = Drive(time_s=np.array([130.0, 150.0]), poses=np.zeros((2, 3)))
    fleet = pd.concat([fleet_of(("a", 2.0, 0.0)).head(2), fleet_of(("b", 5.0, 0.0)).head(1)])
    vehicles = others_at(fleet, drive)
    assert set(vehicles(130.05)["y_m"]) == {2.0, 5.0}
    assert set(vehicles(130.1)["y_m"]) == {2.0}  # b has left


def no_files() -> NoReturn:
    raise AssertionError("nobody drives here")


def map_by(name: str, sources: Sources) -> OccupancyGrid:
    return METHODS[name].map_of_zone(sources).grid


@pytest.fixture(scope="module")
def shares() -> list[float]:
    """The shares of the mapping drive that are told while it is mapped."""
    return []


@pytest.fixture(scope="module")
def sources(shares: list[float]) -> Sources:
    @contextmanager
    def progress(name: str, total: float) -> Iterator[Tell]:
        yield shares.append

    fleet = fleet_of(("mapper", LANE, 0.0), ("follower", LANE, 1.5), ("beside", SITE.layout.road.lane_centre(0), 0.3))
    zone = SimulatedZone(over_zone=fleet, whole_fleet=lambda: fleet, sumo_files=no_files, fleet_before=no_files)
    return Sources(zone=zone, scenario=SCENARIO, site=SITE, watch=Watch(progress=progress))


def test_mapping_drive_knows_its_way_to_decimetres_and_finds_the_devices(sources: Sources) -> None:
    figures = lidar_figures(sources.lidar)
    assert figures["vehicle_id"] == "mapper"
    assert figures["ate_m"] < 0.1  # the bar for a drive between cones with RTK
    assert figures["dead_reckoning_ate_m"] > figures["ate_m"]
    assert abs(figures["n_devices_mapped"] - len(SITE.layout.devices)) <= 1


def test_every_scan_of_the_drive_has_a_pose_a_state_and_a_share_of_the_progress(sources: Sources, shares: list[float]) -> None:
    figures = lidar_figures(sources.lidar)
    (first_m, last_m), _ = SITE.layout.road.to_sd([SITE.start[:2], SITE.goal[:2]])
    assert figures["n_scans"] == pytest.approx(5 * (last_m - first_m) / 15, abs=2)  # 5 scans a second at 15 m/s
    assert sum(figures["scan_states"].values()) == figures["n_scans"] == len(shares)
    assert 0.0 <= shares[0] < 0.05
    assert 0.95 < shares[-1] <= 1.0
    assert np.diff(shares) == pytest.approx(1 / figures["n_scans"], rel=0.1)


def test_poses_of_the_drive_are_those_of_the_mapping_car(sources: Sources) -> None:
    _, drive = mapping_drive(fleet_of(("mapper", LANE, 0.0)), scenario=SCENARIO, site=SITE)
    x, y = sources.lidar.poses[:, 0, 3], sources.lidar.poses[:, 1, 3]
    assert x[[0, -1]] == pytest.approx(drive.poses[[0, -1], 0], abs=3.5)  # a scan takes a fifth of a second
    assert np.diff(x) == pytest.approx(15 / 5, abs=0.3)
    assert y == pytest.approx(LANE, abs=0.3)


def test_barrier_separates_the_closed_area_from_the_open_lanes_and_the_raw_view_does_not(sources: Sources) -> None:
    activity = SITE.layout.area("activity area")
    x, road = (activity.start + activity.end) / 2, SITE.layout.road
    open_lane, closed_lane = (x, road.lane_centre(0)), (x, road.lane_centre(2))
    between = cells_inside(SITE.cells, road.strip(SITE.layout.start, SITE.layout.end, 0, road.travelled_width))
    joined = {}
    for name in ("slam_raw", "slam_log_odds", "slam_barrier"):
        label, _ = ndimage.label(map_by(name, sources).free & between)
        rows, cols = SITE.cells.cell_of([open_lane, closed_lane])
        joined[name] = bool(label[rows[0], cols[0]] == label[rows[1], cols[1]] != 0)
    assert not joined["slam_barrier"]
    assert joined["slam_log_odds"]


def test_slam_maps_end_at_the_pavement_and_are_nominal_outside_the_zone(sources: Sources) -> None:
    road = SITE.layout.road
    beyond = ~cells_inside(SITE.cells, road.strip(0, road.length, -road.right_shoulder, road.left_edge))
    for name in ("slam_raw", "slam_log_odds", "slam_barrier"):
        assert not map_by(name, sources).free[beyond].any()
        assert map_by(name, sources).free[SITE.nominal].all()
