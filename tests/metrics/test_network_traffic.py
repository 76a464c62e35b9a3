"""Figures of a network's traffic from records that are written down here."""

import math

import pandas as pd
import pytest

from wzsumo.metrics.network_traffic import NetworkMeasures, compare_edges, network_figures, summarise_network, trips_on_road
from wzsumo.simulation.edge_records import EDGE_COLUMNS
from wzsumo.simulation.trips import TRIP_COLUMNS

TRIPS = pd.DataFrame(
    [
        ("arrived", 10.0, True, True, 100.0, 20.0, 20.0, 2000.0, 500.0, 1.0, 150.0),
        ("under_way", 0.0, True, False, math.nan, math.nan, 60.0, 1000.0, 300.0, 0.5, 90.0),
        ("waiting", 90.0, False, False, math.nan, math.nan, 0.0, 0.0, 0.0, 0.0, 0.0),
    ],
    columns=list(TRIP_COLUMNS),
)
EDGES = pd.DataFrame(
    [("road", 50.0, 1500.0, 400.0, 1.0, 100.0), ("street", 30.0, 1500.0, 400.0, 0.5, 140.0)], columns=list(EDGE_COLUMNS)
)


def test_vehicles_that_have_not_arrived_count_with_what_they_have_lost_so_far() -> None:
    found = summarise_network(TRIPS, EDGES, road={"road"})
    assert (found.n_vehicles, found.n_arrived, found.n_waiting) == (3, 1, 1)
    assert found.delay_h == pytest.approx((10 + 20 + 60 + 90) / 3600)
    assert found.mean_delay_s == pytest.approx(60)
    assert found.mean_departure_delay_s == pytest.approx(100 / 3)
    assert found.mean_travel_time_s == 100
    assert (found.driven_vkm, found.co2_kg) == (3.0, 0.8)
    assert (found.corridor_delay_h, found.corridor_vkm, found.corridor_co2_kg) == pytest.approx((50 / 3600, 1.5, 0.4))


def test_change_is_with_the_zone_less_without_it_figure_by_figure() -> None:
    held = TRIPS.assign(departure_delay_s=TRIPS["departure_delay_s"] + 36.0)
    both = [summarise_network(trips, EDGES, road={"road"}) for trips in (held, TRIPS)]
    measures = NetworkMeasures(with_zone=both[0], without_zone=both[1], edges=EDGES)
    change = network_figures(measures)["change"]
    assert change["delay_h"] == pytest.approx(3 * 36 / 3600)
    assert change["mean_departure_delay_s"] == pytest.approx(36)
    assert change["co2_kg"] == 0


def test_edges_are_compared_where_vehicles_were_in_either_simulation_or_in_none() -> None:
    without = EDGES[EDGES["edge_id"] == "road"].assign(time_loss_s=20.0)
    edges = compare_edges(EDGES, without, shapes={"road": "0,0 1,0", "street": "0,0 0,1", "empty": "0,0 1,1"})
    rows = edges.set_index("edge_id")
    assert rows["delay_change_s"].to_dict() == {"empty": 0.0, "road": 30.0, "street": 30.0}
    assert rows["shape"]["empty"] == "0,0 1,1"


def test_trip_over_the_road_counts_its_time_there_against_the_posted_speed() -> None:
    time = [0.0, 1.0, 2.0, 3.0]
    car = pd.DataFrame({"vehicle_id": "arrived", "time_s": time, "speed_mps": [20.0, 10.0, 10.0, 25.0]})
    late = pd.DataFrame({"vehicle_id": "under_way", "time_s": [8.0, 9.0], "speed_mps": 20.0})
    trips = trips_on_road(pd.concat([car, late]), TRIPS, free_speed=20.0, dt=1.0).set_index("vehicle_id")
    assert set(trips.index) == {"arrived", "under_way"}
    assert (trips["travel_time_s"]["arrived"], trips["time_loss_s"]["arrived"]) == (3.0, 1.0)
    assert trips["distance_m"]["arrived"] == 65.0
    assert not trips["arrived"]["under_way"]
    assert math.isnan(trips["time_loss_s"]["under_way"])
    assert trips["departure_delay_s"]["arrived"] == 10.0
