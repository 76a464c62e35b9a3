"""Charts of passing: traces that end on the road, exits that nobody takes any more, and silence."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wzsumo.frames import FloatArray
from wzsumo.live.ground import Ground
from wzsumo.live.trace.reading import Reading

END_REACH_M = 200.0  # ahead of a closed road, over which traces end
ENDING_PRIOR = (0.4, 19.6)  # traces that end within the reach ahead of a cell, and that go on, before any is seen
LEAST_ENDING = 0.05  # share below which no habit is trusted: trips end, devices fail
ENDING_SHOWN, PASSING_ODD = 0.95, 0.05  # of traces on a closed road that end there; that seem to go on
EXIT_PRIOR = (0.5, 4.5)
EXIT_DRIFT = 0.9  # an exit's share may sink to this part of what it was, from day to day
GATE_CELLS = 4  # behind where a branch is clear of the lanes, whose median tells who takes it
STILL_EXITS = 0.05  # share of the former exits that seem to be taken although the exit is closed
RATE_TRACES = 40.0  # over which the time between traces is averaged
MOST_GAPS = 8.0  # usual times between traces, as which a longer one counts
LEARNED_BELOW = 1.0  # nats
MOST_TRACES = 2000.0

Counts = npt.NDArray[np.int32]


@dataclass(frozen=True, kw_only=True, eq=False)
class PassingCharts:
    """Evidence [nats] that the road is closed at a cell (m,), that an exit is (branches,), and the expected number of traces
    that did not come (a float). `since` as in the other charts; `ending` (m, 2) and `exiting` (branches, 2) are habits.

    `gap_s` is the usual time between traces, `last_s` when the last one came; nan before there were any.
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
    """Number of traces that should have come since the last one, at a time [s]."""
    known = charts.n_gaps >= RATE_TRACES / 2 and charts.gap_s > 0
    return max(now_s - charts.last_s, 0.0) / charts.gap_s if known else 0.0


def _with_gap(charts: PassingCharts, now_s: float) -> dict[str, Any]:
    if np.isnan(charts.last_s):
        return {"silent": 0.0, "gap_s": charts.gap_s, "n_gaps": 0, "last_s": now_s}
    gap, n = max(now_s - charts.last_s, 0.0), charts.n_gaps + 1
    silent = silence(charts, now_s)
    part = max(1 / n, 1 / RATE_TRACES)
    known = charts.gap_s if n > 1 else 0.0
    most = MOST_GAPS * known if n > RATE_TRACES / 2 else np.inf
    usual = known + part * (min(gap, most) - known)
    return {"silent": silent, "gap_s": usual, "n_gaps": n, "last_s": max(now_s, charts.last_s)}


def _with_end(
    charts: PassingCharts, reading: Reading, ground: Ground, number: int
) -> tuple[FloatArray, Counts, FloatArray, FloatArray]:
    reach = max(1, round(END_REACH_M / ground.spacing))
    cells = np.arange(len(ground.cells))
    informs = (cells > reading.first + reach) & (cells - reach <= reading.last) & (cells < len(cells) - reach // 2)
    over = reading.last < cells
    where = reading.offset[reading.last]  # off the lanes: it took an exit, and says nothing of the road behind
    if not -ground.width < where < ground.n_lanes * ground.width:
        informs &= ~over
    share, _ = _share(charts.ending + ENDING_PRIOR, sds=1.0)
    share = np.maximum(share, LEAST_ENDING)
    says = np.where(over, np.log(ENDING_SHOWN / share), np.log(PASSING_ODD / (1 - share)))
    return _grown(charts.ended, charts.ended_since, charts.ending, charts.ending_pending, says, over, informs, number)


def _with_exits(
    charts: PassingCharts, reading: Reading, ground: Ground, number: int
) -> tuple[FloatArray, Counts, FloatArray, FloatArray]:
    n = len(charts.missed)
    takes, informs = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    for index, gate in enumerate(ground.gates):
        if gate is None:
            continue
        station, offset, side = gate
        cell = int(np.clip((station - ground.cells[0]) / ground.spacing + 0.5, 0, len(ground.cells) - 1))
        behind = slice(cell, cell + GATE_CELLS)
        if reading.first > cell - 2 or not reading.found[behind].any():
            continue
        outer = 0.0 if side < 0 else ground.width * (ground.n_lanes - 1)
        informs[index] = True
        takes[index] = side * (np.median(reading.offset[behind][reading.found[behind]]) - (offset + outer) / 2) > 0
    share, sd = _share(charts.exiting + EXIT_PRIOR, sds=0.0)
    share = np.maximum(share - sd, 0.0) * EXIT_DRIFT
    says = np.where(takes, np.log(STILL_EXITS), np.log((1 - STILL_EXITS * share) / (1 - share)))
    return _grown(charts.missed, charts.missed_since, charts.exiting, charts.exiting_pending, says, takes, informs, number)


def _share(counts: FloatArray, *, sds: float) -> tuple[FloatArray, FloatArray]:
    """(share, its standard deviation) of the first of two counts (..., 2), the share raised by `sds` of them."""
    total = counts.sum(axis=-1)
    share = counts[..., 0] / total
    sd = np.sqrt(share * (1 - share) / (total + 1))
    return np.minimum(share + sds * sd, 0.95), sd


def _grown(
    evidence: FloatArray, since: Counts, habit: FloatArray, pending: FloatArray, says: FloatArray,
    happened: npt.NDArray[np.bool_], informs: npt.NDArray[np.bool_], number: int,
) -> tuple[FloatArray, Counts, FloatArray, FloatArray]:  # fmt: skip
    """(evidence, since, habit, pending) after a trace that says something where `informs`."""
    value = np.maximum(evidence + np.where(informs, says, 0.0), 0.0)
    since = np.where(value == 0, number, since).astype(np.int32)
    new = np.stack([happened & informs, ~happened & informs], axis=-1).astype(float)
    pending = pending + new
    calm = (value < LEARNED_BELOW)[..., None]
    habit, pending = np.where(calm, habit + pending, habit), np.where(calm, 0.0, pending)
    total = habit.sum(axis=-1, keepdims=True)
    return value, since, np.where(total > MOST_TRACES, habit * MOST_TRACES / np.maximum(total, 1.0), habit), pending
