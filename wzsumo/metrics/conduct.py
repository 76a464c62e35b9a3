"""Conduct: how a drive was driven, beside where it ended, held against limits that the literature states.

A drive is clean where it reached its goal within all limits. What it did outside them are its faults, one sentence each.
"""

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from wzsumo.ego import EgoRun, Outcome
from wzsumo.frames import FloatArray
from wzsumo.metrics.clearance import Clearance
from wzsumo.metrics.drive import STANDSTILL_MPS, mean_change
from wzsumo.metrics.lane_keeping import LaneKeeping, measure_lane_keeping
from wzsumo.metrics.neighbours import PathNeighbours, neighbours_on_path
from wzsumo.spec import Spec
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

MIN_STOP_S = 0.5  # a shorter standstill is none; the time over which accelerations are means
QUEUE_GAP_M = 15.0  # two places in a standing queue of cars (7.5 m each, HCM): a vehicle that stands nearer is a reason to stop
QUEUE_SPEED_MPS = 2.2  # a vehicle ahead that is slower belongs to a queue; 5 mph, FHWA Traffic Analysis Toolbox VI
STOP_LINE_REACH_M = 30.0  # an ego that stands so near before a stop line waits there, four places of a queue


class ConductLimits(Spec):
    """The limits of a clean drive, each with its source."""

    max_unprompted_stops: int = Field(default=0, ge=0)  # Uniform Vehicle Code 11-805: no impeding of the normal movement
    max_braking_mps2: float = Field(default=3.4, gt=0)  # AASHTO Green Book: 11.2 ft/s2, comfortable for most drivers
    max_braking_behind_mps2: float = Field(default=4.0, gt=0)  # b_safe of MOBIL, Kesting, Treiber & Helbing 2007
    comfortable_braking_mps2: float = Field(
        default=2.0, gt=0
    )  # b of the ACC of Kesting, Treiber & Helbing 2010; told, no limit
    jerk_slow_mps3: float = Field(default=5.0, gt=0)  # ISO 15622: mean over 1 s, at 5 m/s and below;
    jerk_fast_mps3: float = Field(default=2.5, gt=0)  # ibid.: at 20 m/s and above, linear in between
    # Half of a lane change of 4.6 s (Toledo & Zohar 2007, mean) is spent over the line: 62 m at 60 mph, of a zone of 1000 m.
    max_over_line_share: float = Field(default=0.06, ge=0, le=1)
    max_sd_off_middle_m: float = Field(default=0.35, gt=0)  # Brookhuis et al. 2003, Ergonomics 46: above it impaired
    max_spare_lane_changes: int = Field(default=0, ge=0)  # Uniform Vehicle Code 11-309: entirely within a single lane
    # What is beside a vehicle of the greatest legal width (23 CFR 658.15: 102 in) in the narrowest lane (MUTCD 6G: 10 ft).
    min_clearance_devices_m: float = Field(default=0.23, ge=0)
    min_clearance_road_edge_m: float = Field(default=0.23, ge=0)  # ibid.
    min_ttc_s: float = Field(default=1.5, ge=0)  # FHWA SSAM's default
    min_time_gap_s: float = Field(default=0.8, ge=0)  # smallest that an adaptive cruise control may be set to, ISO 15622

    def jerk_at(self, speeds: FloatArray) -> FloatArray:
        """Limits (n,) [m/s3] of the jerk at speeds (n,) [m/s]."""
        return np.interp(speeds, [5.0, 20.0], [self.jerk_slow_mps3, self.jerk_fast_mps3])


LIMITS = ConductLimits()


@dataclass(frozen=True, kw_only=True)
class Conduct:
    """How a drive was driven: what outcome and clearance do not say of it."""

    n_stops: int  # standstills of MIN_STOP_S or more
    n_unprompted_stops: int  # those without a queue or a stop line ahead: stops in a live lane
    unprompted_stop_s: float  # how long they lasted in all
    over_comfort_s: float  # time of braking harder than comfortable
    braking_unprompted_mps2: float  # hardest braking of the ego but where another one's emergency called for it
    braking_behind_mps2: float  # hardest braking of the vehicle right behind the ego on its path; told, no limit
    braking_asked_behind_mps2: float  # the part of it that the ego asked for, see `PathNeighbours`
    min_time_gap_s: float  # least post-encroachment time behind a vehicle that did not just come before the ego; inf: none
    min_ttc_ahead_s: float  # least time to collision with another ahead, but for the same
    max_jerk_1s_mps3: float  # change of the acceleration over 1 s
    over_jerk_s: float  # time of a jerk above the limit at the speed
    over_line_share: float  # see `LaneKeeping`, and for the next four
    mean_off_middle_m: float
    sd_off_middle_m: float
    n_lane_changes: int
    n_needed_changes: int


