"""The command `net`: the SUMO files of a scenario."""

import argparse
from typing import Any

from wzsumo.commands.terminal.arguments import add_out_folder, add_scenario
from wzsumo.files.output import remove_stamps, staged_folder
from wzsumo.scenario.scenario import load_scenario

OWN_FILES = ("zone.net.xml", "zone.rou.xml", "zone.sumocfg")  # of a road of the scenario's own


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    add_scenario(parser)
    add_out_folder(parser)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """The edges of a scenario's network with their numbers of lanes, after writing its SUMO files."""
    spec = load_scenario(args.scenario)
    with staged_folder(args.out, files=OWN_FILES if spec.network is None else ()) as stage:
        files = spec.write_sumo_files(stage)
        remove_stamps(stage)
        config = args.out / files.config.relative_to(stage)
    return {"config": str(config), "edges": {edge.id: len(edge.through_lanes) for edge in files.edges}}


def next_step(figures: dict[str, Any], _args: argparse.Namespace) -> str:
    """What to do with what was written."""
    return f"sumo-gui -c {figures['config']}"
