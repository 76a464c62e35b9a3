from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from builders import paper_layout, paper_road, paper_work_zone

from wzsumo.errors import SpecError
from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation.demand import DemandSpec, write_demand
from wzsumo.simulation.drivers import DRIVER_PRESETS, hcm_drivers
from wzsumo.simulation.edges import edges_of, opposing_edges_of
from wzsumo.simulation.files import SimulationSpec
from wzsumo.spec import parse_spec

SPEED = 26.8224  # m/s, 60 mph
EDGES = edges_of(paper_layout())
ROAD_BOTH_WAYS = paper_road(opposing_lane_count=2)


def demand(folder: Path, *, seed: int = 1, **changes: object) -> Path:
    return write_demand(EDGES, folder, spec=DemandSpec.model_validate(changes), speed=SPEED, seed=seed)


def elements(path: Path, tag: str) -> list[dict[str, str]]:
    """Attributes of the elements of the route file with that tag."""
    return [element.attrib for element in ET.parse(path).getroot().findall(tag)]


def vehicles(path: Path) -> list[dict[str, str]]:
    return elements(path, "vehicle")


def within_5_sd(count: int, *, n: int, p: float) -> bool:
    return bool(abs(count - n * p) <= 5 * np.sqrt(n * p * (1 - p)))


def test_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path: Path) -> None:
    first, again, other = (demand(tmp_path, seed=seed).read_bytes() for seed in (7, 7, 8))
    assert first == again
    assert first != other


def test_vehicles_are_sorted_by_departure_within_the_duration(tmp_path: Path) -> None:
    departs = [float(v["depart"]) for v in vehicles(demand(tmp_path, duration_s=900))]
    assert departs == sorted(departs)
    assert 0 <= departs[0] < departs[-1] < 900
    ids = [v["id"] for v in vehicles(demand(tmp_path))]
    assert len(set(ids)) == len(ids)
    assert sorted(ids) == ids


@pytest.mark.parametrize("flow_vph", [60, 600, 3000])
def test_number_of_vehicles_is_poisson_with_the_flow(tmp_path: Path, flow_vph: int) -> None:
    mean = flow_vph
    count = len(vehicles(demand(tmp_path, flow_vph=flow_vph, duration_s=3600)))
    assert abs(count - mean) <= 5 * np.sqrt(mean)


def test_arrivals_follow_the_flow_profile(tmp_path: Path) -> None:
    profile = ((0, 600), (1800, 2400))
    departs = np.array([float(v["depart"]) for v in vehicles(demand(tmp_path, flow_profile=profile, duration_s=3600))])
    for count, mean in (((departs < 1800).sum(), 300), ((departs >= 1800).sum(), 1200)):
        assert abs(count - mean) <= 5 * np.sqrt(mean)


def test_profile_of_one_flow_gives_the_same_bytes_as_that_flow(tmp_path: Path) -> None:
    constant = demand(tmp_path, flow_vph=900).read_bytes()
    assert demand(tmp_path, flow_profile=((0, 900), (400, 900))).read_bytes() == constant


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_share_of_trucks_is_binomial(tmp_path: Path, share: float) -> None:
    types = [v["type"] for v in vehicles(demand(tmp_path, truck_share=share, duration_s=7200))]
    assert within_5_sd(sum(t.startswith("truck") for t in types), n=len(types), p=share)


def test_longer_duration_starts_with_the_departures_of_the_shorter(tmp_path: Path) -> None:
    short, long = ([v["depart"] for v in vehicles(demand(tmp_path, duration_s=t))] for t in (300, 600))
    assert len(short) > 80
    assert long[: len(short)] == short
    assert float(long[len(short)]) >= 300


def test_lane_use_is_followed_and_trucks_keep_out_of_the_left_lane(tmp_path: Path) -> None:
    all_ = vehicles(demand(tmp_path, lane_use=(0.2, 0.3, 0.5), truck_share=0.3, duration_s=7200))
    cars = [int(v["departLane"]) for v in all_ if v["type"].startswith("car")]
    trucks = [int(v["departLane"]) for v in all_ if v["type"].startswith("truck")]
    assert all(within_5_sd(cars.count(lane), n=len(cars), p=p) for lane, p in enumerate((0.2, 0.3, 0.5)))
    assert set(trucks) == {0, 1}


