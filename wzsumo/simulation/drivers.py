"""Drivers as parameters of SUMO's vehicle types, and the drivers that were fitted to the HCM's queue discharge.

A fit holds only for the step length and the lateral resolution that it was made with: a step of 0.1 s instead of 0.5 s changes
the queue discharge by 9 %, the sublane model by 37 % (SUMO 1.28). Fitted drivers therefore name both.
"""

from typing import Literal

from pydantic import Field

from wzsumo.capacity import TRUCK_EQUIVALENT_PC, SiteSpec, zone_queue_discharge_pcphpl
from wzsumo.spec import Spec


class DriverSpec(Spec):
    """Parameters of SUMO's Krauss and SL2015 models. What is not here keeps SUMO's default."""

    name: str = "own"  # under which results tell of the drivers
    tau_s: float = Field(1.0, gt=0, le=10)  # time gap that a driver keeps; SUMO's default
    accel_mps2: float = Field(2.6, gt=0, le=10)  # SUMO's default for passenger cars
    truck_tau_s: float = Field(1.0, gt=0, le=10)  # the trucks' tau_s; SUMO's default
    truck_accel_mps2: float = Field(1.0, gt=0, le=10)  # a loaded truck
    min_gap_m: float = Field(2.5, gt=0, le=10)  # between the bumpers of two vehicles that stand; SUMO's default
    sigma: float = Field(0.5, ge=0, le=1)  # dawdling; SUMO's default
    lc_assertive: float = Field(1.0, gt=0, le=10)  # a driver accepts gaps smaller by this factor; SUMO's default
    # SUMO's default: drivers look twice as far ahead for changes to the left as to the right; 1: as far.
    lc_lookahead_left: float = Field(2.0, gt=0, le=10)
    calibrated_step_length_s: float | None = None  # None: not calibrated, goes with any step length
    calibrated_lateral_resolution_m: float | None = None  # likewise


UNCALIBRATED = DriverSpec(name="uncalibrated")
# Stands for the drivers that `hcm_drivers` fits to the queue discharge of the scenario's zone.
BY_THE_HCM = DriverSpec(name="hcm", calibrated_step_length_s=0.1, calibrated_lateral_resolution_m=0.45)


# What drivers fitted to the HCM have in common.
# Cars accelerate at 1 to 2.5 m/s2 from a stand, and less the faster they drive (Long 2000, TRR 1737, Acceleration
# characteristics of starting vehicles); at freeway speeds 1 m/s2 is the low end. Trucks, heavier, less. Both chosen by us.
ACCEL_MPS2, TRUCK_ACCEL_MPS2 = 1.0, 0.6
MIN_GAP_M = 3.7  # HCM 7, Chapter 12: jam density 190 pc/mi/lane, 8.5 m a car, of which it takes 4.8 m itself
# What a queue's headway has beside the driver's own time gap, past one open lane and past each of several.
EXTRA_ONE_LANE_S, EXTRA_MORE_LANES_S = 0.95, 0.75
TRUCK_EXTRA_LENGTH_S = 7.2 / 15  # a truck is 7.2 m longer than a car; at 15 m/s, where a queue dissolves


def hcm_drivers(discharge_pcphpl: float, *, open_lanes: int, name: str = BY_THE_HCM.name) -> DriverSpec:
    """Drivers with whom a queue discharges `discharge_pcphpl` [pc/h/lane] past a closure that leaves so many lanes open.

    The mean headway of the discharging queue is the driver's own time gap and an extra: the vehicle's length and standing gap
    at the speed of the bottleneck, acceleration, dawdling and merging. Where one lane is open more of those who pass have
    merged into it. The extra is all that is fitted, by analysis/traffic/calibrate_traffic.py;
    docs/results/traffic_calibration.md says how well it holds.
    """
    headway_s = 3600 / discharge_pcphpl
    extra_s = EXTRA_ONE_LANE_S if open_lanes == 1 else EXTRA_MORE_LANES_S
    truck_tau_s = TRUCK_EQUIVALENT_PC * headway_s - extra_s - TRUCK_EXTRA_LENGTH_S
    fitted = {
        "name": name, "tau_s": round(headway_s - extra_s, 3), "accel_mps2": ACCEL_MPS2,
        "truck_tau_s": round(truck_tau_s, 3), "truck_accel_mps2": TRUCK_ACCEL_MPS2,
        "min_gap_m": MIN_GAP_M, "lc_assertive": 1.3, "lc_lookahead_left": 1.0,
    }  # fmt: skip
    return BY_THE_HCM.model_copy(update=fitted)


def _preset(total: int, open_lanes: int, area: Literal["urban", "rural"]) -> DriverSpec:
    """Drivers for a class of zones: so many of `total` lanes open, in an urban or rural area."""
    rate = zone_queue_discharge_pcphpl(total_lanes=total, open_lanes=open_lanes, site=SiteSpec(area=area))
    return hcm_drivers(rate, open_lanes=open_lanes, name=f"hcm_{total}_to_{open_lanes}_{area}")


_AREAS: tuple[Literal["urban", "rural"], ...] = ("urban", "rural")
_HCM_PRESETS = [_preset(total, open_, area) for total, open_ in ((2, 1), (3, 2), (3, 1)) for area in _AREAS]
DRIVER_PRESETS = {drivers.name: drivers for drivers in (UNCALIBRATED, BY_THE_HCM, *_HCM_PRESETS)}
