"""The vehicles right ahead of the ego and right behind it on its path, at the times of the log of the surrounding traffic."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wzsumo.ego import EgoRun
from wzsumo.frames import BoolArray, FloatArray, IntArray, advance
from wzsumo.metrics.drive import CLOCK_S, mean_change, on_clock
from wzsumo.road import Road
from wzsumo.vehicle import VehicleGeometry

BRAKING_WINDOW = 5  # steps of CLOCK_S over which the acceleration of others is a mean: 0.5 s, as for the ego's
CUT_IN_RECOVERY_S = 5.0  # a vehicle that came before the ego just now may be nearer; the gap is opened gently; chosen by us
EMERGENCY_HOLDS_S = 2.5  # an emergency ahead is one for the ego for so long: reaction time of AASHTO Green Book


@dataclass(frozen=True, kw_only=True, eq=False)
class PathNeighbours:
    """Neighbours at times (n,); inf and nan where there is none."""

    time: FloatArray  # s
    gap_ahead: FloatArray  # m, from the ego's front bumper to the rear of the one ahead
    speed_ahead: FloatArray  # m/s
    braking_ahead: FloatArray  # m/s2
    needed_ahead: FloatArray  # m/s2 by which the ego must brake to keep off, where another vehicle came before it just now
    time_gap_ahead: FloatArray  # s, to one that has been ahead for CUT_IN_RECOVERY_S; so for the next
    ttc_ahead: FloatArray  # s, time to collision
    braking_behind: FloatArray  # m/s2
    needed_behind: FloatArray  # m/s2 by which the one behind had to brake when it came to be behind the ego
    own_braking: FloatArray  # m/s2, of the ego

    @property
    def hardest_braking_behind_mps2(self) -> float:
        """Hardest braking of the vehicle right behind; 0 where there was none."""
        return float(np.nanmax(np.append(self.braking_behind, 0.0)))

    def hardest_braking_asked_mps2(self, *, safe_mps2: float, comfortable_mps2: float) -> float:
        """Hardest braking of the vehicle right behind that the ego asked of it; 0 where there was none.

        It asked for it where it came before the other with less room than for braking with `safe_mps2`, or itself braked
        harder than `comfortable_mps2` within EMERGENCY_HOLDS_S before. Who has had room and brakes late does so by choice.
        """
        braked = np.where(self.own_braking > comfortable_mps2, self.time, -np.inf)
        lately = self.time - np.maximum.accumulate(braked) <= EMERGENCY_HOLDS_S if len(self.time) else np.empty(0, dtype=bool)
        asked = self.braking_behind[lately | (self.needed_behind > safe_mps2)]
        return float(np.nanmax(np.append(asked, 0.0)))

    @property
    def min_time_gap_s(self) -> float:
        """Least time gap that the ego kept; inf where it followed nobody."""
        return float(np.nanmin(np.append(self.time_gap_ahead, np.inf)))

    @property
    def min_ttc_ahead_s(self) -> float:
        """Least time to collision with the one ahead; inf where the ego never closed in on anybody."""
        return float(np.nanmin(np.append(self.ttc_ahead, np.inf)))

    def queue_ahead(self, time_s: float, *, gap_m: float, speed_mps: float) -> bool:
        """Whether at that time a vehicle ahead is nearer than a gap and slower than a speed."""
        if not len(self.time):
            return False
        at = int(np.argmin(np.abs(self.time - time_s)))
        return bool(self.gap_ahead[at] < gap_m and self.speed_ahead[at] < speed_mps)

    def emergency_at(self, times_s: FloatArray, *, braking_mps2: float) -> BoolArray:
        """Whether (m,) the one ahead braked harder than that within EMERGENCY_HOLDS_S, or cut in so that the ego had to."""
        began = self.time[(self.braking_ahead > braking_mps2) | (self.needed_ahead > braking_mps2)]
        since = times_s[:, None] - began[None, :]
        return np.asarray(((since >= 0) & (since <= EMERGENCY_HOLDS_S)).any(axis=1))


def neighbours_on_path(run: EgoRun, vehicle: VehicleGeometry, *, road: Road) -> PathNeighbours:
    """The neighbours of the ego on the path that it drove, which goes on beyond both ends beside the road's line."""
    log = run.log[on_clock(run.log["time_s"])]
    centres = advance(log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float), vehicle.axle_to_centre_m)
    station, offset = road.to_sd(centres[:, :2])
    driven = np.maximum.accumulate(station)
    ticks = np.round(log["time_s"].to_numpy() / CLOCK_S).astype(int)
    rows = {tick: row for row, tick in enumerate(ticks)}
    n = len(ticks)
    gap_ahead, gap_behind = np.full(n, np.inf), np.full(n, np.inf)
    speed_ahead, braking_ahead, needed_ahead, braking_behind = (np.full(n, np.nan) for _ in range(4))
    speed_behind = np.full(n, np.nan)
    id_ahead, id_behind = np.full(n, "", dtype=object), np.full(n, "", dtype=object)
    speeds = log["speed_mps"].to_numpy(dtype=float)
    for name, trace in run.traffic.groupby("vehicle_id"):
        at = np.array([rows.get(tick, -1) for tick in np.round(trace["time_s"].to_numpy() / CLOCK_S).astype(int)])
        s, d = road.to_sd(trace[["x_m", "y_m"]].to_numpy())
        speed = trace["speed_mps"].to_numpy(dtype=float)
        braking = -mean_change(speed, window=BRAKING_WINDOW) / CLOCK_S
        room = (trace["width_m"].to_numpy() + vehicle.width_m) / 2
        half = (trace["length_m"].to_numpy() + vehicle.length_m) / 2
        on_path = (np.abs(d - np.interp(s, driven, offset)) < room) & (at >= 0)
        along = s - station[at]
        for which in np.flatnonzero(on_path):
            row, gap = at[which], abs(along[which]) - half[which]
            if along[which] > 0 and gap < gap_ahead[row]:
                gap_ahead[row], speed_ahead[row], braking_ahead[row] = gap, speed[which], braking[which]
                id_ahead[row] = name
            elif along[which] <= 0 and gap < gap_behind[row]:
                gap_behind[row], braking_behind[row], speed_behind[row] = gap, braking[which], speed[which]
                id_behind[row] = name
    came = np.append(False, (id_ahead[1:] != id_ahead[:-1]) & np.isfinite(gap_ahead[1:]) & (gap_ahead[1:] < gap_ahead[:-1]))
    since = _first_of_run(id_ahead)
    settled = np.isfinite(gap_ahead) & (np.arange(n) - since >= CUT_IN_RECOVERY_S / CLOCK_S)
    closing = np.maximum(speeds - speed_ahead, 0.0)
    needed_ahead[came] = (closing**2 / (2 * np.maximum(gap_ahead, 0.1)))[came]
    needed_behind = np.maximum(speed_behind - speeds, 0.0) ** 2 / (2 * np.maximum(gap_behind, 0.1))
    gap = np.maximum(gap_ahead, 0.0)
    return PathNeighbours(
        time_gap_ahead=np.where(settled, gap / np.maximum(speeds, 1e-6), np.nan),
        ttc_ahead=np.where(settled & (closing > 0), gap / np.maximum(closing, 1e-6), np.nan),
        time=ticks * CLOCK_S, gap_ahead=gap_ahead, speed_ahead=speed_ahead, braking_ahead=braking_ahead,
        needed_ahead=needed_ahead, braking_behind=braking_behind, needed_behind=needed_behind[_first_of_run(id_behind)],
        own_braking=-mean_change(speeds, window=BRAKING_WINDOW) / CLOCK_S,
    )  # fmt: skip


def _first_of_run(names: npt.NDArray[np.object_]) -> IntArray:
    """For each row (n,) the first row of the run of equal names that it belongs to."""
    changed = np.append(True, names[1:] != names[:-1])[: len(names)]
    return np.asarray(np.maximum.accumulate(np.where(changed, np.arange(len(names)), 0)))
