"""Every scenario of the library is laid out and becomes a network; some are driven through."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
import shapely
from builders import paper_road, vehicle_outlines

from wzsumo.mutcd.layout import lay_out
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.drivers import DRIVER_PRESETS
from wzsumo.simulation.edges import edges_of, opposing_edges_of
from wzsumo.simulation.files import write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.network import write_network
from wzsumo.work_zone import WorkZoneLayout

LIBRARY = sorted((Path(__file__).parents[2] / "scenarios").glob("*.toml"))
DRIVEN = {"interior_lane": 150, "one_lane_signal": 240, "one_lane_flaggers": 240, "double_closure": 150, "paper_bend_300m": 120}


Driven = Callable[[str], tuple[WorkZoneLayout, pd.DataFrame]]


def library(test: Callable[..., None]) -> Callable[..., None]:
    return pytest.mark.parametrize("path", LIBRARY, ids=lambda path: path.stem)(test)


@library
def test_scenario_is_named_after_its_file_and_says_what_it_is_for(path: Path) -> None:
    assert load_scenario(path).name == path.stem
    first = path.read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith("# ")
    assert len(first) > 40


@library
def test_scenario_is_laid_out_with_its_devices_on_the_pavement_and_its_ego_on_the_road(path: Path) -> None:
    scenario = load_scenario(path)
    layout = scenario.layout()
    road = layout.road
    whole = road.strip(0, road.length, -road.right_shoulder, road.left_edge)
    assert layout.drivable.is_valid
    assert layout.closed_area.area + layout.pavement.area == pytest.approx(whole.area, rel=1e-6)
    assert shapely.distance(layout.device_outlines, whole).max() < 0.01
    for pose in scenario.start_and_goal(layout):
        assert layout.drivable.covers(shapely.Point(pose[:2]))


@library
def test_scenario_becomes_a_network_whose_lanes_lie_in_the_open_area(path: Path, tmp_path: Path) -> None:
    scenario = load_scenario(path)
    layout = scenario.layout()
    write_sumo_files(layout, tmp_path, spec=scenario.zone_simulation(), seed=scenario.seed)
    net = ET.parse(tmp_path / "zone.net.xml").getroot()
    ids = {edge.get("id") for edge in net.findall("edge") if edge.get("function") != "internal"}
    assert ids == {edge.id for edge in (*edges_of(layout), *opposing_edges_of(layout))}
    for edge in edges_of(layout):
        for lane in net.findall(f"edge[@id='{edge.id}']/lane"):
            if lane.get("allow") == "custom1":  # closed ground between two lanes
                continue
            points = np.array([list(map(float, point.split(",")[:2])) for point in lane.attrib["shape"].split()])
            strip = shapely.LineString(points).buffer(float(lane.attrib["width"]) / 2, cap_style="flat")
            assert strip.intersection(layout.closed_area).area < 0.02 * strip.area, lane.get("id")
    drawn = ET.parse(tmp_path / "zone.add.xml").getroot()
    for name in ("drivable", "closed_area"):
        shapes = [poly.attrib["shape"].split() for poly in drawn.findall(f"poly[@type='{name}']")]
        ground = shapely.union_all(
            [shapely.Polygon([tuple(map(float, point.split(","))) for point in shape]) for shape in shapes]
        )
        assert ground.symmetric_difference(getattr(layout, name)).area < 1e-3 * ground.area, name
    signs = [poi for poi in drawn.findall("poi") if poi.attrib["id"].startswith("sign_")]
    assert len(signs) == len(layout.signs)
    assert sum(poly.attrib["id"].startswith("device") for poly in drawn.findall("poly")) == len(layout.devices)
    along, _ = layout.road.to_sd([[float(poi.attrib["x"]), float(poi.attrib["y"])] for poi in signs])
    assert 0 <= along.min() <= along.max() <= layout.road.length  # also those that stand ahead of the modelled road
    assert all((tmp_path / poi.attrib["imgFile"]).is_file() for poi in drawn.findall("poi"))


FITTED = {
    "hcm_2_to_1_urban": ("right_lane", "left_lane", "confusing"),  # 1591 pc/h and lane
    "hcm_3_to_1_urban": ("double_closure", "paper_single_lane"),  # 1591
    "hcm_3_to_2_urban": ("paper", "paper_bend_300m", "paper_bend_900m", "interior_lane"),  # 1783.5
}


@pytest.mark.parametrize(("preset", "name"), [(preset, name) for preset, names in FITTED.items() for name in names])
def test_scenario_of_a_fitted_class_drives_with_the_drivers_of_that_class_and_keeps_their_name(preset: str, name: str) -> None:
    scenario = load_scenario(LIBRARY[0].parent / f"{name}.toml")
    drivers = scenario.zone_simulation().demand.drivers
    assert drivers == DRIVER_PRESETS[preset].model_copy(update={"name": "hcm"})
    assert scenario.model_dump(mode="json")["simulation"]["demand"]["drivers"] == "hcm"


def test_barrier_instead_of_drums_shortens_the_time_gap_by_what_it_takes_off_the_headway() -> None:
    beside_drums, beside_wall = (
        load_scenario(LIBRARY[0].parent / f"{name}.toml").zone_simulation().demand.drivers
        for name in ("right_lane", "right_lane_barrier")
    )
    # HCM 7, Eq. 10-8: f_Br takes 194 pc/h from 1785.
    assert beside_drums.tau_s - beside_wall.tau_s == pytest.approx(3600 / 1591 - 3600 / 1785, abs=2e-3)


def test_zone_along_a_surveyed_line_covers_the_ground_of_the_straight_one_within_half_a_percent(tmp_path: Path) -> None:
    straight, bent = (load_scenario(LIBRARY[0].parent / f"{name}.toml").layout() for name in ("paper", "paper_bend_300m"))
    stations = np.linspace(0, bent.road.length, 74)  # a point every 25 m of bends of 300 m, to the centimetre
    points = bent.road.to_xy(stations, bent.road.travelled_width / 2).round(2)
    surveyed = lay_out(straight.work_zone, paper_road(length_ft=None, reference_points_m=tuple(map(tuple, points))))
    for name in ("drivable", "closed_area", "pavement"):
        assert getattr(surveyed, name).area == pytest.approx(getattr(straight, name).area, rel=0.005), name
    assert surveyed.devices[["s_m", "d_m"]].to_numpy() == pytest.approx(straight.devices[["s_m", "d_m"]].to_numpy())
    length = sum(float(lane.attrib["length"]) for lane in ET.parse(write_network(surveyed, tmp_path)).iter("lane")
                 if lane.get("index") == "0" and not lane.attrib["id"].startswith(":"))  # fmt: skip
    assert length == pytest.approx(straight.road.length, rel=1e-3)


@pytest.mark.parametrize("bend", ["paper_bend_300m", "paper_bend_900m"])
def test_zone_on_bends_left_and_right_covers_the_ground_of_the_straight_one_within_half_a_percent(bend: str) -> None:
    straight, bent = (load_scenario(LIBRARY[0].parent / f"{name}.toml").layout() for name in ("paper", bend))
    assert bent.road.length == pytest.approx(straight.road.length, rel=1e-4)
    for name in ("drivable", "closed_area", "pavement"):
        assert getattr(bent, name).area == pytest.approx(getattr(straight, name).area, rel=0.005), name


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Driven:
    """(layout, traces) of a scenario of the library by its name, driven for a short while, once."""
    done: dict[str, tuple[WorkZoneLayout, pd.DataFrame]] = {}

    def drive(name: str) -> tuple[WorkZoneLayout, pd.DataFrame]:
        if name not in done:
            scenario = load_scenario(next(path for path in LIBRARY if path.stem == name))
            simulation = scenario.zone_simulation()
            demand = simulation.demand.model_copy(update={"duration_s": float(DRIVEN[name])})
            spec = simulation.model_copy(update={"demand": demand})
            layout, folder = scenario.layout(), tmp_path_factory.mktemp(name)
            done[name] = layout, simulate_fleet(write_sumo_files(layout, folder, spec=spec, seed=21), on_second=lambda _: None)
        return done[name]

    return drive


@pytest.mark.parametrize("name", DRIVEN)
def test_no_vehicle_of_a_short_run_reaches_into_the_closed_area_or_off_the_pavement(name: str, driven: Driven) -> None:
    layout, traces = driven(name)
    outlines, road = vehicle_outlines(traces), layout.road
    station, _ = road.to_sd(traces[["x_m", "y_m"]])
    assert traces[station > layout.end]["vehicle_id"].nunique() >= 5
    # SUMO keeps a vehicle's own lane to its lines, not a turned outline nor the end of a late lane change.
    assert not shapely.intersects(layout.closed_area.buffer(-0.1), outlines).any()
    pavement = road.strip(-20, road.length + 20, -road.right_shoulder - 0.1, road.left_edge + 0.1)
    assert shapely.covers(pavement, outlines).all()


@pytest.mark.parametrize("name", ["one_lane_signal", "one_lane_flaggers"])
def test_directions_that_take_turns_never_meet_between_the_stop_lines(name: str, driven: Driven) -> None:
    layout, traces = driven(name)
    station, _ = layout.road.to_sd(traces[["x_m", "y_m"]])
    shared = layout.taking_turns
    assert shared is not None
    between = (station > shared.start + 5) & (station < shared.end - 5)
    along = np.cos(traces["heading_rad"] - layout.road.heading_at(station)) > 0
    times = [set(traces["time_s"][between & way].round(1)) for way in (along, ~along)]
    assert all(len(seen) > 100 for seen in times)  # both had their turn
    assert not times[0] & times[1]
