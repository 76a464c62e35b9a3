"""LiveMap: the map as it stands, and all that is known about whether it still holds.

`with_trace` turns it into the next one. Time and memory of a step do not depend on how many traces came before.
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap
from wzsumo.live.ageing import HALF_LIFE_S, Witnesses, aged_lanes, first_witnesses, with_witness
from wzsumo.live.alarms import Alarm, Change, Kind
from wzsumo.live.charts.evidence import likeness
from wzsumo.live.charts.findings import Family, Finding, loudest, loudest_evidence
from wzsumo.live.charts.lane_charts import LaneCharts, add_use, first_lane_charts
from wzsumo.live.charts.passing_charts import PassingCharts, add_passage, first_passing_charts
from wzsumo.live.charts.restart import restarted_lanes, restarted_passing, restarted_shape
from wzsumo.live.charts.shape_charts import ShapeCharts, add_steps, first_shape_charts, without_evidence
from wzsumo.live.charts.thresholds import LEAST_NATS, calibrated_thresholds
from wzsumo.live.ground import Ground, ground_of
from wzsumo.live.redraw import LATEST_STARTS, change_point, confirmed, shift_of, with_lane_change, with_shift
from wzsumo.live.trace.decoding import draw_ways, error_levels, error_of, first_receivers, with_errors
from wzsumo.live.trace.lane_use import use_of_lanes
from wzsumo.live.trace.reading import WANDER_SD_M, Reading
from wzsumo.live.trace.recent import Recent, RecentTrace, lane_shares, moved, since, with_recent
from wzsumo.live.trace.shape import LEAST_WALK, OWN_WALK, steps_of

SLOW_FACTOR = 3.0  # times the usual time a metre: a vehicle of the work, or one in a jam
RATE = 0.02  # of running means over traces
EM_EXPONENT = -0.6  # of the steps of online EM: Cappé & Moulines 2009, who find 0.6 best of 0.5 to 1
FIRST_WALK = 0.005  # [m^2] a cell, of a receiver of 1 m whose error wanders within a minute
MOST_WALK = 20.0  # usual changes of an error: of a trace's own, before its lanes are known
DRAWN_MARGIN = 10  # cells beside a stretch that is being drawn: its edges may lie off by a ramp
REFINED_AT = (5, 10, 20, 40)  # traces since a change, at which its stretch is drawn once more


@dataclass(frozen=True, kw_only=True, eq=False)
class Redrawing:
    """A stretch that is still being learned: what was found, the lanes before, and by how much they are moved now (m,) [m]."""

    finding: Finding
    before: Ground
    lane: int | None
    profile: FloatArray | None


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveMap:
    """The lanes as drawn (`ground.lanes`), the charts, and the last traces. `number` counts traces, `version` drawings."""

    ground: Ground
    number: int
    version: int
    shape: ShapeCharts
    lanes: LaneCharts
    passing: PassingCharts
    witnesses: Witnesses
    recent: Recent
    redrawing: Redrawing | None
    usual_s_per_m: float
    usual_walk: float  # [m^2] variance of the receivers' errors' change from cell to cell
    receivers: FloatArray  # shares of them by their error, see `decoding.with_errors`
    now_s: float

    @property
    def error_m(self) -> float:
        """Root mean square [m] of the receivers' errors as they are known."""
        return error_of(self.receivers)

    def lanes_now(self, *, half_life_s: float = HALF_LIFE_S) -> LaneMap:
        """The lanes as they are known when the last trace came, older ground less surely."""
        lanes = aged_lanes(self.ground, self.witnesses, now_s=self.now_s, half_life_s=half_life_s)
        return replace(lanes, n_traces=lanes.n_traces + self.number, last_time_s=max(self.now_s, lanes.last_time_s))


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """The live map after a trace, the alarm that it raised, and what changed in the drawing (None: nothing)."""

    live: LiveMap
    alarm: Alarm | None
    redrawn: Change | None


def live_map(lanes: LaneMap) -> LiveMap:
    """A live map that starts from a lane map. Raises MapError where it has no lanes."""
    ground = ground_of(lanes)
    return LiveMap(
        ground=ground, number=0, version=1, shape=first_shape_charts(ground), lanes=first_lane_charts(ground),
        passing=first_passing_charts(ground), witnesses=first_witnesses(ground), recent=(), redrawing=None,
        usual_s_per_m=float("nan"), usual_walk=FIRST_WALK, receivers=first_receivers(), now_s=lanes.last_time_s,
    )  # fmt: skip


