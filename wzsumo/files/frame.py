"""frame.json: where on earth the metres of a folder's files lie."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wzsumo.errors import SpecError
from wzsumo.geography import LocalFrame
from wzsumo.input_files import read_json

FRAME_FILE = "frame.json"


def write_frame(frame: LocalFrame, folder: Path) -> None:
    """Write frame.json."""
    (folder / FRAME_FILE).write_text(json.dumps(frame.as_json(), indent=1) + "\n", encoding="utf-8")


def read_frame(folder: Path) -> LocalFrame | None:
    """The frame that a folder's frame.json states; None where there is none. Raises SpecError where it is no frame."""
    path = folder / FRAME_FILE
    if not path.is_file():
        return None
    try:
        return frame_from(read_json(path))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SpecError(
            f"{path}: states no frame ({error!r}); it holds crs and origin_m, as `wzsumo map` writes them"
        ) from None


def frame_from(content: Mapping[str, Any]) -> LocalFrame:
    """The frame that the content of a frame.json, or the member `frame` of another file, states."""
    x, y = (float(value) for value in content["origin_m"])
    return LocalFrame(crs=str(content["crs"]), origin_m=(x, y))
