"""The figures of a run's report, with file names, titles and captions: counterparts of Figures 4 to 11 of Chen et al. 2022."""

import re
from functools import partial
from pathlib import Path

from wzsumo.case.map_method import Source
from wzsumo.case.methods import is_baseline, methods_from
from wzsumo.figures.drive_figure import draw_drive
from wzsumo.figures.figure_files import Drawing, ReportFigure, save_drawings
from wzsumo.figures.layout_figure import draw_zone
from wzsumo.figures.map_figures import draw_baseline_paths, draw_crowd_and_slam, draw_maps, draw_truth
from wzsumo.figures.mixture_figures import draw_components, draw_criteria, draw_samples
from wzsumo.figures.narrow import NARROW_AXES_IN
from wzsumo.figures.network_figure import draw_network
from wzsumo.figures.traffic_figures import draw_space_time
from wzsumo.files.result_folder import ResultFolder
from wzsumo.spec import read_toml

# What Chen et al. 2022 state of their case, by keys of a scenario. Figures of another case are not compared with theirs.
PAPERS_VALUES = {
    ("work_zone", "posted_speed_mph"): 60.0, ("work_zone", "work_length_ft"): 650.0, ("crowd", "used"): 5,
    ("control", "target_speed_mps"): 10.0, ("road", "alignment"): [], ("road", "reference_points_m"): [],
}  # fmt: skip
PAPERS_CLOSED_WIDTH_FT = 36.0  # ibid., the activity area: 650 by 36 ft


def write_figures(run: ResultFolder, folder: Path) -> list[ReportFigure]:
    """Every figure of the run, written to `folder` as PNG and SVG, in the order of the paper."""
    folder.mkdir(parents=True, exist_ok=True)
    seed, n_traces = run.result.get("seed", "-"), run.result.get("n_traces", "-")
    sample = f"n = {n_traces} traces, seed {seed}."
    with_map = [name for name in run.methods if run.map_of(name) is not None]
    baselines = [name for name in with_map if is_baseline(name)]
    crowd = [name for name in with_map if name not in baselines]
    driven = [name for name in run.methods if run.drive_of(name) is not None and name not in baselines]
    drawings = [
        _zone_drawing(run),
        *(_mixture_drawings(run, sample=sample) if run.has_mixture else []),
        *_map_drawings(run, crowd, sample=sample),
        *(_drive_drawing(run, name, sample=sample) for name in driven),
        *_traffic_drawings(run),
        *_network_drawings(run),
    ]
    if baselines:
        drawings += _baseline_drawings(run, baselines, crowd=crowd, sample=f"n = 1 mapping drive, seed {seed}.")
    return save_drawings(drawings, folder)


def is_papers(run: ResultFolder) -> bool:
    """Whether a run is of the case of Chen et al. 2022: its scenario has the values that their paper states."""
    path = run.folder / "scenario.toml"
    scenario = read_toml(path) if path.is_file() else {}
    if "road" not in scenario:  # a zone in a network
        return False
    road, zone = scenario["road"], scenario["work_zone"]
    lanes_ft = len(zone.get("closed_lanes", [])) * road.get("lane_width_ft", 0.0)
    shoulder_ft = road.get(f"{zone['closed_shoulder']}_shoulder_ft", 0.0) if zone.get("closed_shoulder") else 0.0
    closed_ft = lanes_ft + shoulder_ft + zone.get("shift_ft", 0.0)
    same = all(scenario.get(section, {}).get(key, []) == value for (section, key), value in PAPERS_VALUES.items())
    return bool(same and closed_ft == PAPERS_CLOSED_WIDTH_FT)


def _title(run: ResultFolder, text: str, *, paper: str) -> str:
    """The title of a figure; of a run of the paper's zone with the figure of the paper."""
    return f"{text} (paper: Fig. {paper})" if is_papers(run) else text


def _zone_drawing(run: ResultFolder) -> Drawing:
    return Drawing(
        stem="fig04_zone",
        section="making",
        draw=partial(draw_zone, run),
        draw_narrow=partial(draw_zone, run, axes_width_in=NARROW_AXES_IN[1] - NARROW_AXES_IN[0]),
        title=_title(run, "Work zone", paper="4"),
        caption=f"Signs, plan and a stretch to scale, n = {len(run.devices)} devices. The drivable area is the truth of all "
        "later figures.",
    )


