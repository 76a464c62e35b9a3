"""Charts of passing: traces that end on the road, exits that nobody takes any more, and silence."""

from dataclasses import dataclass
from math import log
from statistics import median
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from wzsumo.frames import FloatArray
from wzsumo.live.charts.evidence import FOLLOWER_S
from wzsumo.live.ground import GATE_M, Ground
from wzsumo.live.trace.reading import Reading

END_REACH_M = 200.0  # ahead of a closed road, over which traces end
ENDING_PRIOR = (0.4, 19.6)  # traces that end within the reach ahead of a cell, and that go on, before any is seen
LEAST_ENDING = 0.05  # share below which no habit is trusted: trips end, devices fail
ENDING_SHOWN, PASSING_ODD = 0.95, 0.05  # of traces on a closed road that end there; that seem to go on
EXIT_PRIOR = (0.5, 4.5)
EXIT_DRIFT = 0.9  # an exit's share may sink to this part of what it was, from day to day
STILL_EXITS = 0.05  # share of the former exits that seem to be taken although the exit is closed
RATE_TRACES = 40.0  # over which the time between platoons is averaged
MOST_GAPS = 8.0  # usual times between platoons, as which a longer one counts
LEARNED_BELOW = 1.0  # nats
MOST_TRACES = 2000.0

Counts = npt.NDArray[np.int32]


@dataclass(frozen=True, kw_only=True, eq=False)
class PassingCharts:
    """Evidence [nats] that the road is closed at a cell (m,), that an exit is (branches,), and the expected number of platoons
    that did not come (a float). `since` as in the other charts; `ending` (m, 2) and `exiting` (branches, 2) are habits.

    `gap_s` is the usual time between platoons beyond that between followers, `last_s` when the last trace came; nan before
    there were any.
    """

    ended: FloatArray
    ended_since: Counts
    ending: FloatArray
    ending_pending: FloatArray
    missed: FloatArray
    missed_since: Counts
    exiting: FloatArray
    exiting_pending: FloatArray
    silent: float
    gap_s: float
    n_gaps: int
    last_s: float


def first_passing_charts(ground: Ground) -> PassingCharts:
    """Charts of a map that no trace has been compared with yet."""
    m, n = len(ground.cells), len(ground.lanes.branches)
    return PassingCharts(
        ended=np.zeros(m), ended_since=np.zeros(m, dtype=np.int32), ending=np.zeros((m, 2)), ending_pending=np.zeros((m, 2)),
        missed=np.zeros(n), missed_since=np.zeros(n, dtype=np.int32), exiting=np.zeros((n, 2)),
        exiting_pending=np.zeros((n, 2)), silent=0.0, gap_s=float("nan"), n_gaps=0, last_s=float("nan"),
    )  # fmt: skip


def add_passage(charts: PassingCharts, reading: Reading, ground: Ground, *, number: int) -> PassingCharts:
    """The charts after trace `number`."""
    ended, ended_since, ending, ending_pending = _with_end(charts, reading, ground, number)
    missed, missed_since, exiting, exiting_pending = _with_exits(charts, reading, ground, number)
    return PassingCharts(
        ended=ended,
        ended_since=ended_since,
        ending=ending,
        ending_pending=ending_pending,
        missed=missed,
        missed_since=missed_since,
        exiting=exiting,
        exiting_pending=exiting_pending,
        **_with_gap(charts, reading.end_s),
    )


def silence(charts: PassingCharts, now_s: float) -> float:
    """Number of platoons that should have come since the last trace, at a time [s]."""
    known = charts.n_gaps >= RATE_TRACES / 2 and charts.gap_s > 0
    return max(now_s - charts.last_s - FOLLOWER_S, 0.0) / charts.gap_s if known else 0.0


def _with_gap(charts: PassingCharts, now_s: float) -> dict[str, Any]:
    """Vehicles that follow each other come as one: the gaps between platoons have no memory, those between vehicles do."""
    beyond = now_s - charts.last_s - FOLLOWER_S
    if np.isnan(beyond):
        return {"silent": 0.0, "gap_s": charts.gap_s, "n_gaps": 0, "last_s": now_s}
    last = max(now_s, charts.last_s)
    if beyond <= 0:
        return {"silent": 0.0, "gap_s": charts.gap_s, "n_gaps": charts.n_gaps, "last_s": last}
    n = charts.n_gaps + 1
    part = max(1 / n, 1 / RATE_TRACES)
    known = charts.gap_s if n > 1 else 0.0
    most = MOST_GAPS * known if n > RATE_TRACES / 2 else np.inf
    usual = known + part * (min(beyond, most) - known)
    return {"silent": silence(charts, now_s), "gap_s": usual, "n_gaps": n, "last_s": last}


