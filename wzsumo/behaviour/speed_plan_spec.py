"""SpeedPlanSpec: the parameters of how the ego minds others."""

from pydantic import Field

from wzsumo.spec import Spec


class SpeedPlanSpec(Spec):
    """How the ego minds others: what it keeps from them, what it may ask of them, what it finds comfortable."""

    time_gap_s: float = Field(default=1.5, gt=0)  # behind another; T of Kesting, Treiber & Helbing 2010, Table 1
    standstill_gap_m: float = Field(default=2.0, gt=0)  # s0, ibid.
    acceleration_mps2: float = Field(default=1.4, gt=0)  # a, ibid.
    comfortable_deceleration_mps2: float = Field(default=2.0, gt=0)  # b, ibid.
    side_margin_m: float = Field(default=0.5, ge=0)  # less beside another is in its way; they keep 0.3 m and move by 0.2 m
    reaction_time_s: float = Field(default=1.0, ge=0)  # of those behind; SUMO's default tau
    safe_deceleration_mps2: float = Field(default=4.0, gt=0)  # asked of those behind; b_safe of MOBIL, Kesting et al. 2007
    emergency_deceleration_mps2: float = Field(default=9.0, gt=0)  # asked where it is too late to wait; SUMO's emergencyDecel
    response_s: float = Field(default=0.3, ge=0)  # of the car to its pedals; Rajamani 2012, Section 5.3
    # Costs: the unit is (1 m/s2)^2 for a second.
    jerk_cost: float = Field(default=0.15, ge=0)  # of (1 m/s3)^2 for a second; Werling et al. weigh comfort and time alike
    delay_cost: float = Field(default=0.5, ge=0)  # of a metre behind the desired speed; chosen by us
    room_cost: float = Field(default=20.0, ge=0)  # of a gap that lacks all that is wished, for a second; chosen by us
