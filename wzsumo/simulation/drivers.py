"""How the drivers of a fleet follow and merge: SUMO vType parameters, and the sets that were fitted to the HCM.

A fit holds for the step length and the lateral resolution that it was made with and for nothing else: 0.1 s instead of 0.5 s
moves the queue discharge by 9 %, the sublane model by 37 % (SUMO 1.28). A set therefore names both.
"""

from pydantic import Field

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
    calibrated_step_length_s: float | None = None  # None: not calibrated, goes with any
    calibrated_lateral_resolution_m: float | None = None


UNCALIBRATED = DriverSpec(name="uncalibrated")
# Fitted by hand on seeds 101-104, 211 and 212 of analysis/calibrate_traffic.py; docs/traffic_calibration.md has what they
# discharge on others. Trucks: tau 2.4 times a car's, from a fit at 0.5 s steps without sublanes; not measured here.
HCM_2_TO_1_URBAN = DriverSpec(
    name="hcm_2_to_1_urban",
    tau_s=1.48,
    accel_mps2=1.05,
    truck_tau_s=3.55,
    truck_accel_mps2=0.7,
    lc_assertive=1.3,
    calibrated_step_length_s=0.1,
    calibrated_lateral_resolution_m=0.45,
)
DRIVER_PRESETS = {preset.name: preset for preset in (UNCALIBRATED, HCM_2_TO_1_URBAN)}