def _with_end(
    charts: PassingCharts, reading: Reading, ground: Ground, number: int
) -> tuple[FloatArray, Counts, FloatArray, FloatArray]:
    m = len(ground.cells)
    where = reading.offset[reading.last]
    says, over, informs = _end_says(
        charts.ending, np.array(ENDING_PRIOR), m, max(1, round(END_REACH_M / ground.spacing)), reading.first, reading.last,
        -ground.width < where < ground.n_lanes * ground.width,
    )  # fmt: skip
    return _grown(charts.ended, charts.ended_since, charts.ending, charts.ending_pending, says, over, informs, number)


@numba.njit(cache=True, nogil=True)
def _end_says(
    ending: FloatArray, prior: FloatArray, m: int, reach: int, first: int, last: int, on_lanes: bool
) -> tuple[FloatArray, npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """(nats (m,) for a road closed at each cell, whether the trace ended ahead of it, whether it says anything about it).

    One that ended off the lanes took an exit, and says nothing of the road behind.
    """
    says, over, informs = np.zeros(m), np.zeros(m, dtype=np.bool_), np.zeros(m, dtype=np.bool_)
    for t in range(m):
        over[t] = last < t
        informs[t] = t > first + reach and t - reach <= last and t < m - reach // 2 and (on_lanes or not over[t])
        if informs[t]:
            ends, total = ending[t, 0] + prior[0], ending[t].sum() + prior.sum()
            share = ends / total
            share = min(max(share + np.sqrt(share * (1 - share) / (total + 1)), LEAST_ENDING), 0.95)
            says[t] = np.log(ENDING_SHOWN / share) if over[t] else np.log(PASSING_ODD / (1 - share))
    return says, over, informs


def _with_exits(
    charts: PassingCharts, reading: Reading, ground: Ground, number: int
) -> tuple[FloatArray, Counts, FloatArray, FloatArray]:
    n = len(charts.missed)
    says, takes, informs = np.zeros(n), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    for index, gate in enumerate(ground.gates):
        if gate is None:
            continue
        station, offset, side = gate
        cell = int(np.clip((station - ground.cells[0]) / ground.spacing + 0.5, 0, len(ground.cells) - 1))
        behind = slice(cell, cell + max(1, round(GATE_M / ground.spacing)))
        if reading.first > cell - 2 or not reading.found[behind].any():
            continue
        outer = 0.0 if side < 0 else ground.width * (ground.n_lanes - 1)
        informs[index] = True
        takes[index] = side * (median(reading.offset[behind][reading.found[behind]].tolist()) - (offset + outer) / 2) > 0
        # The chance that the next vehicle takes it, as Bayes gives it after all that came, those that did not take it among
        # them: that it is known by counting alone is in it.
        counts = (charts.exiting[index] + charts.exiting_pending[index] + EXIT_PRIOR).tolist()
        share = EXIT_DRIFT * counts[0] / sum(counts)
        says[index] = log(STILL_EXITS) if takes[index] else log((1 - STILL_EXITS * share) / (1 - share))
    return _grown(charts.missed, charts.missed_since, charts.exiting, charts.exiting_pending, says, takes, informs, number)


def _grown(
    evidence: FloatArray, since: Counts, habit: FloatArray, pending: FloatArray, says: FloatArray,
    happened: npt.NDArray[np.bool_], informs: npt.NDArray[np.bool_], number: int,
) -> tuple[FloatArray, Counts, FloatArray, FloatArray]:  # fmt: skip
    """(evidence, since, habit, pending) after a trace that says something where `informs`."""
    new = evidence.copy(), since.copy(), habit.copy(), pending.copy()
    _grow(*new, says, happened, informs, number)
    return new


@numba.njit(cache=True, nogil=True)
def _grow(
    evidence: FloatArray, since: Counts, habit: FloatArray, pending: FloatArray, says: FloatArray,
    happened: npt.NDArray[np.bool_], informs: npt.NDArray[np.bool_], number: int,
) -> None:  # fmt: skip
    for i in range(len(evidence)):
        if informs[i]:
            evidence[i] = max(evidence[i] + says[i], 0.0)
            pending[i, 0 if happened[i] else 1] += 1.0
        if evidence[i] == 0.0:
            since[i] = number
        if evidence[i] < LEARNED_BELOW:
            habit[i] += pending[i]
            pending[i] = 0.0
        if habit[i].sum() > MOST_TRACES:
            habit[i] *= MOST_TRACES / habit[i].sum()