def with_trace(live: LiveMap, reading: Reading) -> Step:
    """The live map after one more trace, with an alarm where its evidence passes a threshold."""
    live = with_evidence(live, reading)
    for found in over_threshold(live):
        if not _is_being_redrawn(live, found) and is_confirmed(live, found):
            return _alarmed(live, found, reading)
        live = replace(live, shape=without_evidence(live.shape, found.at[3:], number=live.number))
    return _refined(live)


def findings(live: LiveMap) -> dict[Family, Finding]:
    """The loudest chart of each family."""
    return loudest(live.shape, live.lanes, live.passing, number=live.number)


def over_threshold(live: LiveMap) -> list[Finding]:
    """The findings that are beyond their thresholds, the farthest first."""
    if loudest_evidence(live.shape, live.lanes, live.passing) <= LEAST_NATS:
        return []
    thresholds, error = calibrated_thresholds(), live.error_m
    found = findings(live)
    beyond = {  # no threshold is below LEAST_NATS
        family: finding.evidence - thresholds.at(family, error)
        for family, finding in found.items() if finding.evidence > LEAST_NATS
    }  # fmt: skip
    return [found[family] for family in sorted(beyond, key=lambda family: -beyond[family]) if beyond[family] > 0]


def is_confirmed(live: LiveMap, finding: Finding) -> bool:
    """Whether the traces since a finding's beginning, taken together, bear it out."""
    return confirmed(live.ground, finding, since(live.recent, finding.since) or live.recent[-1:])


def with_evidence(live: LiveMap, reading: Reading) -> LiveMap:
    """The live map with what one more trace says, whether or not that is enough for an alarm."""
    number, ground = live.number + 1, live.ground
    if len(reading.offset) != len(ground.cells):
        raise TraceError(f"a reading on {len(reading.offset)} cells does not belong to a map of {len(ground.cells)}")
    own = live.usual_walk if np.isnan(reading.walk) else min(reading.walk, MOST_WALK * live.usual_walk)
    walk = max(OWN_WALK * own + (1 - OWN_WALK) * live.usual_walk, LEAST_WALK)
    ways = draw_ways(ground, reading, walk=walk, receivers=live.receivers, seed=number)
    steps = steps_of(ground, reading, ways, usual_walk=live.usual_walk, usual_scatter=live.shape.usual_scatter)
    errors = error_levels(reading.offset, reading.seen, ways.places, ways.weights, ground.width, ground.closed.any(axis=1))
    in_lane = lane_shares(ways.places, ways.weights, ground.n_lanes)
    rate = max(RATE, 1 / (number + 4))
    alike = likeness(reading.end_s - live.passing.last_s)
    pace = reading.seconds_per_m
    usual = pace if np.isnan(live.usual_s_per_m) else live.usual_s_per_m
    change = float(np.clip(steps.walk, -3 * live.usual_walk, 5 * live.usual_walk)) - live.usual_walk
    trace = RecentTrace(
        number=number, start_s=reading.start_s, end_s=reading.end_s, residual=steps.residual, in_lane=in_lane,
        noise=(reading.white**2 + 1.5 * WANDER_SD_M**2) * steps.scatter, walk=walk * steps.scatter,
    )  # fmt: skip
    return replace(
        live,
        number=number,
        shape=add_steps(live.shape, steps, alike=alike, number=number),
        lanes=add_use(
            live.lanes,
            use_of_lanes(ground, ways),
            ground,
            kind=reading.kind,
            slow=pace > SLOW_FACTOR * usual,
            now_s=reading.end_s,
            number=number,
        ),
        passing=add_passage(live.passing, reading, ground, number=number),
        witnesses=with_witness(live.witnesses, in_lane, reading.end_s),
        recent=with_recent(live.recent, trace),
        usual_s_per_m=usual + rate * (min(pace, 2 * usual) - usual),
        usual_walk=max(live.usual_walk + rate * change, LEAST_WALK),
        receivers=with_errors(live.receivers, errors, width=ground.width, rate=max(RATE, (number + 4) ** EM_EXPONENT)),
        now_s=max(live.now_s, reading.end_s),
    )