def test_cars_take_the_lane_with_most_room_and_trucks_keep_out_of_the_left_lane_of_three(tmp_path: Path) -> None:
    all_ = vehicles(demand(tmp_path, truck_share=0.3, merge_ahead_m=(100, 300)))
    assert {v["departLane"] for v in all_ if v["type"].startswith("car")} == {"free"}
    assert {v["departLane"] for v in all_ if v["type"].startswith("truck")} == {"0", "1"}


def test_drivers_who_would_have_merged_ahead_of_the_road_depart_on_lanes_that_go_on(tmp_path: Path) -> None:
    # The left lane of the paper's zone is down to 8 ft of 12 ft a third into its taper of 720 ft, which begins 240 ft after the
    # first device at 800 ft: 1280 ft (390 m) from the road's start.
    path = demand(tmp_path, truck_share=0.3)
    ahead = {t["id"]: float(t["lcStrategic"]) * SPEED * 10 for t in elements(path, "vType")}
    lanes = {
        merged: {v["departLane"] for v in vehicles(path) if v["type"].startswith("car") and (ahead[v["type"]] > 390) == merged}
        for merged in (True, False)
    }
    assert lanes == {True: {"best"}, False: {"free"}}


def test_every_vehicle_has_a_type_and_drives_the_whole_road(tmp_path: Path) -> None:
    path = demand(tmp_path)
    assert {v["type"] for v in vehicles(path)} <= {t["id"] for t in elements(path, "vType")}
    assert [route["edges"].split() for route in elements(path, "route")] == [[edge.id for edge in EDGES]]


def test_drivers_begin_to_merge_within_the_given_distances(tmp_path: Path) -> None:
    types = elements(demand(tmp_path, merge_ahead_m=(150, 400)), "vType")
    # SUMO looks lcStrategic x speed x 10 s ahead for changes to the right.
    ahead = [float(t["lcStrategic"]) * SPEED * 10 for t in types]
    assert 149 < min(ahead) < 200
    assert 350 < max(ahead) < 401


def test_vehicle_moves_aside_no_faster_than_its_rear_can_trail(tmp_path: Path) -> None:
    # SUMO docs, lane changing: lateral speed is at most lcMaxSpeedLatStanding + lcMaxSpeedLatFactor x speed. Beside a car of
    # 1.85 m a lane of 3.658 m leaves 0.904 m on either side, beside a truck of 2.5 m 0.579 m.
    for kind, slope in (("car", 0.904 / 4.8), ("truck", 0.579 / 12)):
        types = [t for t in elements(demand(tmp_path, truck_share=0.5), "vType") if t["id"].startswith(kind)]
        assert {t["lcMaxSpeedLatStanding"] for t in types} == {"0.1"}
        assert [float(t["lcMaxSpeedLatFactor"]) for t in types] == pytest.approx([slope] * len(types), abs=1e-3)


def test_every_driver_keeps_the_lane_after_overtaking_and_lets_in_some_of_those_who_must_merge(tmp_path: Path) -> None:
    types = elements(demand(tmp_path), "vType")
    assert {(t["lcKeepRight"], t["lcCooperative"]) for t in types} == {("0", "0.5")}


def test_every_driver_returns_to_a_place_in_the_lane_and_does_not_pass_another_in_it(tmp_path: Path) -> None:
    types = elements(demand(tmp_path), "vType")
    assert {(t["lcLaneDiscipline"], t["lcSublane"]) for t in types} == {("1", "10")}


def test_every_driver_knows_the_whole_road_ahead(tmp_path: Path) -> None:
    # SUMO's own look ahead ends after 8 edges or 3 km; no road of ours is longer than 20 km.
    assert {float(t["lcStrategicLookahead"]) for t in elements(demand(tmp_path), "vType")} == {20000.0}


def test_drivers_of_a_table_set_the_vehicle_types(tmp_path: Path) -> None:
    table = {"tau_s": 1.7, "accel_mps2": 1.1, "truck_tau_s": 3.1, "truck_accel_mps2": 0.6, "sigma": 0.3, "lc_assertive": 1.2}
    types = elements(demand(tmp_path, drivers=table), "vType")
    values = {t["vClass"]: [t[k] for k in ("tau", "accel", "sigma", "lcAssertive")] for t in types}
    assert values == {"passenger": ["1.7", "1.1", "0.3", "1.2"], "truck": ["3.1", "0.6", "0.3", "1.2"]}


