"""The image of a ROS map: each pixel's brightness on the whole scale of its kind, and which pixels are transparent."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from wzsumo.errors import MapError, check_file, reading
from wzsumo.frames import BoolArray

FORMATS = ("PPM", "PNG", "BMP", "TIFF", "JPEG")
WANTED = "give a PGM or PNG of grey (8 or 16 bits), RGB or palette, with or without alpha"
MAX_PIXELS = 89_478_485  # Pillow's own limit: a quarter of a GiB of RGB
_TIFF_PHOTOMETRIC, _WHITE_IS_ZERO = 262, 0
_ORIENTATION = 274  # of TIFF and Exif; 1: as it stands


@dataclass(frozen=True, kw_only=True, eq=False)
class MapImage:
    """Brightness of pixels, the top row first: `levels` (rows, cols) from 0 (black) to `full` (white), and which are opaque."""

    levels: npt.NDArray[np.integer]
    full: int
    opaque: BoolArray | None  # None: all are


def read_map_image(path: Path) -> MapImage:
    """The image of a file. Colours count by the mean of their channels, as in map_server.

    Raises MapError where it is no image, is too large, or is of a kind without a known full scale, such as a TIFF of floats.
    """
    check_file(path, error=MapError, remedy=WANTED)
    try:
        # Pillow checks the size before it reads a pixel, and warns of images that it takes for decompression bombs.
        with (
            warnings.catch_warnings(action="error"),
            reading(path, error=MapError, remedy=WANTED),
            Image.open(path, formats=FORMATS) as image,
        ):
            _refuse_ambiguous(image, path)
            _refuse_beyond_full(image, path)
            return _brightness(image, path)
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise MapError(f"{path}: has more than {MAX_PIXELS} pixels; crop it to the road or use a coarser resolution") from None
    except Warning as doubt:
        raise MapError(f"{path}: is damaged ({doubt}); {WANTED}") from None


def _refuse_ambiguous(image: Image.Image, path: Path) -> None:
    """Raise MapError where programs differ in what they see: a tag turns the image, or it is one of several."""
    turned = image.getexif().get(_ORIENTATION, 1)
    if turned != 1:
        raise MapError(
            f"{path}: its orientation tag is {turned}, which not all programs heed; turn the pixels and save it as 1"
        )
    pages = getattr(image, "n_frames", 1)
    if pages != 1:
        raise MapError(f"{path}: holds {pages} images; a map is one: save the one that is meant")


def _refuse_beyond_full(image: Image.Image, path: Path) -> None:
    """Raise MapError where a PGM or PPM in bytes holds levels above the full scale of its header: one of the two is wrong."""
    tiles = getattr(image, "tile", [])
    decoder, _, start, about = tiles[0] if image.format == "PPM" and tiles else ("", (), 0, ())
    if decoder != "ppm" or not isinstance(about, tuple):
        return
    full = int(about[-1])
    count = image.width * image.height * len(image.getbands())
    with path.open("rb") as file:
        file.seek(start)
        most = np.frombuffer(file.read(count * (1 if full < 256 else 2)), dtype=np.uint8 if full < 256 else ">u2")
    if most.size and most.max() > full:
        raise MapError(f"{path}: holds levels up to {most.max()}, but its header says that {full} is white; correct the header")


def _brightness(image: Image.Image, path: Path) -> MapImage:
    see_through = image.info.get("transparency")
    white_is_zero = getattr(image, "tag_v2", {}).get(_TIFF_PHOTOMETRIC) == _WHITE_IS_ZERO
    deep = image.mode in {"I;16", "I;16B"} or (image.mode == "I" and image.format == "PPM")  # Pillow scales a PGM to 65535
    if deep and not white_is_zero:
        levels = np.asarray(image).astype(np.uint16)
        return MapImage(levels=levels, full=65535, opaque=None if see_through is None else levels != see_through)
    if image.mode in {"LA", "RGBA", "P", "PA"} or (see_through is not None and image.mode in {"1", "L", "RGB"}):
        pixels = np.asarray(image.convert("RGBA"))
        return MapImage(levels=pixels[..., :3].sum(axis=2, dtype=np.uint16), full=3 * 255, opaque=pixels[..., 3] == 255)
    if image.mode == "RGB":
        return MapImage(levels=np.asarray(image).sum(axis=2, dtype=np.uint16), full=3 * 255, opaque=None)
    if image.mode in {"1", "L"}:
        return MapImage(levels=np.asarray(image.convert("L")), full=255, opaque=None)
    raise MapError(f"{path}: pixels of kind {image.mode} ({image.format}) have no known full scale; {WANTED}")
