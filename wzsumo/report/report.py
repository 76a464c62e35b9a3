"""report.html of a run: one page that says whether the vehicle could drive through, and shows every figure."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wzsumo.case.map_method import Source
from wzsumo.case.methods import is_baseline, methods_from
from wzsumo.ego import Outcome
from wzsumo.files.output import staged_folder
from wzsumo.files.result_folder import ResultFolder, read_result_folder
from wzsumo.report.answer import key_figures, sentences
from wzsumo.report.drive_player import player_data
from wzsumo.report.page import embedded, page_template
from wzsumo.report.tables import (
    DASH,
    conduct_rows,
    goal_rows,
    goals_of,
    method_row,
    metres,
    network_rows,
    quality_and_clearances,
)
from wzsumo.report.traffic_groups import traffic_groups
from wzsumo.spec import read_toml

PAGE = "report.html"
NOT_RUN_NAMES = {"slam": "LiDAR SLAM baseline"}
GOAL_NAMES = {"own_lane": "Goal in the vehicle's own lane", "open_lane": "Goal in the open lane"}
FILES = {
    "result.json": "every figure of this page",
    "scenario.toml": "the scenario with all its defaults",
    "layout.geojson": "lanes, areas, devices, signs",
    "devices.csv": "the devices",
    "traces.parquet": "the traces",
    "mixture.json": "the mixture",
    "traffic/vehicles.csv": "delay, merging, braking, conflicts, emissions of each vehicle",
    "traffic/minutes.csv": "flow, speed and queue of each minute",
    "traffic/stations.csv": "flow, density and speed every 20 m",
    "traffic/cells.parquet": "speeds over time and road",
    "traffic/edges.csv": "delay on each edge of the network",
}
FOLDERS = {
    "maps/*.yaml": "map",
    "paths/*.csv": "planned path",
    "drives/*.csv": "log of the drive",
    "drives/*_traffic.parquet": "vehicles around the drive",
}


def write_report(folder: Path) -> Path:
    """The path of report.html, written to a run's result folder together with figures/*.png and *.svg.

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
    from wzsumo.figures.figures import file_name, is_papers  # as above
    from wzsumo.report.zone_picture import zone_picture

    result, best = run.result, best_method(run.methods)
    facts = {key: _text(result.get(key)) for key in ("scenario", "seed", "version", "n_collected", "n_traces", "n_components")}
    return page_template("report.html.j2").render(
        facts=facts,
        best=best,
        sentences=sentences(run, best),
        warnings=[str(warning) for warning in result.get("warnings") or ()],
        six=key_figures(run, best),
        picture=zone_picture(run, best),
        zone_words=_zone_words(run),
        player=player_data(run, best),
        comparison=_comparison(run, best) if is_papers(run) else [],
        methods=[method_row(name, method, driven_m=_driven(run, name)) for name, method in run.methods.items()],
        conduct=conduct_rows(run.methods),
        goals=goal_rows(run.methods),
        goal_names=[GOAL_NAMES[goal] for goal in goals_of(run.methods)],
        slam=_slam_facts(result.get("slam") or {}),
        not_run=[(NOT_RUN_NAMES.get(name, name), reason) for name, reason in _not_run(result).items()],
        traffic=traffic_groups(result.get("traffic") or {}, fleet=result.get("fleet") or {}, demand_vph=_demand(run)),
        network=network_rows(result.get("network") or {}),
        timings=[(name, f"{seconds:.2f} s") for name, seconds in (result.get("timings_s") or {}).items()],
        figures=sorted(figures, key=lambda each: not each["stem"].endswith(f"_{file_name(best or '')}")),  # the best first
        files=_files(run.folder),
    )


def _zone_words(run: ResultFolder) -> str:
    """What the picture shows, for those who do not see it."""
    start, end = run.span
    areas = ", ".join(f"{name} {last - first:.0f} m" for name, first, last in run.areas)
    return f"Plan of the zone of {end - start:.0f} m: {areas}. Lanes, closed ground, devices and the drive."


def _driven(run: ResultFolder, method: str) -> float | None:
    log = run.drive_of(method)
    return None if log is None or log.empty else float(log["s_m"].max())


def _demand(run: ResultFolder) -> float | None:
    """The flow [veh/h] that the scenario asks for; None in a network, whose vehicles are those of its own routes."""
    path = run.folder / "scenario.toml"
    table = read_toml(path) if path.exists() else {}
    flow = table.get("simulation", {}).get("demand", {}).get("flow_vph")
    return float(flow) if isinstance(flow, int | float) and "network" not in table else None


def _files(folder: Path) -> list[tuple[str, str]]:
    """Address within the folder and content of each data file that is there."""
    found = [(name, words) for name, words in FILES.items() if (folder / name).is_file()]
    for pattern, words in FOLDERS.items():
        found += [(path.relative_to(folder).as_posix(), words) for path in sorted(folder.glob(pattern))]
    return found


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


def _comparison(run: ResultFolder, best: str | None) -> list[tuple[str, str, str]]:
    measured = quality_and_clearances(run.methods.get(best or "", {}), decimals=3)
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


def _text(value: object) -> str:
    """The value as text, a dash where there is none."""
    return DASH if value is None or value == "" else str(value)
