from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shapely
from builders import paper_layout, paper_road, paper_work_zone, vehicle_outlines

from wzsumo.errors import SimulationError
from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation import fleet
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.files import SimulationSpec, SumoFiles, Surroundings, write_sumo_files
from wzsumo.simulation.fleet import run_to_end, simulate_fleet
from wzsumo.simulation.session import running
from wzsumo.tables import check_traces
from wzsumo.vehicle import VehicleGeometry

LAYOUT = paper_layout()


def simulate(folder: Path, *, duration_s: float, seed: int) -> pd.DataFrame:
    spec = SimulationSpec(demand=DemandSpec(duration_s=duration_s))
    return simulate_fleet(write_sumo_files(LAYOUT, folder, spec=spec, seed=seed), on_second=lambda _: None)


@pytest.fixture(scope="module")
def traces(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return simulate(tmp_path_factory.mktemp("fleet"), duration_s=240, seed=1)


def test_outlines_built_here_match_the_vehicle_noun() -> None:
    car = VehicleGeometry()
    pose = np.array([3.0, -2.0, 0.7])
    centre = pose[:2] + car.axle_to_centre_m * np.array([np.cos(0.7), np.sin(0.7)])
    row = {"x_m": centre[0], "y_m": centre[1], "heading_rad": 0.7, "length_m": car.length_m, "width_m": car.width_m}
    (outline,) = vehicle_outlines(pd.DataFrame([row]))
    assert outline.symmetric_difference(shapely.Polygon(car.outline(pose))).area < 1e-9


def test_at_least_20_vehicles_pass_the_zone_in_four_minutes(traces: pd.DataFrame) -> None:
    span = traces.groupby("vehicle_id")["x_m"].agg(["min", "max"])
    assert ((span["min"] < LAYOUT.start) & (span["max"] > LAYOUT.end)).sum() >= 20


def test_no_vehicle_reaches_deeper_than_10_cm_into_the_closed_area(traces: pd.DataFrame) -> None:
    # SUMO keeps a vehicle's own lane to its lines, not a turned outline nor the end of a late lane change.
    overlap = shapely.area(shapely.intersection(vehicle_outlines(traces), LAYOUT.closed_area.buffer(-0.1)))
    assert overlap.max() == 0
    inside = shapely.intersects(vehicle_outlines(traces), LAYOUT.closed_area.buffer(-1e-6))
    assert inside.mean() < 0.002


def test_no_driver_brakes_harder_than_the_service_brake_among_drivers(traces: pd.DataFrame) -> None:
    speed_change = traces.groupby("vehicle_id")["speed_mps"].diff() / 0.1
    assert speed_change.min() > -4.5 - 0.02  # SUMO logs speeds to 1 mm/s


def test_vehicles_beside_the_activity_area_stay_within_the_open_lanes(traces: pd.DataFrame) -> None:
    area = LAYOUT.area("activity area")
    beside = traces[traces["x_m"].between(area.start + 10, area.end - 10)]
    corners = shapely.get_coordinates(vehicle_outlines(beside))[:, 1] / 0.3048
    assert len(beside) > 1000
    assert corners.min() >= -10 - 0.2
    assert corners.max() <= 12 + 0.2


def test_fleet_is_a_trace_table_in_order(traces: pd.DataFrame) -> None:
    pd.testing.assert_frame_equal(check_traces(traces, source="fleet"), traces)


def test_centre_moves_along_its_heading(traces: pd.DataFrame) -> None:
    steps = traces.groupby("vehicle_id")[["x_m", "y_m"]].diff(10).dropna()  # over one second
    steps = steps[steps["x_m"] > 5]
    slope = np.arctan2(steps["y_m"], steps["x_m"])
    mean_heading = traces.groupby("vehicle_id")["heading_rad"].rolling(11).mean().droplevel(0)[steps.index]
    assert np.abs(slope - mean_heading).quantile(0.95) < 0.01


def test_speed_agrees_with_the_movement_of_the_centre(traces: pd.DataFrame) -> None:
    steps = traces.groupby("vehicle_id")[["x_m", "y_m"]].diff(10).dropna()  # over one second
    mean_speed = traces.groupby("vehicle_id")["speed_mps"].rolling(10).mean().droplevel(0)[steps.index]
    # SUMO counts 0.1 to 0.3 m for the junction between two edges, which has no length here; three are passed in a second.
    assert np.abs(np.hypot(steps["x_m"], steps["y_m"]) - mean_speed).max() < 0.9


def test_vehicle_enters_with_its_rear_at_the_roads_start(traces: pd.DataFrame) -> None:
    first = traces.groupby("vehicle_id").first()
    rear = first["x_m"] - first["length_m"] / 2
    # departPos="base"; a vehicle that departs between two steps is logged up to one step of 0.1 s further on.
    assert rear.between(-0.01, first["speed_mps"] * 0.1 + 0.2).all()


def test_same_seed_gives_the_same_traces_and_another_seed_others(tmp_path: Path) -> None:
    first, again, other = (simulate(tmp_path, duration_s=30, seed=seed) for seed in (5, 5, 6))
    pd.testing.assert_frame_equal(first, again)
    assert not first.equals(other)


def test_demand_above_capacity_enters_on_all_lanes_and_trucks_at_their_share(tmp_path: Path) -> None:
    # 3,000 veh/h on two lanes of which one closes: a queue stands to the road's start. With a fixed lane for every vehicle two
    # thirds entered on the closing lane.
    zone = lay_out(paper_work_zone(closed_lanes=(1,), shift_ft=0, shifted_lane_width_ft=None), paper_road(lane_count=2))
    spec = SimulationSpec(demand=DemandSpec(flow_vph=3000, truck_share=0.2, duration_s=300))
    files = write_sumo_files(zone, tmp_path, spec=spec, seed=3)
    first = simulate_fleet(files, on_second=lambda _: None).groupby("vehicle_id").first()
    queued = first[first["time_s"] > 120]
    assert len(queued) > 40
    assert 0.35 < (queued["y_m"] > 12 * 0.3048).mean() < 0.65
    assert 0.1 < (first["length_m"] > 10).mean() < 0.3


@pytest.fixture(scope="module")
def short_run(tmp_path_factory: pytest.TempPathFactory) -> SumoFiles:
    spec = SimulationSpec(demand=DemandSpec(duration_s=40))
    return write_sumo_files(paper_layout(), tmp_path_factory.mktemp("run"), spec=spec, seed=2)


def test_binary_moves_every_vehicle_as_libsumo_does(short_run: SumoFiles, tmp_path: Path) -> None:
    outputs = [tmp_path / name for name in ("binary.xml", "libsumo.xml")]
    options = ("--fcd-output.attributes", "x,y,angle,speed", "--precision", "4")
    run_to_end(short_run, options=(*options, "--fcd-output", str(outputs[0])), on_second=lambda _: None)
    with running(short_run.config, options=(*options, "--fcd-output", str(outputs[1]))) as session:
        for _ in range(400):
            session.step()
    first, second = (path.read_text().split("<fcd-export", 1)[1] for path in outputs)  # the head names the file
    assert first == second


def test_progress_tells_every_simulated_second_once(short_run: SumoFiles) -> None:
    seconds: list[float] = []
    run_to_end(short_run, options=(), on_second=seconds.append)
    assert seconds == pytest.approx(list(range(41)))


def test_failure_of_sumo_is_raised_with_its_reason(short_run: SumoFiles, tmp_path: Path) -> None:
    missing = replace(short_run, config=tmp_path / "nowhere.sumocfg")
    with pytest.raises(SimulationError, match=r"SUMO ended with 1: .*nowhere\.sumocfg"):
        run_to_end(missing, options=(), on_second=lambda _: None)


def test_vehicle_of_a_network_is_as_large_as_its_type_though_sumo_gave_it_a_copy_of_the_type(
    short_run: SumoFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SUMO names the copy type@vehicle; both names may hold an @."""
    ids = {"v1": "van", "v@2": "van@v@2", "v3": "long@van@v3", "v4": "long@van"}

    def write_fcd(_files: SumoFiles, *, options: tuple[str, ...], on_second: object) -> None:
        columns = {"vehicle_x": 50.0, "vehicle_y": 0.0, "vehicle_angle": 90.0, "vehicle_speed": 9.0, "timestep_time": 1.0}
        rows = pd.DataFrame({"vehicle_id": list(ids), "vehicle_type": list(ids.values())}).assign(**columns)
        rows.to_parquet(options[options.index("--fcd-output") + 1])

    sizes = {"van": (6.5, 2.0), "long@van": (9.5, 2.1)}
    around = Surroundings(
        along=(), around=(), vehicle_sizes=sizes, whole_edges={}, shapes={}, additionals=(), without_zone=short_run.config
    )
    monkeypatch.setattr(fleet, "run_to_end", write_fcd)
    traces = simulate_fleet(replace(short_run, surroundings=around), on_second=lambda _: None)
    assert dict(zip(traces["vehicle_id"], traces["length_m"], strict=True)) == {"v1": 6.5, "v@2": 6.5, "v3": 9.5, "v4": 9.5}
