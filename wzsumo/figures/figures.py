"""The figures of a report: counterparts of Figures 4 to 9 and 11 of Chen et al. 2022. Files, titles and captions."""

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from wzsumo.case.map_method import Source
from wzsumo.case.methods import is_baseline, methods_from
from wzsumo.figures.drive_figure import draw_drive
from wzsumo.figures.figure_files import ReportFigure, write_planned
from wzsumo.figures.layout_figure import draw_zone
from wzsumo.figures.map_figures import draw_baseline_paths, draw_crowd_and_slam, draw_maps, draw_truth
from wzsumo.figures.mixture_figures import draw_components, draw_criteria, draw_samples
from wzsumo.figures.traffic_figures import draw_space_time
from wzsumo.files.result_folder import ResultFolder


def write_figures(run: ResultFolder, folder: Path) -> list[ReportFigure]:
    """Every figure of the run, written to `folder` as PNG, in the order of the paper."""
    folder.mkdir(parents=True, exist_ok=True)
    seed, n, k = (run.result.get(key, "-") for key in ("seed", "n_traces", "n_components"))
    run_of = f"n = {n} traces, seed {seed}."
    truth = "Truth is the drivable area of the layout, device line to edge line, within the zone."
    with_map = [name for name in run.methods if run.map_of(name) is not None]
    baselines = [name for name in with_map if is_baseline(name)]
    mapped = [name for name in with_map if name not in baselines]
    driven = [name for name in run.methods if run.drive_of(name) is not None and name not in baselines]
    plans: list[tuple[str, Callable[[], Figure], str, str]] = [
        ("fig04_zone", partial(draw_zone, run), "Work zone (paper: Fig. 4)",
         f"Signs, plan and a stretch to scale, n = {len(run.devices)} devices. Truth of all later figures: the drivable area."),
        ("fig05_criteria", partial(draw_criteria, run), "Number of components (paper: Fig. 5)",
         f"AIC and BIC over the number of components K of the mixture; K = {k} chosen. {run_of}"),
        ("fig06_components", partial(draw_components, run), "Components (paper: Fig. 6)",
         f"95 % ellipses of the {k} components over the {len(run.used_traces)} fixes they are fitted to. {run_of}"),
        ("fig07_samples", partial(draw_samples, run), "Samples (paper: Fig. 7)",
         f"n = {len(run.samples)} points drawn from the mixture inside its 95 % region. {run_of}"),
    ]  # fmt: skip
    if mapped:
        plans.append(
            ("fig08_maps", partial(draw_maps, run, mapped), "Maps (paper: Fig. 8)", f"What each method maps. {run_of}")
        )
    plans += [
        (f"fig09_truth_{_file_name(name)}", partial(draw_truth, run, name), f"Map and truth, {name} (paper: Fig. 9)",
         f"Cells within the zone, in three pieces, and the planned path of the rear axle. {run_of} {truth}")
        for name in mapped
    ]  # fmt: skip
    plans += [
        (f"fig11_drive_{_file_name(name)}", partial(draw_drive, run, name), f"Drive, {name} (paper: Fig. 11)",
         "The area that the vehicle's outline sweeps between devices and pavement edge, in three pieces; then its speed and "
         f"steering. n = 1 drive. {run_of} Truth: the layout's devices and edges; poses as simulated.")
        for name in driven
    ]  # fmt: skip
    cells = run.traffic_cells
    if cells is not None:
        plans.append(
            ("traffic_space_time", partial(draw_space_time, run, cells), "Speeds over time and road",
             "Space-mean speed of all vehicles in cells of 10 s and 20 m; white: nobody there. "
             f"n = {run.result.get('traffic', {}).get('n_vehicles', '-')} vehicles, seed {seed}.")
        )  # fmt: skip
    if baselines:
        plans += _baseline_plans(run, baselines, crowd=mapped, run_of=f"n = 1 mapping drive, seed {seed}.")
    return write_planned(plans, folder)


def _baseline_plans(
    run: ResultFolder, baselines: list[str], *, crowd: list[str], run_of: str
) -> list[tuple[str, Callable[[], Figure], str, str]]:
    plans: list[tuple[str, Callable[[], Figure], str, str]] = [
        ("fig10_baselines", partial(draw_baseline_paths, run, baselines), "The practice of today (paper: Fig. 8 and 10)",
         "Maps of one LiDAR mapping drive and of the HD map from before the zone, and the paths planned on them. "
         f"“Neither”: p(occupied) from 0.196 to 0.65. {run_of}")
    ]  # fmt: skip
    scanned = next((name for name in baselines if name in methods_from(Source.LIDAR)), None)
    if crowd and scanned:
        best = max(crowd, key=lambda name: run.methods[name].get("iou") or 0.0)
        plans.append(
            ("fig09_crowd_and_slam", partial(draw_crowd_and_slam, run, best, scanned),
             f"The crowd's map and the SLAM map, {best} (paper: Fig. 9)",
             "What the crowd's map calls free, and every cell that the LiDAR hit, passing vehicles included; the truth is the "
             f"drivable area of the layout. {run_of}")
        )  # fmt: skip
    return plans


def _file_name(method: str) -> str:
    return re.sub(r"[^A-Za-z0-9-]", "_", method)
