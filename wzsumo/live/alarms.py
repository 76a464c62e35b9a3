"""Alarms: what changed, where, since when, how sure, on how many traces - in words and numbers that others can use."""

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from wzsumo.live.charts.findings import Family


class Kind(StrEnum):
    """What an alarm says has changed."""

    SHIFTED = "shifted"  # lanes lie elsewhere
    LANE_CLOSED = "lane_closed"
    LANE_OPEN = "lane_open"
    CLOSURE_START_MOVED = "closure_start_moved"
    CLOSURE_END_MOVED = "closure_end_moved"
    ROAD_CLOSED = "road_closed"
    EXIT_CLOSED = "exit_closed"
    SILENCE = "silence"


@dataclass(frozen=True, kw_only=True)
class Change:
    """A change between two stations [m], each with its standard deviation; of one lane (0 is the rightmost) or of all (None).

    `size_m` is how far lanes moved to the left, or an end along the road, where that is what changed; `branch` numbers an exit.
    """

    kind: Kind
    lane: int | None = None
    branch: int | None = None
    start_m: float | None = None
    start_sd_m: float | None = None
    end_m: float | None = None
    end_sd_m: float | None = None
    size_m: float | None = None
    size_sd_m: float | None = None

    @property
    def words(self) -> str:
        """One sentence."""
        where = "" if self.start_m is None else f" from {self.start_m:.0f} m to {self.end_m:.0f} m"
        lane = "all lanes" if self.lane is None else f"lane {self.lane}"
        size = 0.0 if self.size_m is None else self.size_m
        return {
            Kind.SHIFTED: f"{lane} moved by {abs(size):.2f} m to the {'left' if size > 0 else 'right'}{where}",
            Kind.LANE_CLOSED: f"{lane} is closed{where}",
            Kind.LANE_OPEN: f"{lane} is driven again{where}",
            Kind.CLOSURE_START_MOVED: f"the closure of {lane} starts {abs(size):.0f} m {_way(size)}",
            Kind.CLOSURE_END_MOVED: f"the closure of {lane} ends {abs(size):.0f} m {_way(size)}",
            Kind.ROAD_CLOSED: f"nobody passes any more{where}",
            Kind.EXIT_CLOSED: f"nobody takes exit {self.branch} any more",
            Kind.SILENCE: "no traces come any more: the road is closed, or the fleet does not report",
        }[self.kind]


def _way(size: float) -> str:
    return "later" if size > 0 else "earlier"


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """A change and the evidence for it, raised by the last of `n_traces` traces that spoke for it.

    `since_s` is the time of the first of them, `at_s` that of the last, on the clock of the traces. Evidence as strong as this
    comes about without a change once in 1 / `false_alarms_per_trace` traces.
    """

    change: Change
    family: Family
    trace: int
    at_s: float
    since_s: float
    n_traces: int
    evidence_nats: float
    threshold_nats: float
    false_alarms_per_trace: float

    def as_json(self) -> dict[str, Any]:
        """Words and numbers."""
        numbers = {key: value for key, value in asdict(self).items() if key != "change"}
        return {"words": self.change.words, **asdict(self.change), **numbers}
