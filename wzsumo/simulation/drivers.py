"""How the drivers of a fleet follow and merge: SUMO vType parameters, and those that were fitted to the HCM.

A fit holds for the step length and the lateral resolution that it was made with and for nothing else: 0.1 s instead of 0.5 s
moves the queue discharge by 9 %, the sublane model by 37 % (SUMO 1.28). Fitted drivers therefore name both.
"""

from pydantic import Field

from wzsumo.capacity import TRUCK_EQUIVALENT_PC, SiteSpec, lane_closure_severity_index, queue_discharge_rate
from wzsumo.errors import SpecError
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
# What the rule below was fitted and tested between, pc/h and lane: one lane open in a rural zone, two of three in an urban one.
HCM_DISCHARGE_PCPHPL = (1412.0, 1783.5)
# Of the mean headway in which a queue discharges, what is not the driver's own time gap: vehicle and standing gap at the speed
# of the bottleneck, acceleration, dawdling. Fitted by hand; docs/traffic_calibration.md has on what, and how well it holds.
_CAR_REST_S, _TRUCK_REST_S = 0.78, 1.22


def hcm_drivers(discharge_pcphpl: float, *, name: str = BY_THE_HCM.name) -> DriverSpec:
    """Drivers of whom a queue discharges so many passenger cars an hour and lane through a zone [pc/h/lane].

    Raises SpecError where that lies beyond what was fitted.
    """
    low, high = HCM_DISCHARGE_PCPHPL
    if not low <= discharge_pcphpl <= high:
        raise SpecError(
            f"the HCM lets this zone discharge {discharge_pcphpl:.0f} pc/h and lane, and drivers are fitted to "
            f"{low:.0f} to {high:.0f} (one lane open of two or three, or two of three, by day, behind cones or drums); give "
            f'drivers = "{UNCALIBRATED.name}", one of {", ".join(_CLASSES)}, or a table of your own'
        )
    headway_s = 3600 / discharge_pcphpl
    fitted = {
        "name": name, "tau_s": round(headway_s - _CAR_REST_S, 3), "accel_mps2": 1.05,
        "truck_tau_s": round(TRUCK_EQUIVALENT_PC * headway_s - _TRUCK_REST_S, 3), "truck_accel_mps2": 0.7,
        "lc_assertive": 1.3, "lc_lookahead_left": 1.0,
    }  # fmt: skip
    return BY_THE_HCM.model_copy(update=fitted)


_CLASSES = {
    f"hcm_{total}_to_{open_}_{area}": queue_discharge_rate(
        severity=lane_closure_severity_index(total_lanes=total, open_lanes=open_), site=SiteSpec.model_validate({"area": area})
    )
    for total, open_ in ((2, 1), (3, 2), (3, 1))
    for area in ("urban", "rural")
}
DRIVER_PRESETS = {drivers.name: drivers for drivers in (UNCALIBRATED, BY_THE_HCM)} | {
    name: hcm_drivers(rate, name=name) for name, rate in _CLASSES.items()
}
