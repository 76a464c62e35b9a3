import numpy as np
import pandas as pd
import pytest
from builders import paper_layout

from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.files import SimulationSpec, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.trips import TRIP_COLUMNS, read_trips, trips_file


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(traces, trips) of two minutes of a demand that the entry cannot take: nine vehicles in ten come in one lane."""
    spec = SimulationSpec(demand=DemandSpec(flow_vph=4500, lane_use=(0.9, 0.05, 0.05), duration_s=120))
    files = write_sumo_files(paper_layout(), tmp_path_factory.mktemp("trips"), spec=spec, seed=3)
    traces = simulate_fleet(files, on_second=lambda _: None)
    return traces, read_trips(trips_file(files))


def test_every_vehicle_that_was_due_has_one_trip(run: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    traces, trips = run
    assert tuple(trips.columns) == TRIP_COLUMNS
    assert trips["vehicle_id"].is_unique
    assert set(traces["vehicle_id"]) == set(trips.loc[trips["entered"], "vehicle_id"])
    assert (~trips["entered"]).sum() > 5


def test_vehicles_that_still_wait_have_a_departure_delay_and_no_distance(run: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    _, trips = run
    waiting = trips[~trips["entered"]]
    assert (waiting["departure_delay_s"] > 0).all()
    assert (waiting["distance_m"] == 0).all()
    assert not waiting["arrived"].any()


def test_travel_time_is_the_span_of_the_vehicles_fixes(run: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    traces, trips = run
    span = traces.groupby("vehicle_id")["time_s"].agg(np.ptp)
    arrived = trips[trips["arrived"]].set_index("vehicle_id")
    assert len(arrived) > 20
    # A vehicle departs up to a step before its first fix and arrives up to a step after its last.
    assert (arrived["travel_time_s"] - span[arrived.index]).between(-0.01, 0.21).all()
    assert trips.loc[~trips["arrived"], "travel_time_s"].isna().all()


def test_carbon_dioxide_of_cars_on_the_free_road_is_that_of_a_petrol_car(run: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    _, trips = run
    per_km = trips["co2_g"].sum() / (trips["distance_m"].sum() / 1000)
    assert 120 < per_km < 600  # a petrol car 130 to 250 g/km, a lorry 500 to 900 g/km, one in ten of these
    assert trips["fuel_g"].sum() * 3.1 == pytest.approx(
        trips["co2_g"].sum(), rel=0.05
    )  # 3.1 g of CO2 a gram of petrol or diesel
