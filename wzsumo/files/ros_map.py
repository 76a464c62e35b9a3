"""Reads and writes an OccupancyGrid as the files of ROS map_server: a YAML file and its image."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from wzsumo.errors import MapError, check_file, reading, shown
from wzsumo.files.map_image import MapImage, read_map_image
from wzsumo.files.placing import settle
from wzsumo.frames import FloatArray
from wzsumo.grid import FREE_THRESHOLD, OCCUPIED_THRESHOLD, UNKNOWN, OccupancyGrid

_DEFAULT_THRESHOLDS = {"occupied_thresh": OCCUPIED_THRESHOLD, "free_thresh": FREE_THRESHOLD}
_MAX_METADATA_BYTES = 1e6
_MAX_KEYS = 1000  # of one mapping; a map has some ten
_WANTED = "name the YAML file of a ROS map, with the keys image, resolution and origin"


class _KeysOnceLoader(yaml.SafeLoader):
    """PyYAML's safe loader, which refuses a key that is given twice instead of taking the last value."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """The mapping of a node. Raises ConstructorError."""
        keys = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        if twice := sorted({key for key in keys if keys.count(key) > 1}) if len(keys) < _MAX_KEYS else ["..."]:
            raise yaml.constructor.ConstructorError(None, None, f"{', '.join(twice)} given more than once", node.start_mark)
        return super().construct_mapping(node, deep=deep)


