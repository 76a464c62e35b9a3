"""How the drivers of a fleet follow and merge: SUMO vType parameters, and those that were fitted to the HCM.

A fit holds for the step length and the lateral resolution that it was made with and for nothing else: 0.1 s instead of 0.5 s
moves the queue discharge by 9 %, the sublane model by 37 % (SUMO 1.28). Fitted drivers therefore name both.
"""

from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from wzsumo.capacity import TRUCK_EQUIVALENT_PC, SiteSpec, zone_queue_discharge_pcphpl
from wzsumo.spec import Spec


class DriverSpec(Spec):
    """Parameters of SUMO's Krauss and SL2015 models. What is not here keeps SUMO's default."""

    name: str = "own"
    tau_s: float = Field(1.0, gt=0, le=10)  # SUMO's default; net time gap that a driver keeps
    accel_mps2: float = Field(2.6, gt=0, le=10)  # SUMO's default for passenger cars
    truck_tau_s: float = Field(1.0, gt=0, le=10)
    truck_accel_mps2: float = Field(1.0, gt=0, le=10)  # loaded truck
    sigma: float = Field(0.5, ge=0, le=1)  # SUMO's default; dawdling
    lc_assertive: float = Field(1.0, gt=0, le=10)  # SUMO's default; above 1: takes gaps that are that much smaller
    lc_lookahead_left: float = Field(
        2.0, gt=0, le=10
    )  # SUMO's default; 1: merges to the left begin no earlier than to the right
    calibrated_step_length_s: float | None = None  # None: not calibrated, goes with any
    calibrated_lateral_resolution_m: float | None = None


UNCALIBRATED = DriverSpec(name="uncalibrated")
# Who drives is decided by what the HCM lets the scenario's zone discharge: `hcm_drivers` makes them of that.
BY_THE_HCM = DriverSpec(name="hcm", calibrated_step_length_s=0.1, calibrated_lateral_resolution_m=0.45)


@dataclass(frozen=True, kw_only=True)
class _Rest:
    """Of the mean headway in which a queue discharges, what is not the driver's own time gap [s], and how cars accelerate.

    It is the vehicle and its standing gap at the speed of the bottleneck, acceleration, dawdling. Low accelerations make the
    capacity drop: what a queue discharges falls with them, what passes before there is one does not. Fitted by hand;
    docs/results/traffic_calibration.md has on what, and how well it holds.
    """

    car_s: float
    accel_mps2: float
    truck_accel_mps2: float = 0.7


_TWO_INTO_ONE = _Rest(car_s=0.88, accel_mps2=0.9)
_MORE_INTO_ONE = _Rest(car_s=1.03, accel_mps2=0.65)
_INTO_MORE = _Rest(car_s=1.14, accel_mps2=0.5, truck_accel_mps2=0.5)
_TRUCK_REST_S = 1.22  # fitted in one class, 2-to-1 urban, ibid.


def hcm_drivers(discharge_pcphpl: float, *, total_lanes: int, open_lanes: int, name: str = BY_THE_HCM.name) -> DriverSpec:
    """Drivers of whom a queue discharges so many passenger cars an hour and lane [pc/h/lane] past a closure."""
    into_one = _TWO_INTO_ONE if total_lanes == 2 else _MORE_INTO_ONE
    rest = into_one if open_lanes == 1 else _INTO_MORE
    headway_s = 3600 / discharge_pcphpl
    fitted = {
        "name": name, "tau_s": round(headway_s - rest.car_s, 3), "accel_mps2": rest.accel_mps2,
        "truck_tau_s": round(TRUCK_EQUIVALENT_PC * headway_s - _TRUCK_REST_S, 3), "truck_accel_mps2": rest.truck_accel_mps2,
        "lc_assertive": 1.3, "lc_lookahead_left": 1.0,
    }  # fmt: skip
    return BY_THE_HCM.model_copy(update=fitted)


def _class_drivers(total: int, open_lanes: int, area: Literal["urban", "rural"]) -> DriverSpec:
    rate = zone_queue_discharge_pcphpl(total_lanes=total, open_lanes=open_lanes, site=SiteSpec(area=area))
    return hcm_drivers(rate, total_lanes=total, open_lanes=open_lanes, name=f"hcm_{total}_to_{open_lanes}_{area}")


_AREAS: tuple[Literal["urban", "rural"], ...] = ("urban", "rural")
_CLASSES = [_class_drivers(total, open_, area) for total, open_ in ((2, 1), (3, 2), (3, 1)) for area in _AREAS]
DRIVER_PRESETS = {drivers.name: drivers for drivers in (UNCALIBRATED, BY_THE_HCM, *_CLASSES)}
