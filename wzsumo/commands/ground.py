"""The command `ground`: the ground points of a point cloud by SMRF."""

import argparse
import io
import time
from pathlib import Path
from typing import Any

import numpy as np

from wzsumo.commands.terminal.arguments import number
from wzsumo.errors import CloudError, OutputError
from wzsumo.files.cloud import MIN_SURFACE_POINTS, read_cloud
from wzsumo.files.output import staged_file
from wzsumo.frames import BoolArray
from wzsumo.lidar_mapping import smrf
from wzsumo.lidar_mapping.smrf import SmrfSpec
from wzsumo.spec import parse_spec

MORE = """\
A cloud holds x, y, z in metres: an .npy array (n, 3), a .csv table (columns x, y, z, or three unnamed ones) or a .ply file.
Labels are an array (n,) of uint8 in the order of the points.
"""
SMRF_OPTIONS = {
    ("--cell-m",): "edge of a cell of the surface (default 1)",
    ("--slope",): "steepest ground, rise over run (default 0.15)",
    ("--window-m",): "radius of the widest opening: half the width of the largest building (default 18)",
    ("--elevation-threshold-m",): "how far a ground point may lie off the surface (default 0.5; 0.2 keeps cones)",
    ("--elevation-scalar", "--scalar"): "metres added to the threshold per unit of slope (default 1.25)",
}  # defaults: Pingel, Clarke & McBride 2013, the set for all kinds of terrain


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("cloud", type=Path, metavar="IN.(npy|csv|ply)", help="points x, y, z in metres")
    parser.add_argument("--out", type=Path, required=True, metavar="OUT.npy", help="the file to write, a label a point")
    for names, about in SMRF_OPTIONS.items():
        parser.add_argument(*names, type=number, metavar="NUMBER", help=about)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Counts of ground points, after writing a label (n,) uint8 for each point of a cloud, 1 = ground, as .npy."""
    cloud, out = args.cloud, args.out
    spec = parse_spec(SmrfSpec, _options_given(args), source="ground")
    if out.suffix != ".npy":
        raise OutputError(f"--out {out}: labels are written as a numpy array; name a file that ends in .npy")
    with staged_file(out) as staged:
        ground, took_ms = _labelled(cloud, spec)
        buffer = io.BytesIO()  # numpy's own writing to a file does not say why it fails
        np.save(buffer, ground.astype(np.uint8))
        staged.write_bytes(buffer.getvalue())
    return {
        "labels": str(out),
        "n_points": len(ground),
        "n_ground": int(ground.sum()),
        "ground_share": float(ground.mean()),
        "parameters": spec.model_dump(),
        "ground_ms": took_ms,
    }


def _labelled(cloud: Path, spec: SmrfSpec) -> tuple[BoolArray, float]:
    """(which points of a cloud are ground, the time [ms] that it took)."""
    points = read_cloud(cloud, at_least=MIN_SURFACE_POINTS)
    smrf.compile_kernels()
    began = time.perf_counter()
    try:
        ground = smrf.ground_mask(points, spec)
    except CloudError as error:
        raise type(error)(f"{cloud}: {str(error).removeprefix('cloud: ')}") from None
    took_ms = 1000 * (time.perf_counter() - began)
    return ground, took_ms


def _options_given(args: argparse.Namespace) -> dict[str, float]:
    """The options on the command line, by their names in SmrfSpec."""
    keys = [names[0].removeprefix("--").replace("-", "_") for names in SMRF_OPTIONS]
    return {key: getattr(args, key) for key in keys if getattr(args, key) is not None}