def _is_being_redrawn(live: LiveMap, finding: Finding) -> bool:
    """Whether a finding about the shape lies on a stretch that moved, and whose place is still being learned."""
    redrawing = live.redrawing
    if redrawing is None or redrawing.profile is None or finding.family not in (Family.STEP, Family.MOVED):
        return False
    cells = np.flatnonzero(redrawing.profile)
    return any(cells[0] - DRAWN_MARGIN <= cell <= cells[-1] + DRAWN_MARGIN for cell in finding.at[3:])


def _alarmed(live: LiveMap, finding: Finding, reading: Reading) -> Step:
    thresholds, error = calibrated_thresholds(), live.error_m
    traces = since(live.recent, finding.since) or live.recent[-1:]
    if finding.family in (Family.STEP, Family.MOVED) and len(traces) <= LATEST_STARTS:
        finding = replace(finding, since=change_point(live.ground, finding, traces))
        traces = since(live.recent, finding.since)
    redrawing = Redrawing(finding=finding, before=live.ground, lane=None, profile=None)
    drawn, change = _drawn(live, redrawing, traces)
    alarm = Alarm(
        change=change, family=finding.family, trace=live.number, at_s=reading.end_s, since_s=traces[0].start_s,
        n_traces=live.number - finding.since, evidence_nats=finding.evidence,
        threshold_nats=thresholds.at(finding.family, error),
        false_alarms_per_trace=thresholds.false_alarms_per_trace(finding.family, error, finding.evidence),
    )  # fmt: skip
    number, ground = live.number, drawn.ground
    drawn = replace(
        drawn,
        version=live.version + (change.kind is not Kind.SILENCE),
        shape=restarted_shape(live.shape, ground, change, number=number),
        lanes=restarted_lanes(live.lanes, ground, change, number=number),
        passing=restarted_passing(live.passing, ground, change, number=number),
    )
    return Step(live=drawn, alarm=alarm, redrawn=change)


def _refined(live: LiveMap) -> Step:
    """The live map, its youngest stretch drawn once more where enough further traces have passed it."""
    redrawing = live.redrawing
    if redrawing is None or live.number - redrawing.finding.since not in REFINED_AT:
        return Step(live=live, alarm=None, redrawn=None)
    drawn, change = _drawn(live, redrawing, since(live.recent, redrawing.finding.since))
    if redrawing.profile is not None:
        cells = tuple(int(cell) for cell in np.flatnonzero(redrawing.profile))
        drawn = replace(drawn, shape=without_evidence(drawn.shape, cells, number=live.number))
    if live.number - redrawing.finding.since == REFINED_AT[-1]:
        drawn = replace(drawn, redrawing=None)
    return Step(live=replace(drawn, version=live.version + 1), alarm=None, redrawn=change)


def _drawn(live: LiveMap, redrawing: Redrawing, traces: Recent) -> tuple[LiveMap, Change]:
    """The live map with its lanes drawn by the traces since the change, and the change."""
    finding, before = redrawing.finding, redrawing.before
    if finding.family in (Family.STEP, Family.MOVED):
        back, recent = traces, live.recent
        if redrawing.profile is not None:  # as seen from the lanes before the change
            back = moved(traces, -redrawing.profile, lane=redrawing.lane)
            recent = moved(recent, -redrawing.profile, lane=redrawing.lane)
        lane, shift = shift_of(before, finding, back)
        if shift is None:
            nothing = Change(kind=Kind.SHIFTED, lane=lane, size_m=0.0)
            return replace(live, redrawing=None), nothing
        lanes, change = with_shift(before.lanes, shift, lane=lane)
        new = replace(redrawing, lane=lane, profile=shift.profile)
        return replace(live, ground=ground_of(lanes), recent=moved(recent, shift.profile, lane=lane), redrawing=new), change
    lanes, change = with_lane_change(before, finding, traces)
    keeps = finding.family in (Family.CLOSING, Family.OPENING, Family.END_MOVED)
    return replace(live, ground=ground_of(lanes), redrawing=redrawing if keeps else None), change
