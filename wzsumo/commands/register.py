"""The command `register`: the rigid motion from one point cloud to another."""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from wzsumo.errors import CloudError
from wzsumo.files.cloud import MIN_SURFACE_POINTS, read_cloud
from wzsumo.files.output import staged_file
from wzsumo.lidar_mapping import registration
from wzsumo.lidar_mapping.registration import RegistrationResult, RegistrationStatus

MORE = """\
A cloud holds x, y, z in metres: an .npy array (n, 3), a .csv table (columns x, y, z, or three unnamed ones) or a .ply file.
"status" says whether the transform can be trusted: converged, degenerate (the clouds do not determine some directions),
not_converged, poor_overlap. "free_motions" names those directions: translation along x, y, z of the target, then rotation.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("source", type=Path, metavar="SOURCE", help="the cloud that is moved")
    parser.add_argument("target", type=Path, metavar="TARGET", help="the cloud on which it is laid")
    parser.add_argument("--out", type=Path, required=True, metavar="T.txt", help="the file to write, four rows of numbers")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Status, overlap and residuals of the transform from a source cloud to a target, after writing it as text (4 x 4).

    Clouds that determine no motion (identical clouds, too few features) are refused. The identity would look like a result.
    """
    source, target, out = args.source, args.target, args.out
    with staged_file(out) as staged:
        result, took_ms = _registered(source, target)
        np.savetxt(staged, result.transform, fmt="%.12g")
    return {
        "transform_file": str(out),
        "status": str(result.status),
        "transform": result.transform.tolist(),
        "overlap": result.overlap,
        "residual_scale_m": result.scale_m,
        "free_directions": result.free_directions,
        "free_motions": result.free_motions.tolist(),
        "deviation_m": result.deviation_m.tolist(),
        "register_ms": took_ms,
    }


def _registered(source: Path, target: Path) -> tuple[RegistrationResult, float]:
    """(the registration of two clouds, the time [ms] that it took). Raises CloudError where they determine no motion."""
    moving, fixed = (read_cloud(path, at_least=MIN_SURFACE_POINTS) for path in (source, target))
    registration.compile_kernels()
    began = time.perf_counter()
    try:
        result = registration.register(moving, fixed)
    except CloudError as error:
        raise CloudError(str(error).replace("source:", f"{source}:", 1).replace("target:", f"{target}:", 1)) from None
    took_ms = 1000 * (time.perf_counter() - began)
    if result.status is RegistrationStatus.IDENTICAL_CLOUDS:
        raise CloudError(
            f"{source} and {target}: identical clouds of {len(moving)} points; they tell of no motion: give two scans"
        )
    if result.status is RegistrationStatus.TOO_FEW_FEATURES:
        raise CloudError(
            f"{source} and {target}: too few features; of {len(moving)} and {len(fixed)} points hardly any form lines or "
            "planes near the other cloud: give denser clouds of one place"
        )
    return result, took_ms
