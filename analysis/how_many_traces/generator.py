"""Zones and traces in closed form, which share nothing with SUMO or with `wzsumo.mutcd`: a second opinion on the crowd map.

A zone is a road of constant curvature. Its lanes on one side end at a merging taper and open again at a downstream taper; the
other lanes may be shifted away from the work. Drivers keep to their lanes with a slow sway. Drivers in a lane that ends leave
it at a random place ahead of the devices, in some zones inside the taper too. All lengths are in metres.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.frames import FloatArray
from wzsumo.sensing.gnss import GnssSpec, report

FOOT_M, MPH_MPS = 0.3048, 0.44704
HALF_VEHICLE_WIDTH_M = 0.93
LEAST_DEVICE_GAP_M = 0.3  # from a merging vehicle's side to the devices; chosen by us
# Of another make than wzsumo.sensing.gnss on purpose: the slow part of the error changes faster and is larger.
GNSS_SHARES = {"bias_sd_m": 0.75, "correlated_sd_m": 0.20, "white_sd_m": 0.05}  # of the variance
GNSS_CORRELATION_TIME_S = 40.0


@dataclass(frozen=True, kw_only=True)
class GeneratedZone:
    """One zone: `open_lanes` beside `closed_lanes`; `shift` [m] away from the work; `radius` [m], positive to the left."""

    open_lanes: int
    closed_lanes: int = 1
    closed_left: bool = True
    width_ft: float = 12.0
    speed_mph: float = 60.0
    shift: float = 0.0
    tangent: bool = True  # whether a tangent of L/2 lies between the merging and the shifting taper
    activity: float = 200.0
    radius: float = np.inf
    approach: float = 150.0
    sway: float = 0.25  # standard deviation of a driver's place in the lane; half of its variance stays for the whole trace
    merging_inside_taper: bool = True  # whether some drivers leave the closing lane as late as in its taper

    @property
    def width(self) -> float:
        """Width [m] of a lane."""
        return self.width_ft * FOOT_M

    @property
    def merging_taper(self) -> float:
        """Length [m] of the taper of one lane: W S, from 45 mph (MUTCD 11th ed., Table 6B-4)."""
        return self.width * self.speed_mph

    @property
    def stations(self) -> dict[str, float]:
        """Stations [m] at which the parts of the zone begin and end."""
        taper = self.approach
        merged = taper + self.merging_taper * self.closed_lanes
        shift_m = self.shift * self.speed_mph / 2
        shifting = merged + (self.merging_taper / 2 if self.shift and self.tangent else 0.0)
        work = shifting + shift_m
        back = work + self.activity
        opening = back + shift_m
        end = opening + 30.48 * self.closed_lanes
        return {
            "taper": taper,
            "merged": merged,
            "shifting": shifting,
            "work": work,
            "back": back,
            "opening": opening,
            "end": end,
        }

    @property
    def length(self) -> float:
        """Length [m] of the traces."""
        return self.stations["end"] + 60.0

    def moved(self, s: FloatArray) -> FloatArray:
        """How far the open lanes are moved (n,) [m] at stations s, positive away from the work."""
        at = self.stations
        stations = [at["shifting"], at["work"], at["back"], at["opening"]]
        return np.asarray(np.interp(s, stations, [0.0, self.shift, self.shift, 0.0]))

    def open_width(self, s: FloatArray) -> FloatArray:
        """Width (n,) [m] between the open side's edge line and the devices, or the outer edge line."""
        at, through = self.stations, self.open_lanes * self.width
        full = through + self.closed_lanes * self.width
        return np.asarray(np.interp(s, [at["taper"], at["merged"], at["opening"], at["end"]], [full, through, through, full]))

    def edges(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Right and left edge (n,) [m] of the free area at stations s, offsets to the left of the undisturbed open edge."""
        inner = -self.moved(s)
        outer = inner + self.open_width(s)
        return (inner, outer) if self.closed_left else (-outer, -inner)

    def to_xy(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """Points (n, 2) [m] at stations s and offsets d (n,) [m]."""
        if np.isinf(self.radius):
            return np.column_stack([s, d])
        turn = s / self.radius
        return np.column_stack([(self.radius - d) * np.sin(turn), self.radius - (self.radius - d) * np.cos(turn)])


def generated_traces(zone: GeneratedZone, n: int, *, error_m: float, interval_s: float, seed: int) -> pd.DataFrame:
    """What n vehicles report: a trace table. The first of more vehicles are the same vehicles."""
    tables = [_vehicle(zone, number, np.random.default_rng([seed, number])) for number in range(n)]
    parts = {part: error_m * np.sqrt(share) for part, share in GNSS_SHARES.items()}
    spec = GnssSpec(**parts, correlation_time_s=GNSS_CORRELATION_TIME_S, sampling_interval_s=interval_s)
    return report(pd.concat(tables, ignore_index=True), spec=spec, seed=seed)


def _vehicle(zone: GeneratedZone, number: int, random: np.random.Generator) -> pd.DataFrame:
    """True fixes of one vehicle every 0.1 s; lanes count from the open side's edge."""
    speed = zone.speed_mph * MPH_MPS * random.normal(0.97, 0.06)
    time = np.arange(0.0, zone.length / speed, 0.1)
    s = speed * time
    lanes = zone.open_lanes + zone.closed_lanes
    lane, goal = int(random.integers(lanes)), int(random.integers(zone.open_lanes))
    lateral = _in_lane(zone, float(lane), s)
    if lane >= zone.open_lanes:
        lateral = _merged(zone, lane, goal, s, random)
    lateral = lateral + _sway(zone, s, random)
    d = lateral if zone.closed_left else -lateral
    xy = zone.to_xy(s, d)
    return pd.DataFrame({"vehicle_id": f"v{number}", "time_s": 1.7 * number + time, "x_m": xy[:, 0], "y_m": xy[:, 1]})


def _in_lane(zone: GeneratedZone, lane: float | FloatArray, s: FloatArray) -> FloatArray:
    """Offsets (n,) [m] of the middle of a lane at stations s, from the open side's edge."""
    return (lane + 0.5) * zone.width - zone.moved(s)


def _merged(zone: GeneratedZone, lane: int, goal: int, s: FloatArray, random: np.random.Generator) -> FloatArray:
    """Offsets (n,) [m] of a vehicle that leaves a closing lane at a random place, earlier where the devices ask for it."""
    duration = random.uniform(60.0, 110.0) * (lane - goal)
    latest = zone.stations["merged" if zone.merging_inside_taper else "taper"]
    start = random.uniform(-0.5 * zone.approach, latest)
    while True:
        t = np.clip((s - start) / duration, 0.0, 1.0)
        lateral = _in_lane(zone, lane + (goal - lane) * t * t * (3 - 2 * t), s)
        if (lateral + HALF_VEHICLE_WIDTH_M + LEAST_DEVICE_GAP_M < zone.open_width(s) - zone.moved(s))[
            s < zone.stations["opening"]
        ].all():
            return lateral
        start -= 10.0


def _sway(zone: GeneratedZone, s: FloatArray, random: np.random.Generator) -> FloatArray:
    """A driver's offset from the lane's middle (n,) [m]: a constant habit and a Gauss-Markov series of 60 m about it."""
    keep = np.exp(-np.diff(s, prepend=s[0]) / 60.0)
    series = np.empty(len(s))
    value = random.standard_normal()
    for i, (rho, new) in enumerate(zip(keep, random.standard_normal(len(s)), strict=True)):
        value = rho * value + np.sqrt(1 - rho * rho) * new
        series[i] = value
    return np.asarray(zone.sway * np.sqrt(0.5) * (random.standard_normal() + series))


GENERATED = {
    "g1_straight": GeneratedZone(open_lanes=1, sway=0.25),
    "g1_bend": GeneratedZone(open_lanes=1, width_ft=11.0, speed_mph=50, radius=500.0, shift=2.4, sway=0.3),
    "g2_straight": GeneratedZone(open_lanes=2, shift=3.0, tangent=False, speed_mph=65),
    "g2_bend": GeneratedZone(open_lanes=2, closed_left=False, width_ft=11.0, speed_mph=45, radius=-400.0, sway=0.35),
    "g2_none_inside": GeneratedZone(open_lanes=2, merging_inside_taper=False, radius=900.0, speed_mph=70, approach=300.0),
    "g1_two_closed": GeneratedZone(open_lanes=1, closed_lanes=2, closed_left=False, speed_mph=55, width_ft=11.5),
    "g3_straight": GeneratedZone(open_lanes=3, width_ft=11.0, speed_mph=55, sway=0.2),
    "g1_narrow": GeneratedZone(open_lanes=1, width_ft=10.0, speed_mph=45, radius=300.0, shift=2.0, sway=0.2),
}  # fmt: skip
