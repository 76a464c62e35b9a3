"""Reads and writes an OccupancyGrid as the files of ROS map_server: a YAML file and its image."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from PIL import Image

from wzsumo.errors import MapError
from wzsumo.grid import FREE_THRESHOLD, OCCUPIED_THRESHOLD, UNKNOWN, OccupancyGrid

_DEFAULT_THRESHOLDS = {"occupied_thresh": OCCUPIED_THRESHOLD, "free_thresh": FREE_THRESHOLD}


def write_map(grid: OccupancyGrid, folder: Path | str, *, name: str = "map") -> Path:
    """The path of NAME.yaml, after writing it and NAME.pgm for ROS map_server (mode "scale": grey is probability).

    The image's first row is the map's top. Grey is 255 (1 - p), rounded, so p is kept to within 1/510.
    """
    folder = Path(folder)
    grey = np.round(255 * (1 - grid.p_occupied[::-1])).astype(np.uint8)
    Image.fromarray(grey).save(folder / f"{name}.pgm")
    metadata = {
        "image": f"{name}.pgm",
        "mode": "scale",
        "resolution": float(grid.resolution),
        "origin": [float(grid.origin[0]), float(grid.origin[1]), 0.0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESHOLD,
        "free_thresh": FREE_THRESHOLD,
        "width": grid.shape[1],  # our keys, which map_server ignores: `read_map` checks the image's size against them
        "height": grid.shape[0],
    }
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(metadata, sort_keys=False), encoding="utf-8")
    return path


def read_map(path: Path | str) -> OccupancyGrid:
    """The map of a ROS map_server YAML file (modes trinary, scale, raw) and its image.

    A trinary map becomes 0, 0.5 (unknown) and 1 by the file's own thresholds. Raises MapError where the two files do not
    fit together. Source: ROS map_server documentation, "Value Interpretation".
    """
    path = Path(path)
    metadata = _read_metadata(path)
    image = _read_image(path, metadata)
    grey, alpha = (image[..., 0], image[..., 1]) if image.ndim == 3 else (image, None)
    mode = metadata.get("mode", "trinary")
    if mode == "raw":  # occupancy in percent; values above 100 are unknown
        p = np.where(grey <= 100, grey / 100.0, UNKNOWN)
    else:
        p = grey / 255.0 if metadata.get("negate", 0) else (255.0 - grey) / 255.0
        if mode == "trinary":
            occupied, free = p > metadata["occupied_thresh"], p < metadata["free_thresh"]
            p = np.where(occupied, 1.0, np.where(free, 0.0, UNKNOWN))
        if alpha is not None:
            p = np.where(alpha < 255, UNKNOWN, p)
    x, y = metadata["origin"][:2]
    return OccupancyGrid(
        p_occupied=p[::-1].astype(np.float32), resolution=float(metadata["resolution"]), origin=(float(x), float(y))
    )


def _read_metadata(path: Path) -> dict[str, Any]:
    try:
        metadata = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise MapError(f"{path}: no such file; name the YAML file of a ROS map") from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise MapError(f"{path}: not a ROS map YAML file ({str(error).splitlines()[0]})") from None
    if not isinstance(metadata, dict):
        raise MapError(f"{path}: not a ROS map YAML file; it needs the keys image, resolution, origin")
    missing = [key for key in ("image", "resolution", "origin") if key not in metadata]
    if missing:
        raise MapError(f"{path}: {', '.join(missing)} missing; a ROS map needs image, resolution, origin")
    if not isinstance(metadata["resolution"], int | float) or not metadata["resolution"] > 0:
        raise MapError(f"{path}: resolution={metadata['resolution']!r} must be a cell edge in metres above 0")
    origin = metadata["origin"]
    numbers = isinstance(origin, list) and len(origin) >= 2 and all(isinstance(v, int | float) for v in origin)
    if not numbers or not np.isfinite(origin).all():
        raise MapError(f"{path}: origin={origin!r} must be [x, y, yaw] of the lower-left pixel in metres and radians")
    if len(origin) > 2 and origin[2] != 0:
        raise MapError(f"{path}: origin yaw {origin[2]} rad: rotated maps are not read; rotate the image and set yaw to 0")
    if metadata.get("mode", "trinary") not in {"trinary", "scale", "raw"}:
        raise MapError(f"{path}: mode={metadata['mode']!r} must be trinary, scale or raw")
    return metadata | _thresholds(path, metadata)


def _thresholds(path: Path, metadata: dict[str, Any]) -> dict[str, float]:
    given = {key: metadata.get(key, default) for key, default in _DEFAULT_THRESHOLDS.items()}
    for key, value in given.items():
        if not isinstance(value, int | float) or not 0 <= value <= 1:
            raise MapError(f"{path}: {key}={value!r} must be a probability in [0, 1]")
    return given


def _read_image(path: Path, metadata: dict[str, Any]) -> npt.NDArray[np.uint8]:
    image_path = path.parent / str(metadata["image"])
    try:
        # Pillow checks the size before it reads a pixel, and warns of images that it takes for decompression bombs.
        with warnings.catch_warnings(category=Image.DecompressionBombWarning, action="error"), Image.open(image_path) as image:
            pixels = np.asarray(image.convert("LA" if "A" in image.getbands() else "L"))
    except FileNotFoundError:
        raise MapError(f"{path}: image {image_path} does not exist; put it beside the YAML file") from None
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise MapError(
            f"{path}: image {image_path} has more than {Image.MAX_IMAGE_PIXELS} pixels; crop it to the road or use a coarser "
            "resolution"
        ) from None
    except (OSError, ValueError) as error:
        raise MapError(f"{path}: image {image_path} cannot be read ({error}); a complete PGM or PNG is needed") from None
    for key, size in (("width", pixels.shape[1]), ("height", pixels.shape[0])):
        if key in metadata and metadata[key] != size:
            raise MapError(f"{path}: {key}={metadata[key]} but the image {image_path} has {size}; they must agree")
    return pixels