def write_map(grid: OccupancyGrid, folder: Path | str, *, name: str = "map") -> Path:
    """The path of NAME.yaml, after writing it and NAME.pgm for ROS map_server (mode "scale": grey is probability).

    The image's first row is the map's top. Grey is 255 (1 - p), rounded, so p is kept to within 1/510.
    """
    folder = Path(folder)
    grey = np.round(255 * (1 - grid.p_occupied[::-1])).astype(np.uint8)
    header = b"P5\n%d %d\n255\n" % (grid.shape[1], grid.shape[0])
    (folder / f"{name}.pgm").write_bytes(header + grey.tobytes())
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

    A trinary map becomes 0, 0.5 (unknown) and 1 by the file's own thresholds. The probabilities of a map in mode scale are
    stretched so that its thresholds become those of `grid`: a cell is free here where the file calls it free.
    Raises MapError where the two files do not fit together. Source: ROS map_server documentation, "Value Interpretation".
    """
    path = Path(path)
    settle(path.parent)
    metadata = _read_metadata(path)
    image_path = path.parent / str(metadata["image"])
    try:
        image = read_map_image(image_path)
    except MapError as error:
        raise MapError(f"{path}: image {error}") from None
    for key, size in (("width", image.levels.shape[1]), ("height", image.levels.shape[0])):
        if key in metadata and metadata[key] != size:
            raise MapError(f"{path}: {key}={shown(metadata[key])} but the image {image_path} has {size}; they must agree")
    p = _p_of_levels(image, metadata, path).astype(np.float32)[image.levels]
    if image.opaque is not None and metadata["mode"] != "raw":
        p[~image.opaque] = UNKNOWN
    return OccupancyGrid(p_occupied=p[::-1], resolution=metadata["resolution"], origin=metadata["origin"])


def _p_of_levels(image: MapImage, metadata: dict[str, Any], path: Path) -> FloatArray:
    """The p(occupied) (full + 1,) that each level of the image stands for."""
    share = np.arange(image.full + 1) / image.full
    if metadata["mode"] == "raw":  # occupancy in percent; values above 100 are unknown
        if image.full > 3 * 255:
            raise MapError(f"{path}: mode raw is percent in 8 bits, the image has 16; give an image of 8 bits, or mode scale")
        percent = np.round(255 * share)
        return np.where(percent <= 100, percent / 100, UNKNOWN)
    occupied = share if metadata["negate"] else 1 - share
    is_free, is_occupied = occupied < metadata["free_thresh"], occupied > metadata["occupied_thresh"]
    if metadata["mode"] == "trinary":
        return np.where(is_occupied, 1.0, np.where(is_free, 0.0, UNKNOWN))
    stretched = np.interp(
        occupied, [0, metadata["free_thresh"], metadata["occupied_thresh"], 1], [0, FREE_THRESHOLD, OCCUPIED_THRESHOLD, 1]
    )
    free_most = float(np.nextafter(np.float32(FREE_THRESHOLD), np.float32(0)))  # rounding must not take a cell over a threshold
    occupied_least = float(np.nextafter(np.float32(OCCUPIED_THRESHOLD), np.float32(1)))
    stretched = np.where(is_free, np.minimum(stretched, free_most), np.maximum(stretched, FREE_THRESHOLD))
    return np.where(is_occupied, np.maximum(stretched, occupied_least), np.minimum(stretched, OCCUPIED_THRESHOLD))


def _read_metadata(path: Path) -> dict[str, Any]:
    """image, mode, resolution, origin (x, y), negate and thresholds; width and height where the file has them."""
    check_file(path, error=MapError, remedy=_WANTED, max_bytes=_MAX_METADATA_BYTES)
    with reading(path, error=MapError, remedy=_WANTED, also=(yaml.YAMLError,)):
        given = yaml.load(path.read_text(encoding="utf-8-sig"), Loader=_KeysOnceLoader)  # noqa: S506 - a SafeLoader
    if not isinstance(given, dict):
        raise MapError(f"{path}: not a ROS map YAML file; {_WANTED}")
    missing = [key for key in ("image", "resolution", "origin") if key not in given]
    if missing:
        raise MapError(f"{path}: {', '.join(missing)} missing; a ROS map needs image, resolution, origin")
    resolution = _number(given["resolution"])
    if resolution is None or resolution <= 0:
        raise MapError(f"{path}: resolution={shown(given['resolution'])} must be a cell edge in metres above 0")
    origin = [_number(value) for value in given["origin"][:3]] if isinstance(given["origin"], list) else []
    if len(origin) < 2 or None in origin:
        raise MapError(
            f"{path}: origin={shown(given['origin'])} must be [x, y, yaw] of the lower-left pixel in metres and radians"
        )
    if len(origin) > 2 and origin[2] != 0:
        raise MapError(f"{path}: origin yaw {origin[2]} rad: rotated maps are not read; rotate the image and set yaw to 0")
    mode, negate = given.get("mode", "trinary"), given.get("negate", 0)
    if mode not in ("trinary", "scale", "raw"):
        raise MapError(f"{path}: mode={shown(mode)} must be trinary, scale or raw")
    if negate not in (0, 1):
        raise MapError(f"{path}: negate={shown(negate)} must be 0 or 1, without quotes: whether white is occupied")
    if not isinstance(given["image"], str) or not given["image"]:
        raise MapError(f"{path}: image={shown(given['image'])} must be the name of an image file")
    checked = {"mode": mode, "negate": negate, "resolution": resolution, "origin": tuple(origin[:2])}
    return given | checked | _thresholds(path, given)


def _thresholds(path: Path, metadata: dict[str, Any]) -> dict[str, float]:
    given = {key: metadata.get(key, default) for key, default in _DEFAULT_THRESHOLDS.items()}
    for key, value in given.items():
        number = _number(value)
        if number is None or not 0 <= number <= 1:
            raise MapError(f"{path}: {key}={shown(value)} must be a probability in [0, 1]")
    if given["free_thresh"] > given["occupied_thresh"]:
        raise MapError(
            f"{path}: free_thresh={given['free_thresh']} must be at most occupied_thresh={given['occupied_thresh']}; "
            "between the two a cell is unknown"
        )
    return given


def _number(value: object) -> float | None:
    """The value where it is a finite number, else None: YAML has truth values, texts, dates and numbers without bound too."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:
        return None
