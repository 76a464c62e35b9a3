"""The head of a run's report: the answer in two sentences, and six figures with what they are held against."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from wzsumo.ego import Outcome
from wzsumo.files.result_folder import ResultFolder
from wzsumo.metrics.conduct import LIMITS
from wzsumo.report.tables import DASH, outcome_in_words, plain_number
from wzsumo.report.traffic_groups import DELAY_LIMIT, QUEUE_LIMIT


@dataclass(frozen=True, kw_only=True)
class KeyFigure:
    """A figure with its unit, the limit that it is held against, and whether it keeps it; None where nothing was measured."""

    name: str
    value: str
    limit: str
    kept: bool | None
    anchor: str  # of the section of the page that says more


def sentences(run: ResultFolder, method: str | None) -> tuple[str, str]:
    """Whether the vehicle could drive through on the map of a method, and what the zone does to traffic."""
    return _drive_sentence(run, method), _traffic_sentence(run)


def key_figures(run: ResultFolder, method: str | None) -> list[KeyFigure]:
    """Four figures of the drive on a method's map and two of the traffic."""
    made = run.methods.get(method or "", {})
    driven, conduct, traffic = made.get("driven") or {}, made.get("conduct") or {}, run.result.get("traffic") or {}
    least, shortest, hardest = LIMITS.min_clearance_devices_m, LIMITS.min_time_gap_s, LIMITS.max_braking_mps2
    beside, gap = driven.get("min_clearance_devices_m"), conduct.get("min_time_gap_s")
    braked, closed = conduct.get("braking_unprompted_mps2"), driven.get("closed_area_share")
    nobody = "nobody to follow" if conduct else DASH
    return [
        _figure("Closest to a device", beside, "{:.2f} m", f"at least {least:g} m", least=least, anchor="drive"),
        _figure("Driven in the closed area", closed, "{:.1%}", "0 %", most=0.0, anchor="maps"),
        _figure("Hardest braking", braked, "{:.1f} m/s²", f"at most {hardest:g} m/s²", most=hardest, anchor="drive"),
        _figure("Least time gap", gap, "{:.1f} s", f"at least {shortest:g} s", least=shortest, anchor="drive", absent=nobody),
        _figure("Mean delay of a vehicle", traffic.get("mean_delay_s"), "{:.0f} s", DELAY_LIMIT.words,
                most=DELAY_LIMIT.most, anchor="traffic"),
        _figure("Longest queue", traffic.get("max_queue_length_m"), "{:.0f} m", QUEUE_LIMIT.words, most=QUEUE_LIMIT.most,
                anchor="traffic"),
    ]  # fmt: skip


def _figure(
    name: str,
    value: float | None,
    form: str,
    limit: str,
    *,
    anchor: str,
    least: float | None = None,
    most: float | None = None,
    absent: str = DASH,
) -> KeyFigure:
    if value is None:
        return KeyFigure(name=name, value=absent, limit=limit, kept=None, anchor=anchor)
    kept = (least is None or value >= least) and (most is None or value <= most)
    return KeyFigure(name=name, value=form.format(value).replace("%", " %"), limit=limit, kept=kept, anchor=anchor)


def _drive_sentence(run: ResultFolder, method: str | None) -> str:
    made = run.methods.get(method or "")
    if made is None:
        return "No map of traces was made in this run, so it does not say whether a vehicle could drive on one."
    n = run.result.get("n_traces")
    basis = f"on a map of {n} trace{'' if n == 1 else 's'} (method “{method}”)"
    log = run.drive_of(method or "")
    if log is None:
        return f"No: {basis} no path was found, so nothing was driven ({made.get('reason') or outcome_in_words(made)})."
    driven = f"{log['s_m'].max():.0f} m"
    if made.get("outcome") != Outcome.REACHED_GOAL:
        why = f" ({made['reason']})" if made.get("reason") else ""
        return f"No: {basis} the drive ended after {driven}: {outcome_in_words(made)}{why}."
    if made.get("clean"):
        return f"Yes: {basis} the vehicle drove the {driven} to its goal and kept within all limits of conduct."
    faults = made.get("faults") or "its conduct was not measured"
    return f"Yes, but not cleanly: {basis} the vehicle drove the {driven} to its goal, yet {faults}."


def _traffic_sentence(run: ResultFolder) -> str:
    traffic: Mapping[str, Any] = run.result.get("traffic") or {}
    if not traffic:
        return "What the zone does to traffic was not measured."
    if traffic.get("locked_s") is not None:
        return (
            f"The traffic locked after {traffic['locked_s'] / 60:.0f} min: a vehicle at {traffic['locked_station_m']:.0f} m "
            "stood and never drove on, so delays and flows hold up to then."
        )
    flow, delay, queue = (traffic.get(key) for key in ("throughput_vph", "mean_delay_s", "max_queue_length_m"))
    stood = f"a queue reached back {plain_number(queue, 'm')} at most" if queue else "no queue formed"
    through = "" if flow is None else f"The zone let {plain_number(flow, 'veh/h')} through"
    lost = "" if delay is None else f"each lost {plain_number(delay, 's')} on average"
    parts = [part for part in (through, lost, stood) if part]
    said = ", ".join(parts[:-1]) + (" and " if parts[:-1] else "") + parts[-1]
    return f"{said[0].upper()}{said[1:]} (n = {traffic.get('n_vehicles', DASH)} vehicles, one simulation)."
