"""Findings: the loudest chart of each family, and where it stands."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from wzsumo.frames import FloatArray
from wzsumo.live.charts.lane_charts import LaneCharts
from wzsumo.live.charts.passing_charts import PassingCharts
from wzsumo.live.charts.shape_charts import SIZES_M, ShapeCharts, loudest_pair, loudest_step


class Family(StrEnum):
    """Charts that share a threshold."""

    STEP = "step"  # lanes step aside, or a bump
    MOVED = "moved"  # a stretch is moved as a whole
    CLOSING = "closing"
    END_MOVED = "end_moved"  # the start or the end of a closure
    OPENING = "opening"
    ROAD_CLOSED = "road_closed"
    EXIT_CLOSED = "exit_closed"
    SILENCE = "silence"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """The evidence [nats] of a chart, its place in the charts of its family, and the trace behind which it began to grow."""

    family: Family
    evidence: float
    at: tuple[int, ...]
    since: int


def loudest(shape: ShapeCharts, lanes: LaneCharts, passing: PassingCharts, *, number: int) -> dict[Family, Finding]:
    """The loudest chart of each family; `number` is that of the last trace."""
    step, pair = loudest_step(shape), loudest_pair(shape)
    found = {
        Family.STEP: Finding(
            family=Family.STEP, evidence=step.evidence, at=(step.chart, step.shape, step.size, step.cell),
            since=int(shape.since[step.chart, step.shape, step.size, step.cell]),
        ),
        Family.MOVED: Finding(
            family=Family.MOVED, evidence=pair.evidence,
            at=(pair.chart, pair.shape, pair.size, pair.cell, pair.other_cell),
            since=min(
                int(shape.since[pair.chart, pair.shape, pair.size, pair.cell]),
                int(shape.since[pair.chart, pair.shape, len(SIZES_M) - 1 - pair.size, pair.other_cell]),
            ),
        ),
        Family.SILENCE: Finding(family=Family.SILENCE, evidence=passing.silent, at=(), since=number - 1),
    }  # fmt: skip
    for family, evidence, since in (
        (Family.CLOSING, lanes.closing, lanes.closing_since),
        (Family.END_MOVED, lanes.ends, lanes.ends_since),
        (Family.OPENING, lanes.opening, lanes.opening_since),
        (Family.ROAD_CLOSED, passing.ended, passing.ended_since),
        (Family.EXIT_CLOSED, passing.missed, passing.missed_since),
    ):
        found[family] = _loudest_of(family, evidence, since)
    return found


def loudest_evidence(shape: ShapeCharts, lanes: LaneCharts, passing: PassingCharts) -> float:
    """Evidence [nats] of the loudest chart of all; cheaper than to ask for the loudest of each family."""
    others = (shape.evidence, lanes.closing, lanes.ends, lanes.opening, passing.ended, passing.missed)
    return max(loudest_pair(shape).evidence, passing.silent, *(float(evidence.max(initial=0.0)) for evidence in others))


def _loudest_of(family: Family, evidence: FloatArray, since: npt.NDArray[np.int32]) -> Finding:
    if evidence.size == 0:
        return Finding(family=family, evidence=0.0, at=(), since=0)
    flat = int(np.argmax(evidence))
    at = tuple(int(i) for i in np.unravel_index(flat, evidence.shape))
    return Finding(family=family, evidence=float(evidence.flat[flat]), at=at, since=int(since.flat[flat]))
