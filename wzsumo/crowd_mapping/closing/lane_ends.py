"""Where lanes beside the open ones end and begin again: lines of devices, told by vehicles, shifts and the announcement."""

from dataclasses import dataclass

import numpy as np

from wzsumo.crowd_mapping.closing.taper_line import TaperLine, fit_taper_line
from wzsumo.crowd_mapping.course.shifts import Shift
from wzsumo.crowd_mapping.course.station_table import StationTable
from wzsumo.crowd_mapping.hypotheses.announcement import Announced, Announcement
from wzsumo.crowd_mapping.hypotheses.closures import DOWNSTREAM_TAPER_M
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.frames import FloatArray
from wzsumo.tapers import merging_taper_m

LEAST_USERS = 0.6  # traces in a lane that is said to end
LEAST_RETURNING = 0.08  # share of the traces in a lane that is said to open again: at 2 m error up to 5 % seem to by mistake
SLACK_STATIONS = 3  # of a trace in a closed lane: where it closes is known to about so many
KINK_SLACK_M = 30.0  # of a kink beside the last lane change: three stations


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneEnds:
    """Lines across the lanes beside the open ones, by lane as counted in `LaneLevels`.

    `closing`: where a lane ends; `opening`: where it begins again, stations counted against the direction of travel.
    """

    closing: dict[int, TaperLine]
    opening: dict[int, TaperLine]


def fit_lane_ends(
    table: StationTable,
    weights: FloatArray,
    levels: LaneLevels,
    *,
    lanes: tuple[int, ...],
    announced: Announced | None,
    shifts: tuple[Shift, ...],
    speed_mps: float,
    vehicle_width_m: float,
) -> LaneEnds:
    """The ends of `lanes`; `announced` is what is known of where the zone is, if anything is."""
    ways = _Ways(table, weights, levels, half_vehicle=vehicle_width_m / 2 / levels.outer_width, shifts=shifts)
    merging_m = merging_taper_m(speed_mps, width_m=levels.outer_width)
    closing: dict[int, TaperLine] = {}
    opening: dict[int, TaperLine] = {}
    for lane in lanes:
        outer = sum(abs(other) > abs(lane) and other * lane >= 0 for other in lanes)
        closed = announced.closing(lane, lanes_before=outer) if announced else None
        opened = announced.opening(lanes_before=outer) if announced else None
        least, least_returning = LEAST_USERS * min(1.0, weights.sum()), LEAST_RETURNING * weights.sum()
        if line := ways.end_of(lane, length=merging_m, sign=1, announcement=closed, least=least):
            closing[lane] = line
        if line := ways.end_of(lane, length=DOWNSTREAM_TAPER_M, sign=-1, announcement=opened, least=least_returning):
            opening[lane] = line
    return LaneEnds(closing=closing, opening=opening)


class _Ways:
    """The vehicles' ways out of the lanes that end, and into those that begin again (sign -1, seen backwards)."""

    def __init__(
        self, table: StationTable, weights: FloatArray, levels: LaneLevels, *, half_vehicle: float, shifts: tuple[Shift, ...]
    ) -> None:
        self.stations, self.weights, self.levels = table.stations, weights, levels
        self.half_vehicle, self.shifts = half_vehicle, shifts
        self.doubts = 1 - levels.hypothesis.first.max(axis=1)
        whole = np.rint(levels.lanes).astype(int)
        # One who seems to drive where the lanes are closed was mistaken: such a trace says nothing of where they end.
        beyond = (whole >= levels.n_lanes) | (whole < 0)
        self.trusted = (beyond[:, levels.closes : levels.opens].sum(axis=1) <= SLACK_STATIONS) & ~beyond[:, levels.core]
        self.core = table.stations[levels.core]
        bounded = bool(levels.closed or levels.interior)
        last = len(table.stations) - 1
        first_closed, last_closed = (levels.closes, levels.opens) if bounded else (0, last)
        self.far = {1: table.stations[min(last_closed, last)], -1: -table.stations[min(first_closed, last)]}

    def end_of(
        self, lane: int, *, length: float, sign: int, announcement: Announcement | None, least: float
    ) -> TaperLine | None:
        """The line across a lane on one side of the core; None where neither vehicles nor an announcement tell of it."""
        side = 1 if lane > 0 else -1
        near = sign * self.stations <= sign * self.core
        at = sign * self.stations[near]
        # Share of this lane's width that a vehicle's centre still has to go to the middle of the next lane inwards.
        shares = np.clip(side * (self.levels.lanes[:, near] - lane) + 1.0, -1.0, 1.0)
        using = self.trusted & (shares.max(axis=1, initial=-1.0) > 0.5)
        # Who comes back into a lane ahead of the announced last device was taken to be in another lane.
        if self.weights[using].sum() <= least or (announcement and sign < 0):
            using = np.zeros_like(using)
        if not using.any() and announcement is None:
            return None
        users = shares[using]
        # Shifts away from the closed side follow the last merge, the first of them next; backwards so do shifts back.
        last = float(at[(users > 0.05).any(axis=0)].max()) if using.any() else -np.inf
        adjacent = lane in {-1, self.levels.n_lanes}
        after = max(last - KINK_SLACK_M, announcement.station if announcement else -np.inf)
        away = [shift for shift in self.shifts if adjacent and shift.size * side * sign < 0]
        kinks = [kink for shift in away if after < (kink := sign * (shift.start if sign > 0 else shift.end)) < self.far[sign]]
        return fit_taper_line(
            at, users, length=length, half_vehicle=self.half_vehicle, kink=min(kinks, default=None),
            announcement=announcement, doubts=self.doubts[using],
        )  # fmt: skip