@pytest.mark.parametrize("name", DRIVER_PRESETS)
def test_preset_is_found_by_its_name_and_read_back_from_an_effective_spec(name: str) -> None:
    spec = parse_spec(DemandSpec, {"drivers": name}, source="demand")
    assert spec.drivers == DRIVER_PRESETS[name]
    assert parse_spec(DemandSpec, spec.model_dump(mode="json"), source="effective") == spec


@pytest.mark.parametrize("name", [name for name in DRIVER_PRESETS if name.startswith("hcm_")])
def test_fitted_presets_name_the_step_and_the_lateral_resolution_that_the_toolkit_runs(name: str) -> None:
    fitted, runs = DRIVER_PRESETS[name], SimulationSpec()
    assert fitted.calibrated_step_length_s == runs.step_length_s
    assert fitted.calibrated_lateral_resolution_m == runs.lateral_resolution_m


@pytest.mark.parametrize(("slower", "faster"), [("2_to_1_rural", "2_to_1_urban"), ("3_to_2_rural", "3_to_2_urban")])
def test_drivers_of_a_zone_that_discharges_less_keep_the_longer_time_gap(slower: str, faster: str) -> None:
    # HCM 7: 1412 and 1591, 1604.5 and 1783.5 pc/h and lane.
    slow, fast = DRIVER_PRESETS[f"hcm_{slower}"], DRIVER_PRESETS[f"hcm_{faster}"]
    assert slow.tau_s > fast.tau_s
    assert slow.truck_tau_s > fast.truck_tau_s


@pytest.mark.parametrize("discharge", [1412.0, 1591.0, 1978.0])
def test_time_gap_moves_one_to_one_with_the_headway_and_a_trucks_with_that_of_two_cars(discharge: float) -> None:
    drivers, slower = (hcm_drivers(rate, open_lanes=1) for rate in (discharge, discharge - 100))
    longer_s = 3600 / (discharge - 100) - 3600 / discharge
    assert slower.tau_s - drivers.tau_s == pytest.approx(longer_s, abs=2e-3)
    assert slower.truck_tau_s - drivers.truck_tau_s == pytest.approx(2 * longer_s, abs=2e-3)  # HCM 7, E_T = 2 on level terrain


def test_fitted_drivers_accelerate_and_stand_as_was_measured_on_roads() -> None:
    drivers = hcm_drivers(1600.0, open_lanes=2)
    assert (drivers.accel_mps2, drivers.truck_accel_mps2) == (1.0, 0.6)
    # HCM 7, jam density of 190 passenger cars a mile and lane: 1609.344 / 190 = 8.5 m, of which a car takes 4.8 m.
    assert drivers.min_gap_m == pytest.approx(1609.344 / 190 - 4.8, abs=0.05)


def test_demand_whose_drivers_only_the_zone_decides_is_not_written_without_one(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="decided by the zone"):
        demand(tmp_path, drivers="hcm")


def test_drivers_brake_no_harder_than_the_service_brake(tmp_path: Path) -> None:
    types = elements(demand(tmp_path), "vType")
    assert {(t["vClass"], t["decel"], t["emergencyDecel"]) for t in types} == {
        ("passenger", "4.5", "4.5"),
        ("truck", "4", "4"),
    }


@pytest.mark.parametrize("key", ["step_length_s", "lateral_resolution_m"])
def test_drivers_refuse_a_step_or_a_lateral_model_that_they_were_not_calibrated_with(key: str) -> None:
    fitted = {"name": "fitted", "calibrated_step_length_s": 0.1, "calibrated_lateral_resolution_m": 0.45}
    parse_spec(SimulationSpec, {"demand": {"drivers": fitted}}, source="simulation")
    for drivers, name in ((fitted, "fitted"), ("hcm", "hcm")):
        with pytest.raises(SpecError, match=rf'{key}=0\.2 does not go with drivers "{name}", .* set {key} = 0\.'):
            parse_spec(SimulationSpec, {key: 0.2, "demand": {"drivers": drivers}}, source="simulation")


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"truck_share": 1.0}, "truck_share=1.0"),
        ({"flow_vph": 0}, "flow_vph=0"),
        ({"lane_use": [0.5, 0.6]}, r"lane_use=\(0\.5, 0\.6\) must be shares"),
        ({"merge_ahead_m": [400, 100]}, r"merge_ahead_m=\(400\.0, 100\.0\) must be \[nearest, farthest\]"),
        ({"flow": 1000}, "flow: unknown key .*flow_vph"),
        ({"flow_profile": [[60, 900]]}, r"flow_profile=\(\(60\.0, 900\.0\),\) must be pairs of a time"),
        ({"flow_profile": [[0, 900], [60, 0]]}, "flow_profile=.* a flow above 0 veh/h"),
        (
            {"drivers": "aggressive"},
            "drivers='aggressive': unknown drivers; known presets: uncalibrated, hcm, hcm_2_to_1_urban",
        ),
        ({"drivers": {"tau_s": 0}}, "drivers.tau_s=0"),
        ({"drivers": {"tau": 1}}, "drivers.tau: unknown key .*tau_s"),
    ],
)
def test_demand_that_is_impossible_is_refused_with_the_rule(changes: dict[str, object], rule: str) -> None:
    with pytest.raises(SpecError, match=rule):
        parse_spec(DemandSpec, changes, source="demand")


