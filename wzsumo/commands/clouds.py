"""What the command line does with anybody's point clouds, one function a verb: files in, files out, figures returned."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wzsumo.errors import CloudError, OutputError
from wzsumo.files.cloud import read_cloud
from wzsumo.files.output import staged_folder
from wzsumo.lidar_mapping import registration, smrf
from wzsumo.lidar_mapping.registration import RegistrationStatus
from wzsumo.lidar_mapping.smrf import SmrfSpec
from wzsumo.spec import parse_spec

FEWEST_POINTS = 3  # of a surface

Figures = dict[str, Any]


def label_ground(cloud: Path, out: Path, *, parameters: Mapping[str, float]) -> Figures:
    """Write labels (n,) uint8 of a cloud's points, 1 = ground, as .npy; their counts. `parameters` are SmrfSpec's."""
    spec = parse_spec(SmrfSpec, dict(parameters), source="ground")
    if out.suffix != ".npy":
        raise OutputError(f"--out {out}: labels are written as a numpy array; name a file that ends in .npy")
    points = read_cloud(cloud, at_least=FEWEST_POINTS)
    smrf.compile_kernels()
    began = time.perf_counter()
    try:
        ground = smrf.ground_mask(points, spec)
    except CloudError as error:
        raise type(error)(f"{cloud}: {str(error).removeprefix('cloud: ')}") from None
    took_ms = 1000 * (time.perf_counter() - began)
    with staged_folder(out.parent) as stage:
        np.save(stage / out.name, ground.astype(np.uint8))
    return {
        "labels": str(out),
        "n_points": len(ground),
        "n_ground": int(ground.sum()),
        "ground_share": float(ground.mean()),
        "parameters": spec.model_dump(),
        "ground_ms": took_ms,
    }


def register_clouds(source: Path, target: Path, out: Path) -> Figures:
    """Write the 4 x 4 transform that takes a source cloud to a target as text; what it is worth.

    Clouds that determine no motion at all (identical, too few features) are refused: an identity would look like an answer.
    """
    moving, fixed = (read_cloud(path, at_least=FEWEST_POINTS) for path in (source, target))
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
    with staged_folder(out.parent) as stage:
        np.savetxt(stage / out.name, result.transform, fmt="%.12g")
    return {
        "transform_file": str(out),
        "status": str(result.status),
        "transform": result.transform.tolist(),
        "overlap": result.overlap,
        "residual_scale_m": result.scale_m,
        "free_directions": result.free_directions,
        "deviation_m": result.deviation_m.tolist(),
        "register_ms": took_ms,
    }
