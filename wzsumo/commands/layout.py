"""The command `layout`: the layout of a zone by the MUTCD, as files."""

import argparse
from typing import Any

from wzsumo.commands.terminal.arguments import add_out_folder, add_scenario
from wzsumo.figures.layout_figure import draw_zone
from wzsumo.files.lanes import LanesFile, write_lanes
from wzsumo.files.layout import layout_geojson, write_layout
from wzsumo.files.output import save_figure, staged_folder
from wzsumo.files.result_folder import ResultFolder
from wzsumo.mutcd.laid_out_lanes import laid_out_lanes
from wzsumo.scenario.scenario import load_scenario


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    add_scenario(parser)
    add_out_folder(parser)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Lengths and areas of the zone, after writing layout.geojson, lanes.geojson for `export`, devices.csv and layout.png."""
    scenario = load_scenario(args.scenario)
    facility = scenario.facility()
    layout, frame = facility.layout, facility.frame
    with staged_folder(args.out, files=("layout.geojson", "lanes.geojson", "devices.csv", "layout.png")) as stage:
        write_layout(layout, stage, frame=frame)
        write_lanes(LanesFile(lanes=laid_out_lanes(layout), frame=frame), stage)
        drawing = ResultFolder(folder=stage, result={}, layout=layout_geojson(layout))
        save_figure(draw_zone(drawing), stage / "layout.png")
    return {
        "areas_m": {area.name: round(area.length, 3) for area in layout.areas},
        "start_m": layout.start,
        "end_m": layout.end,
        "n_devices": len(layout.devices),
        "drivable_m2": layout.drivable.area,
        "closed_area_m2": layout.closed_area.area,
        "pavement_m2": layout.pavement.area,
    }


def next_step(_figures: dict[str, Any], args: argparse.Namespace) -> str:
    """What to do with what was written."""
    return f"wzsumo run {args.scenario} --out DIR; {args.out / 'layout.png'} shows the zone"