def _mixture_drawings(run: ResultFolder, *, sample: str) -> list[Drawing]:
    k = run.result.get("n_components", "-")
    return [
        Drawing(
            stem="fig05_criteria",
            section="making",
            draw=partial(draw_criteria, run),
            title=_title(run, "Number of components", paper="5"),
            caption=f"AIC and BIC over the number of components K of the mixture; K = {k} chosen. {sample}",
        ),
        Drawing(
            stem="fig06_components",
            section="making",
            draw=partial(draw_components, run),
            title=_title(run, "Components", paper="6"),
            caption=f"95 % ellipses of the {k} components over the {len(run.used_traces)} fixes to which they are fitted. "
            f"{sample}",
        ),
        Drawing(
            stem="fig07_samples",
            section="making",
            draw=partial(draw_samples, run),
            title=_title(run, "Samples", paper="7"),
            caption=f"n = {len(run.samples)} points drawn from the mixture inside its 95 % region. {sample}",
        ),
    ]


def _map_drawings(run: ResultFolder, crowd: list[str], *, sample: str) -> list[Drawing]:
    if not crowd:
        return []
    maps = Drawing(
        stem="fig08_maps",
        section="maps",
        draw=partial(draw_maps, run, crowd),
        title=_title(run, "Maps", paper="8"),
        caption=f"The map of each method. {sample}",
    )
    truths = [
        Drawing(
            stem=f"fig09_truth_{file_name(name)}",
            section="maps",
            draw=partial(draw_truth, run, name),
            title=_title(run, f"Map and truth, {name}", paper="9"),
            caption="Cells within the zone, in three pieces, and the planned path of the rear axle. "
            f"{sample} The truth is the drivable area of the layout, from the device line to the edge line, within the zone.",
        )
        for name in crowd
    ]
    return [maps, *truths]


def _drive_drawing(run: ResultFolder, method: str, *, sample: str) -> Drawing:
    return Drawing(
        stem=f"fig11_drive_{file_name(method)}",
        section="drive",
        draw=partial(draw_drive, run, method),
        title=_title(run, f"Drive, {method}", paper="11"),
        caption="The area that the ego's outline sweeps between devices and pavement edge, in three pieces; then the ego's "
        "speed, with what held it back, and its steering over the whole drive; dotted: the ends of the zone. "
        f"n = 1 drive. {sample} Devices and edges are those of the layout, poses those of the simulation.",
    )


def _traffic_drawings(run: ResultFolder) -> list[Drawing]:
    cells = run.traffic_cells
    if cells is None:
        return []
    n_vehicles = run.result.get("traffic", {}).get("n_vehicles", "-")
    return [
        Drawing(
            stem="traffic_space_time",
            section="traffic",
            draw=partial(draw_space_time, run, cells),
            title="Speeds over time and road",
            caption="Space-mean speed of all vehicles in cells of 10 s and 20 m; cells without a vehicle are white. "
            f"n = {n_vehicles} vehicles, seed {run.result.get('seed', '-')}.",
        )
    ]


def _network_drawings(run: ResultFolder) -> list[Drawing]:
    if run.network_edges is None:
        return []
    vehicles = run.result.get("network", {}).get("with_zone", {}).get("n_vehicles", "-")
    return [
        Drawing(
            stem="network_delay",
            section="network",
            draw=partial(draw_network, run),
            title="Network: what the zone changes",
            caption="Time that all vehicles together lose on each edge, with the zone less without it, pieces of a cut edge "
            "added up; waits to depart are not shown. "
            f"n = {vehicles} vehicles, one pair of simulations, seed {run.result.get('seed', '-')}.",
        )
    ]


def _baseline_drawings(run: ResultFolder, baselines: list[str], *, crowd: list[str], sample: str) -> list[Drawing]:
    drawings = [
        Drawing(
            stem="fig10_baselines",
            section="maps",
            draw=partial(draw_baseline_paths, run, baselines),
            title=_title(run, "LiDAR SLAM and HD maps", paper="8 and 10"),
            caption="Maps of one LiDAR mapping drive and of the HD map from before the zone, and the paths planned on them. "
            f"“Neither”: p(occupied) from 0.196 to 0.65. {sample}",
        )
    ]
    scanned = next((name for name in baselines if name in methods_from(Source.LIDAR)), None)
    if crowd and scanned:
        best = max(crowd, key=lambda name: run.methods[name].get("iou") or 0.0)
        drawings.append(
            Drawing(
                stem="fig09_crowd_and_slam",
                section="maps",
                draw=partial(draw_crowd_and_slam, run, best, scanned),
                title=_title(run, f"The crowd's map and the SLAM map, {best}", paper="9"),
                caption="The free cells of the crowd's map, and every cell that the LiDAR hit, passing vehicles included. The "
                f"truth is the drivable area of the layout. {sample}",
            )
        )
    return drawings


def file_name(method: str) -> str:
    """A method's name as part of the name of a file."""
    return re.sub(r"[^A-Za-z0-9-]", "_", method)
