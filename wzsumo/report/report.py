"""report.html of a run: one page, without other files, that says whether the ego reached its goal and shows every figure."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wzsumo.case.map_method import Source
from wzsumo.case.methods import is_baseline, methods_from
from wzsumo.ego import Outcome
from wzsumo.files.output import staged_folder
from wzsumo.files.result_folder import ResultFolder, read_result_folder
from wzsumo.report.drive_player import player_data
from wzsumo.report.page import embedded, page_template
from wzsumo.report.tables import DASH, conduct_rows, goal_rows, metres, network_rows, outcome_in_words, percent, traffic_rows

PAGE = "report.html"
CLEARANCES = ("min_clearance_devices_m", "min_clearance_road_edge_m")
NOT_RUN_NAMES = {"slam": "LiDAR SLAM baseline"}


def write_report(folder: Path) -> Path:
    """The path of report.html, written to a run's result folder together with figures/*.png.

    All of them are replaced together, or none. Raises InputError where no run wrote the folder, OutputError where it cannot be
    written to.
    """
    from wzsumo.figures.figures import write_figures  # matplotlib loads slowly, and only a report needs it

    run = read_result_folder(folder)
    with staged_folder(folder, files=(PAGE,)) as stage:
        figures = embedded(write_figures(run, stage / "figures"))
        (stage / PAGE).write_text(_page(run, figures), encoding="utf-8")
    return folder / PAGE


def best_method(methods: Mapping[str, Mapping[str, Any]]) -> str | None:
    """The crowd method with the highest IoU, among those that reached the goal if any did; None without a crowd method."""
    crowd = {name: m for name, m in methods.items() if not is_baseline(name)}
    arrived = {name: m for name, m in crowd.items() if m.get("outcome") == Outcome.REACHED_GOAL}
    candidates = arrived or crowd
    return max(candidates, key=lambda name: candidates[name].get("iou") or 0.0, default=None)


def _page(run: ResultFolder, figures: list[dict[str, str]]) -> str:
    result, best = run.result, best_method(run.methods)
    facts = {key: _text(result.get(key)) for key in ("scenario", "seed", "version", "n_collected", "n_traces", "n_components")}
    return page_template("report.html.j2").render(
        facts=facts,
        best=best,
        player=player_data(run, best),
        verdict=_verdict(run.methods.get(best or "", {})),
        comparison=_comparison(run, best),
        methods=[_method_row(name, method) for name, method in run.methods.items()],
        conduct=conduct_rows(run.methods),
        goals=goal_rows(run.methods),
        slam=_slam_facts(result.get("slam") or {}),
        not_run=[(NOT_RUN_NAMES.get(name, name), reason) for name, reason in _not_run(result).items()],
        fleet=_fleet_rows(result.get("fleet") or {}) + traffic_rows(result.get("traffic") or {}),
        network=network_rows(result.get("network") or {}),
        timings=[(name, f"{seconds:.2f} s") for name, seconds in (result.get("timings_s") or {}).items()],
        figures=figures,
    )


def _slam_facts(slam: Mapping[str, Any]) -> str:
    if not slam:
        return ""
    states = ", ".join(f"{count} {state.replace('_', ' ')}" for state, count in slam["scan_states"].items())
    return (
        f"LiDAR mapping drive of vehicle {slam['vehicle_id']}: {slam['n_scans']} scans ({states}); position error "
        f"{metres(slam['ate_m'])} rms with LOAM, IMU and RTK, {metres(slam['dead_reckoning_ate_m'])} by dead reckoning; "
        f"{slam['n_devices_mapped']} devices found, {slam['n_links']} gaps between devices closed in the map `slam_barrier`."
    )


def _not_run(result: Mapping[str, Any]) -> dict[str, str]:
    methods, not_run = result.get("methods") or {}, dict(result.get("not_run") or {})
    if not methods_from(Source.LIDAR).keys() & methods.keys():
        not_run.setdefault("slam", "not part of this run")
    return not_run


def _verdict(method: Mapping[str, Any]) -> dict[str, str]:
    if not method:
        return {}
    reached = method.get("outcome") == Outcome.REACHED_GOAL
    return {
        "answer": "Yes" if reached else "No",
        "end": outcome_in_words(method),
        "reason": _text(method.get("reason")),
        "faults": "" if method.get("clean") else str(method.get("faults") or ""),
    } | _quality_and_clearances(method)


def _comparison(run: ResultFolder, best: str | None) -> list[tuple[str, str, str]]:
    measured = _quality_and_clearances(run.methods.get(best or "", {}))
    return [
        ("Precision of the map", "90.08 %", measured["precision"]),
        ("Recall of the map", "not reported", measured["recall"]),
        ("Intersection over union (IoU)", "not reported", measured["iou"]),
        ("Components K of the mixture", "15", _text(run.result.get("n_components"))),
        ("Least clearance to cones, planned path", "1.297 m", measured["planned_devices"]),
        ("Least clearance to road edge, planned path", "3.50 m", measured["planned_edge"]),
        ("Least clearance to cones, driven", "not reported", measured["driven_devices"]),
        ("Least clearance to road edge, driven", "not reported", measured["driven_edge"]),
        ("Share of the driven path in the closed area", "not reported", measured["driven_closed"]),
    ]


def _method_row(name: str, method: Mapping[str, Any]) -> dict[str, str]:
    plan_ms = method.get("plan_ms")
    return _quality_and_clearances(method) | {
        "name": name,
        "outcome": outcome_in_words(method),
        "reason": _text(method.get("reason")),
        "n_traces": _text(method.get("n_traces")),
        "n_components": _text(method.get("n_components")),
        "n_fragments": _text(method.get("n_fragments")),
        "plan_ms": DASH if plan_ms is None else f"{plan_ms:.0f} ms",
    }


def _quality_and_clearances(method: Mapping[str, Any]) -> dict[str, str]:
    row = {key: percent(method.get(key)) for key in ("precision", "recall", "iou")}
    for stage in ("planned", "driven"):
        figures = method.get(stage) or {}
        devices, edge = (metres(figures.get(key)) for key in CLEARANCES)
        closed = percent(figures.get("closed_area_share"))
        row |= {f"{stage}_devices": devices, f"{stage}_edge": edge, f"{stage}_closed": closed}
    return row


def _fleet_rows(fleet: Mapping[str, Any]) -> list[tuple[str, str]]:
    merge = fleet.get("merge_position_m") or {}
    quantiles = ", ".join(f"{name[1:]} %: {value:.0f} m" for name, value in merge.items() if value is not None)
    return [
        ("Vehicles simulated", _text(fleet.get("n_vehicles"))),
        ("Vehicles that passed the zone", _text(fleet.get("n_passed"))),
        ("Vehicles in the closed area", _text(fleet.get("n_in_closed_area"))),
        ("Lateral scatter between vehicles (standard deviation)", metres(fleet.get("lateral_sd_m"))),
        ("Merge position from the start of the merging taper, quantiles", quantiles or DASH),
    ]


def _text(value: object) -> str:
    """The value as text, a dash where there is none."""
    return DASH if value is None or value == "" else str(value)
