"""LaneEnds: where the lanes beside the open ones end and begin again, each as the belief about a line of devices.

Vehicles that leave a lane, shifts of the open lanes' course and the announced zone say where its line lies (`taper_line`). A
lane that begins again is the same seen against the direction of travel, with a downstream taper instead of a merging one.
"""

from dataclasses import dataclass

import numpy as np

from wzsumo.crowd_mapping.closing.taper_line import TaperLine, fit_taper_line
from wzsumo.crowd_mapping.course.shifts import Shift
from wzsumo.crowd_mapping.course.station_table import StationTable
from wzsumo.crowd_mapping.hypotheses.announcement import AnnouncedZone, TaperEndPrior
from wzsumo.crowd_mapping.hypotheses.closures import DOWNSTREAM_TAPER_M
from wzsumo.crowd_mapping.hypotheses.lane_hypotheses import MIN_TRACES_PER_LANE
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.frames import FloatArray
from wzsumo.tapers import merging_taper_m

# Share of all traces that must be seen in a lane that begins again: at 2 m of GNSS error up to 5 % of simulated traces seem to
# be in such a lane by mistake.
MIN_RETURNING_SHARE = 0.08
MAX_STATIONS_IN_CLOSURE = 3  # of a trace that is believed: the closure's ends are known to about so many stations
KINK_SLACK_M = 30.0  # by which a kink may lie ahead of the last lane change; three stations


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneEnds:
    """Lines of devices across the lanes beside the open ones, by lane as counted in `LaneLevels`.

    `closing`: where a lane ends. `opening`: where it begins again, with stations counted against the direction of travel.
    """

    closing: dict[int, TaperLine]
    opening: dict[int, TaperLine]


def fit_lane_ends(
    table: StationTable,
    weights: FloatArray,
    levels: LaneLevels,
    *,
    lanes: tuple[int, ...],
    announced: AnnouncedZone | None,
    shifts: tuple[Shift, ...],
    speed_mps: float,
    vehicle_width_m: float,
) -> LaneEnds:
    """The ends of `lanes` at a speed [m/s] that decides the tapers' lengths; `announced` is None where no zone is announced."""
    exits = _LaneExits(table, weights, levels, half_vehicle=vehicle_width_m / 2 / levels.outer_width, shifts=shifts)
    merging_length_m = merging_taper_m(speed_mps, width_m=levels.outer_width)
    min_users, min_returning = MIN_TRACES_PER_LANE * min(1.0, weights.sum()), MIN_RETURNING_SHARE * weights.sum()
    closing: dict[int, TaperLine] = {}
    opening: dict[int, TaperLine] = {}
    for lane in lanes:
        lanes_before = sum(abs(other) > abs(lane) and other * lane >= 0 for other in lanes)
        closing_prior = announced.closing_prior(lane, lanes_before=lanes_before) if announced else None
        opening_prior = announced.opening_prior(lanes_before=lanes_before) if announced else None
        if line := exits.line(lane, length=merging_length_m, sign=1, end_prior=closing_prior, min_users=min_users):
            closing[lane] = line
        if line := exits.line(lane, length=DOWNSTREAM_TAPER_M, sign=-1, end_prior=opening_prior, min_users=min_returning):
            opening[lane] = line
    return LaneEnds(closing=closing, opening=opening)


class _LaneExits:
    """How the vehicles leave the lanes that end (sign 1), and enter those that begin again (sign -1, seen backwards)."""

    def __init__(
        self, table: StationTable, weights: FloatArray, levels: LaneLevels, *, half_vehicle: float, shifts: tuple[Shift, ...]
    ) -> None:
        self.stations, self.weights, self.levels = table.stations, weights, levels
        self.half_vehicle, self.shifts = half_vehicle, shifts
        self.mislabelled = 1 - levels.hypothesis.first.max(axis=1)
        nearest = np.rint(levels.lanes).astype(int)
        # A trace that seems to drive where the lanes are closed has mistaken lanes: it says nothing of where they end.
        beside = (nearest >= levels.n_lanes) | (nearest < 0)
        in_closure = beside[:, levels.closed_from : levels.open_from].sum(axis=1)
        self.believed = (in_closure <= MAX_STATIONS_IN_CLOSURE) & ~beside[:, levels.core_station]
        self.core_m = table.stations[levels.core_station]
        last = len(table.stations) - 1
        bounded = bool(levels.closed or levels.interior)
        closed_from, open_from = (levels.closed_from, levels.open_from) if bounded else (0, last)
        # A shift beyond the far end of the closure does not belong to the lane's near end.
        self.farthest_kink_m = {1: table.stations[min(open_from, last)], -1: -table.stations[min(closed_from, last)]}

    def line(
        self, lane: int, *, length: float, sign: int, end_prior: TaperEndPrior | None, min_users: float
    ) -> TaperLine | None:
        """The line across a lane on one side of the core; None where neither vehicles nor an announcement tell of it."""
        side = 1 if lane > 0 else -1
        near = sign * self.stations <= sign * self.core_m
        at = sign * self.stations[near]
        # Share of the lane's width that a vehicle's middle has still to go to the middle of the next lane inwards.
        remaining = np.clip(side * (self.levels.lanes[:, near] - lane) + 1.0, -1.0, 1.0)
        using = self.believed & (remaining.max(axis=1, initial=-1.0) > 0.5)
        # A trace that seems to return into a lane ahead of the announced last device has mistaken lanes.
        if self.weights[using].sum() <= min_users or (end_prior and sign < 0):
            using = np.zeros_like(using)
        if not using.any() and end_prior is None:
            return None
        users = remaining[using]
        last_merge = float(at[(users > 0.05).any(axis=0)].max()) if using.any() else -np.inf
        first_device = end_prior.first_device if end_prior else -np.inf
        kink = self._kink(lane, side, sign, last_merge=last_merge, first_device=first_device)
        return fit_taper_line(
            at, users, length=length, half_vehicle=self.half_vehicle, kink=kink, end_prior=end_prior,
            mislabelled=self.mislabelled[using],
        )  # fmt: skip

    def _kink(self, lane: int, side: int, sign: int, *, last_merge: float, first_device: float) -> float | None:
        """The first station [m], counted along the sign, where a shift away from the closed side starts.

        Such a shift follows the last merge, and the lane next to the open ones ends there.
        """
        next_to_open = lane in {-1, self.levels.n_lanes}
        after = max(last_merge - KINK_SLACK_M, first_device)
        away = [shift for shift in self.shifts if next_to_open and shift.size * side * sign < 0]
        kinks = [
            kink
            for shift in away
            if after < (kink := sign * (shift.start if sign > 0 else shift.end)) < self.farthest_kink_m[sign]
        ]
        return min(kinks, default=None)