def test_opposing_vehicles_depart_on_their_own_route_and_leave_the_others_as_they_are(tmp_path: Path) -> None:
    back = opposing_edges_of(lay_out(paper_work_zone(closed_lanes=(), shift_ft=0, shifted_lane_width_ft=None), ROAD_BOTH_WAYS))
    assert back
    alone = vehicles(demand(tmp_path))
    spec = DemandSpec(opposing_flow_vph=600)
    both = vehicles(write_demand(EDGES, tmp_path, spec=spec, speed=SPEED, seed=1, opposing=back))
    assert [v for v in both if v["route"] == "through"] == alone
    opposing = [v for v in both if v["route"] == "opposing"]
    assert abs(len(opposing) - 200) <= 5 * np.sqrt(200)  # 600 veh/h for 1200 s
    departs = [float(v["depart"]) for v in both]
    assert departs == sorted(departs)


def test_vehicle_types_are_60_drivers_of_cars_and_60_of_trucks_of_their_sizes(tmp_path: Path) -> None:
    types = elements(demand(tmp_path), "vType")
    kinds = [(t["vClass"], t["length"], t["width"]) for t in types]
    assert kinds == [("passenger", "4.8", "1.85")] * 60 + [("truck", "12.0", "2.5")] * 60
    assert {t["speedFactor"] for t in types} == {"normc(1,0.1,0.75,1.3)"}
    assert {t["lcSigma"] for t in types} == {"0.08"}
    aside = np.array([float(t["latAlignment"]) for t in types])
    assert np.abs(aside).max() == 0.4  # two standard deviations
    assert 0.15 < aside.std() < 0.25


def test_demand_that_leaves_all_out_is_that_of_the_documentation() -> None:
    left_out = DemandSpec().model_dump(mode="json")
    assert left_out.pop("drivers")["name"] == "uncalibrated"
    assert left_out == {
        "flow_vph": 1500, "flow_profile": [], "opposing_flow_vph": 0, "truck_share": 0.1, "lane_use": [], "duration_s": 1200,
        "warm_up_s": 120, "speed_factor_sd": 0.1, "lateral_sd_m": 0.2, "lateral_wander": 0.08, "merge_ahead_m": [100, 1100],
    }  # fmt: skip


def test_drivers_that_leave_all_out_are_sumos_but_for_the_loaded_truck() -> None:
    left_out = DRIVER_PRESETS["uncalibrated"].model_dump(exclude={"name"})
    assert left_out == {
        "tau_s": 1.0, "accel_mps2": 2.6, "truck_tau_s": 1.0, "truck_accel_mps2": 1.0, "min_gap_m": 2.5, "sigma": 0.5,
        "lc_assertive": 1.0, "lc_lookahead_left": 2.0, "calibrated_step_length_s": None,
        "calibrated_lateral_resolution_m": None,
    }  # fmt: skip


@pytest.mark.parametrize(("open_lanes", "extra_s"), [(1, 0.95), (2, 0.75), (3, 0.75)])
def test_fitted_time_gaps_are_the_queues_headway_less_what_was_fitted(open_lanes: int, extra_s: float) -> None:
    drivers = hcm_drivers(1500.0, open_lanes=open_lanes)  # a headway of 2.4 s
    assert drivers.tau_s == pytest.approx(2.4 - extra_s)
    assert drivers.truck_tau_s == pytest.approx(2 * 2.4 - extra_s - 7.2 / 15)
    assert (drivers.lc_assertive, drivers.lc_lookahead_left) == (1.3, 1.0)
    assert (drivers.calibrated_step_length_s, drivers.calibrated_lateral_resolution_m) == (0.1, 0.45)
