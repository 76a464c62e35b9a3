from pathlib import Path

import pytest
from builders import paper_layout

from wzsumo.errors import SpecError
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.departures import check_departures, lane_departure_vph
from wzsumo.simulation.drivers import DriverSpec
from wzsumo.simulation.files import SimulationSpec, write_sumo_files
from wzsumo.simulation.fleet import run_to_end
from wzsumo.simulation.trips import TRIP_OPTIONS, read_trips, trips_file

SPEED = 26.8224  # m/s, 60 mph


def check(*, n_lanes: int = 3, n_opposing: int = 0, **demand: object) -> None:
    check_departures(DemandSpec.model_validate(demand), n_lanes=n_lanes, n_opposing=n_opposing, speed=SPEED)


@pytest.mark.parametrize("tau_s", [1.0, 1.6])
def test_demand_without_end_departs_as_fast_as_the_rule_says_within_a_tenth(tmp_path: Path, tau_s: float) -> None:
    demand = DemandSpec(flow_vph=12000, truck_share=0, duration_s=120, drivers=DriverSpec(tau_s=tau_s))
    spec = SimulationSpec(demand=demand)
    open_road = paper_layout(closed_lanes=(), shift_ft=0, shifted_lane_width_ft=None)
    files = write_sumo_files(open_road, tmp_path, spec=spec, seed=5)
    outputs = ("--tripinfo-output", str(trips_file(files)), *TRIP_OPTIONS)
    run_to_end(files, options=outputs, on_second=lambda _: None)
    trips = read_trips(trips_file(files))
    entered_vph = trips["entered"].sum() * 30
    assert (~trips["entered"]).sum() > 100
    assert entered_vph / 3 == pytest.approx(lane_departure_vph(spec.demand, speed=SPEED), rel=0.1)


def test_flow_that_the_lanes_take_is_accepted_and_one_beyond_is_refused_with_what_would_fit() -> None:
    check(flow_vph=6750)
    with pytest.raises(SpecError, match=r"flow_vph=7000: lane 1 would get 2567 veh/h, .* at most 2494 .* at most 6802 veh/h"):
        # Trucks, a tenth, keep out of the left lane: lane 1 gets 11/30 of all. Headways of 1 s + 7.3 m and 1 s + 14.5 m.
        check(flow_vph=7000)


def test_uneven_lane_use_is_refused_at_a_flow_that_even_lanes_would_take() -> None:
    check(flow_vph=3500)
    with pytest.raises(SpecError, match="lane 0 would get 2800 veh/h"):
        check(flow_vph=3500, lane_use=(0.8, 0.1, 0.1))


def test_lane_use_of_another_number_of_lanes_is_refused_with_both() -> None:
    with pytest.raises(SpecError, match=r"lane_use=\(0\.5, 0\.5\) has 2 shares, the road lane_count=3"):
        check(lane_use=(0.5, 0.5))


def test_greatest_flow_of_a_profile_decides() -> None:
    with pytest.raises(SpecError, match="flow_profile=7000"):
        check(flow_profile=((0, 500), (60, 7000), (120, 500)))


def test_opposing_flow_has_its_own_lanes() -> None:
    check(flow_vph=1000, opposing_flow_vph=1000, n_lanes=1, n_opposing=1)
    with pytest.raises(SpecError, match="opposing_flow_vph=3000"):
        check(flow_vph=1000, opposing_flow_vph=3000, n_lanes=1, n_opposing=1)
