"""OccupancyGrid: p(occupied) on a regular grid, and its ROS map_server files."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
import yaml
from PIL import Image
from shapely.geometry.base import BaseGeometry

from wzsumo.errors import MapError
from wzsumo.frames import FloatArray

FREE_THRESHOLD = 0.196  # ROS map_server's default free_thresh: p_occupied below it is free
OCCUPIED_THRESHOLD = 0.65  # ROS map_server's default occupied_thresh
_USUAL_THRESHOLDS = {"occupied_thresh": OCCUPIED_THRESHOLD, "free_thresh": FREE_THRESHOLD}
UNKNOWN = 0.5  # p(occupied) where nothing was observed
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class OccupancyGrid:
    """p_occupied (rows, cols) float32 in [0, 1]; row = y upwards, col = x; a binary map holds 0s and 1s.

    `origin` is the world point (x, y) [m] of the lower-left CORNER of cell [0, 0]; `resolution` the cell's edge [m].
    """

    p_occupied: npt.NDArray[np.float32]
    resolution: float
    origin: tuple[float, float]

    def __post_init__(self) -> None:
        p = np.asarray(self.p_occupied, dtype=np.float32)
        if p.ndim != 2 or p.size == 0:
            raise MapError(f"a map of shape {p.shape} must have rows and columns")
        if not (np.isfinite(p).all() and p.min() >= 0 and p.max() <= 1):
            raise MapError("p_occupied must be finite and in [0, 1] in every cell; mark unknown cells with 0.5")
        if not (np.isfinite(self.resolution) and self.resolution > 0 and np.isfinite(self.origin).all()):
            raise MapError(f"resolution={self.resolution} m must be above 0 and origin={self.origin} finite")
        object.__setattr__(self, "p_occupied", p)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, cols = self.p_occupied.shape
        return rows, cols

    @property
    def free(self) -> BoolArray:
        """Cells (rows, cols) where a vehicle may be: p_occupied below FREE_THRESHOLD. Unknown is not free."""
        return np.asarray(self.p_occupied < FREE_THRESHOLD)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """World extent (x_min, y_min, x_max, y_max) [m]."""
        rows, cols = self.shape
        x, y = self.origin
        return x, y, x + cols * self.resolution, y + rows * self.resolution

    def cell_of(self, points: npt.ArrayLike) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Rows and columns (n,) of the cells that hold world points (n, 2); outside the map they exceed the shape."""
        xy = np.asarray(points, dtype=float).reshape(-1, 2)
        col, row = np.floor((xy - self.origin) / self.resolution).astype(np.intp).T
        return row, col

    def centre_of(self, row: npt.ArrayLike, col: npt.ArrayLike) -> FloatArray:
        """World points (..., 2) of the centres of cells."""
        x = self.origin[0] + (np.asarray(col, dtype=float) + 0.5) * self.resolution
        y = self.origin[1] + (np.asarray(row, dtype=float) + 0.5) * self.resolution
        return np.stack(np.broadcast_arrays(x, y), axis=-1)

    def contains(self, points: npt.ArrayLike) -> BoolArray:
        """Whether world points (n, 2) lie on the map."""
        row, col = self.cell_of(points)
        return np.asarray((row >= 0) & (row < self.shape[0]) & (col >= 0) & (col < self.shape[1]))

    def with_p_occupied(self, p_occupied: npt.ArrayLike) -> "OccupancyGrid":
        """A map of the same cells with other values."""
        return OccupancyGrid(
            p_occupied=np.asarray(p_occupied, dtype=np.float32), resolution=self.resolution, origin=self.origin
        )


def blank_grid(bounds: tuple[float, float, float, float], *, resolution: float, p_occupied: float) -> OccupancyGrid:
    """A map with one value everywhere over (x_min, y_min, x_max, y_max) [m], its edges on multiples of the resolution."""
    low = np.floor(np.array(bounds[:2]) / resolution + 1e-9)
    high = np.maximum(np.ceil(np.array(bounds[2:]) / resolution - 1e-9), low + 1)
    cols, rows = (high - low).astype(int)
    x, y = low * resolution
    return OccupancyGrid(
        p_occupied=np.full((rows, cols), p_occupied, dtype=np.float32),
        resolution=resolution,
        origin=(float(x), float(y)),
    )


def cells_inside(grid: OccupancyGrid, area: BaseGeometry) -> BoolArray:
    """Cells (rows, cols) whose centre lies inside `area`, of polygons.

    Each side of the area turns all cells to its right, row by row, inside out: what is left inside lies in it. Some ten
    times faster than a point-in-polygon test of every centre, which it equals but for centres exactly on a side.
    """
    rows, cols = grid.shape
    toggles = np.zeros((rows, cols + 1), dtype=bool)
    for ring in shapely.get_parts(area.boundary):
        x, y = ((shapely.get_coordinates(ring) - grid.origin) / grid.resolution - 0.5).T  # in cells, from the first centre
        low, high = np.minimum(y[:-1], y[1:]), np.maximum(y[:-1], y[1:])
        first, end = (np.clip(np.ceil(limit), 0, rows).astype(np.intp) for limit in (low, high))  # rows that a side crosses
        side = np.repeat(np.arange(len(first)), end - first)
        row = np.arange(len(side)) - np.repeat(np.cumsum(end - first) - end, end - first)
        crossing = x[side] + (row - y[side]) / (y[side + 1] - y[side]) * (x[side + 1] - x[side])
        np.logical_xor.at(toggles, (row, np.clip(np.ceil(crossing), 0, cols).astype(np.intp)), True)
    return np.logical_xor.accumulate(toggles, axis=1)[:, :cols]


def write_map(grid: OccupancyGrid, folder: Path, *, name: str = "map") -> Path:
    """Write NAME.pgm and NAME.yaml for ROS map_server (mode "scale": grey is probability); returns the path of the YAML.

    The image's first row is the map's top. Grey = 255 (1 - p): p comes back within 1/510.
    """
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
        "width": grid.shape[1],  # not map_server's keys (it ignores them): they tell when the image is another one
        "height": grid.shape[0],
    }
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(metadata, sort_keys=False), encoding="utf-8")
    return path


def read_map(path: Path) -> OccupancyGrid:
    """The map of a ROS map_server YAML file (modes trinary, scale, raw) and its image.

    A trinary map becomes 0, 0.5 (unknown) and 1 by the file's own thresholds. Raises MapError where the two files do not
    fit together. Source: ROS map_server documentation, "Value Interpretation".
    """
    metadata = _read_metadata(path)
    image = _read_image(path, metadata)
    grey, alpha = (image[..., 0], image[..., 1]) if image.ndim == 3 else (image, None)
    mode = metadata.get("mode", "trinary")
    if mode == "raw":  # occupancy values 0..100; 255 and all else is unknown
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
    given = {key: metadata.get(key, usual) for key, usual in _USUAL_THRESHOLDS.items()}
    for key, value in given.items():
        if not isinstance(value, int | float) or not 0 <= value <= 1:
            raise MapError(f"{path}: {key}={value!r} must be a probability in [0, 1]")
    return given


def _read_image(path: Path, metadata: dict[str, Any]) -> npt.NDArray[np.uint8]:
    image_path = path.parent / str(metadata["image"])
    try:
        # Pillow looks at the size before it reads a pixel, and warns of what it takes for a bomb.
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
