"""How many vehicles an hour SUMO can insert on a road, so that a larger demand is refused before anything runs."""

import math

import numpy as np

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.simulation.demand import CAR, TRUCK, DemandSpec
from wzsumo.units import mph_from_mps

# Share of the flow at the drivers' own headway that SUMO inserts: it inserts a vehicle at the mean speed of its lane and keeps
# its gap. Measured with unlimited demand over 120 s on three lanes at 60 mph: 0.90 (tau 1 s), 0.92 (tau 1.6 s).
INSERTED_SHARE = 0.9


def check_departures(spec: DemandSpec, *, n_lanes: int, n_opposing: int, speed: float) -> None:
    """Raise SpecError where more vehicles are due than can depart on the lanes of their direction at `speed` [m/s].

    Also where `lane_use` is for another number of lanes.
    """
    if spec.lane_use and len(spec.lane_use) != n_lanes:
        raise SpecError(
            f"simulation.demand.lane_use={spec.lane_use} has {len(spec.lane_use)} shares, the road lane_count={n_lanes}; give "
            "one a lane, from the right"
        )
    flows = [flow for _, flow in spec.flow_profile] or [spec.flow_vph]
    key = "flow_profile" if spec.flow_profile else "flow_vph"
    _check_flow(max(flows), key, _shares(spec, n_lanes), spec=spec, speed=speed)
    if n_opposing:
        even = _shares(spec.model_copy(update={"lane_use": ()}), n_opposing)
        _check_flow(spec.opposing_flow_vph, "opposing_flow_vph", even, spec=spec, speed=speed)


def lane_departure_vph(spec: DemandSpec, *, speed: float) -> float:
    """Vehicles an hour [veh/h] that can depart on one lane at `speed` [m/s]."""
    drivers, p = spec.drivers, spec.truck_share
    car = drivers.tau_s + (CAR["length_m"] + drivers.min_gap_m) / speed
    truck = drivers.truck_tau_s + (TRUCK["length_m"] + drivers.min_gap_m) / speed
    return INSERTED_SHARE * 3600 / ((1 - p) * car + p * truck)


def _check_flow(flow: float, key: str, shares: FloatArray, *, spec: DemandSpec, speed: float) -> None:
    lane, fits, drivers = int(np.argmax(shares)), lane_departure_vph(spec, speed=speed), spec.drivers
    if flow * shares[lane] > fits:
        raise SpecError(
            f"simulation.demand.{key}={flow:g}: lane {lane} would get {flow * shares[lane]:.0f} veh/h, but drivers with "
            f"tau_s={drivers.tau_s:g} can depart on it at most {fits:.0f} times an hour at {mph_from_mps(speed):.0f} mph; "
            f"give at most {math.floor(fits / shares[lane])} veh/h, or use the lanes more evenly, or add lanes"
        )


def _shares(spec: DemandSpec, n_lanes: int) -> FloatArray:
    """Shares (n_lanes,) of vehicles by lane from the right; trucks keep out of the left lane of three or more."""
    shares = np.array(spec.lane_use or (1 / n_lanes,) * n_lanes)
    if n_lanes > 2:
        moved = spec.truck_share * shares[-1]
        shares[-2:] += (moved, -moved)
    return shares