def measure_conduct(
    run: EgoRun, vehicle: VehicleGeometry, layout: WorkZoneLayout, *, limits: ConductLimits = LIMITS
) -> Conduct:
    """The conduct of a run with at least two rows in its log."""
    log = run.log
    time, speed = log["time_s"].to_numpy(dtype=float), log["speed_mps"].to_numpy(dtype=float)
    step = float(np.median(np.diff(time)))
    acceleration = mean_change(speed, window=max(1, round(0.5 / step))) / step
    jerk = np.abs(mean_change(acceleration, window=max(1, round(1.0 / step)))) / step
    keeping: LaneKeeping = measure_lane_keeping(run.poses, vehicle=vehicle, layout=layout)
    others = neighbours_on_path(run, vehicle, road=layout.road)
    stops = _stops(speed, least=max(1, round(MIN_STOP_S / step)))
    unprompted = [(first, last) for first, last in stops if not _has_reason(run, first, others, vehicle=vehicle, layout=layout)]
    own = acceleration[~others.emergency_at(time, braking_mps2=limits.max_braking_mps2)]
    return Conduct(
        n_stops=len(stops),
        n_unprompted_stops=len(unprompted),
        unprompted_stop_s=float(sum(time[last] - time[first] for first, last in unprompted)),
        over_comfort_s=float((acceleration < -limits.comfortable_braking_mps2).sum() * step),
        braking_unprompted_mps2=float(max(-own.min(), 0.0)) if len(own) else 0.0,
        braking_behind_mps2=others.hardest_braking_behind_mps2,
        braking_asked_behind_mps2=others.hardest_braking_asked_mps2(
            safe_mps2=limits.max_braking_behind_mps2, comfortable_mps2=limits.comfortable_braking_mps2
        ),
        min_time_gap_s=others.min_time_gap_s,
        min_ttc_ahead_s=others.min_ttc_ahead_s,
        max_jerk_1s_mps3=float(jerk.max()),
        over_jerk_s=float((jerk > limits.jerk_at(speed)).sum() * step),
        **vars(keeping),
    )


def faults_of(outcome: Outcome, conduct: Conduct, clearance: Clearance, *, limits: ConductLimits = LIMITS) -> tuple[str, ...]:
    """What keeps a drive from being clean, a few words each with figure and limit; empty for a clean one."""
    spare = conduct.n_lane_changes - conduct.n_needed_changes
    at_most = (
        (
            conduct.n_unprompted_stops,
            limits.max_unprompted_stops,
            f"stopped in a live lane for {conduct.unprompted_stop_s:.1f} s",
        ),
        (conduct.braking_unprompted_mps2, limits.max_braking_mps2, f"braked {conduct.braking_unprompted_mps2:.1f} m/s2"),
        (
            conduct.braking_asked_behind_mps2,
            limits.max_braking_behind_mps2,
            f"the one behind had to brake {conduct.braking_asked_behind_mps2:.1f} m/s2",
        ),
        (
            conduct.over_jerk_s,
            0.0,
            f"jerk {conduct.max_jerk_1s_mps3:.1f} m/s3, for {conduct.over_jerk_s:.1f} s above ISO 15622's",
        ),
        (conduct.over_line_share, limits.max_over_line_share, f"over a line for {conduct.over_line_share:.0%} of the zone"),
        (
            conduct.sd_off_middle_m,
            limits.max_sd_off_middle_m,
            f"wove by {conduct.sd_off_middle_m:.2f} m about its lane's middle",
        ),
        (
            spare,
            limits.max_spare_lane_changes,
            f"changed lanes {conduct.n_lane_changes} times where {conduct.n_needed_changes} were needed",
        ),
    )
    devices, edge = clearance.min_clearance_devices_m, clearance.min_clearance_road_edge_m
    at_least = (
        (devices, limits.min_clearance_devices_m, f"{devices:.2f} m beside a device"),
        (edge, limits.min_clearance_road_edge_m, f"{edge:.2f} m beside the pavement's edge"),
        (conduct.min_ttc_ahead_s, limits.min_ttc_s, f"time to collision {conduct.min_ttc_ahead_s:.1f} s"),
        (conduct.min_time_gap_s, limits.min_time_gap_s, f"time gap {conduct.min_time_gap_s:.1f} s"),
    )
    return (
        *(() if outcome == Outcome.REACHED_GOAL else (str(outcome),)),
        *(f"{words} (limit {limit:g})" for value, limit, words in at_most if value > limit),
        *(f"{words} (limit {limit:g})" for value, limit, words in at_least if value < limit),
    )


def _stops(speed: FloatArray, *, least: int) -> list[tuple[int, int]]:
    """First and last row of each standstill of `least` rows or more."""
    stands = np.concatenate([[False], speed < STANDSTILL_MPS, [False]]).astype(int)
    ends = np.flatnonzero(np.diff(stands))
    return [(int(a), int(b) - 1) for a, b in zip(ends[::2], ends[1::2], strict=True) if b - a >= least]


def _has_reason(run: EgoRun, row: int, others: PathNeighbours, *, vehicle: VehicleGeometry, layout: WorkZoneLayout) -> bool:
    """Whether the ego that comes to a stand in a row of its log has a queue or a stop line before it."""
    if others.queue_ahead(float(run.log["time_s"].iloc[row]), gap_m=QUEUE_GAP_M, speed_mps=QUEUE_SPEED_MPS):
        return True
    if layout.taking_turns is None:
        return False
    (station,), _ = layout.road.to_sd(run.poses[row, :2])
    to_line = layout.taking_turns.start - (float(station) + vehicle.axle_to_bumper_m)
    return -vehicle.length_m < to_line < STOP_LINE_REACH_M
