"""A live map as a file: the same bytes for the same map, read back to the same map."""

import io
import json
import zipfile
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from wzsumo.errors import MapError
from wzsumo.lane_map import LaneMap, MappedBranch, MappedLane
from wzsumo.live.ageing import Witnesses
from wzsumo.live.charts.findings import Family, Finding
from wzsumo.live.charts.lane_charts import LaneCharts
from wzsumo.live.charts.passing_charts import PassingCharts
from wzsumo.live.charts.shape_charts import ShapeCharts
from wzsumo.live.ground import Ground
from wzsumo.live.live_map import LiveMap, Redrawing
from wzsumo.live.trace.recent import RecentTrace
from wzsumo.road import Road

FORMAT = 2
_KINDS = {
    kind.__name__: kind
    for kind in (
        LaneMap,
        MappedBranch,
        MappedLane,
        Road,
        Ground,
        LiveMap,
        Redrawing,
        Finding,
        LaneCharts,
        PassingCharts,
        RecentTrace,
        ShapeCharts,
        Witnesses,
    )
}
_BORN = (1980, 1, 1, 0, 0, 0)  # of all members of the archive: the time of writing must not change its bytes


def state_bytes(live: LiveMap, about: dict[str, Any]) -> bytes:
    """The content of a state file: a live map, and plain values about how far its stream was read."""
    arrays: list[Any] = []
    tree = {"format": FORMAT, "about": about, "live": _plain(live, arrays)}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(zipfile.ZipInfo("state.json", _BORN), json.dumps(tree))
        for number, array in enumerate(arrays):
            part = io.BytesIO()
            np.save(part, array, allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{number}.npy", _BORN), part.getvalue(), zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def read_state(content: bytes, *, source: str) -> tuple[LiveMap, dict[str, Any]]:
    """(the live map, the values about its stream) of a state file. Raises MapError where it is cut off."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            tree = json.loads(archive.read("state.json"))
            if tree["format"] != FORMAT:
                raise MapError(
                    f"{source}: is of format {tree['format']}, this version reads {FORMAT}; replay into a new folder"
                )
            arrays = [
                np.load(io.BytesIO(archive.read(f"{number}.npy")), allow_pickle=False)
                for number in range(len(archive.namelist()) - 1)
            ]
        live = _restored(tree["live"], arrays)
    except (zipfile.BadZipFile, KeyError, ValueError, TypeError, EOFError) as error:
        raise MapError(f"{source}: is cut off or no state of `wzsumo live` ({error}); replay into a new folder") from None
    return live, tree["about"]


def _plain(value: Any, arrays: list[Any]) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        # Only what a value was made of: what it caches is computed again.
        parts = {field.name: _plain(getattr(value, field.name), arrays) for field in fields(value)}
        return {"kind": type(value).__name__, "fields": parts}
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, tuple):
        return {"tuple": [_plain(part, arrays) for part in value]}
    if isinstance(value, Enum):
        return {"family": str(value)}
    if isinstance(value, np.generic):
        return value.item()
    return value


def _restored(value: Any, arrays: list[Any]) -> Any:
    if not isinstance(value, dict):
        return value
    if "kind" in value:
        return _KINDS[value["kind"]](**{name: _restored(part, arrays) for name, part in value["fields"].items()})
    if "array" in value:
        return arrays[value["array"]]
    if "family" in value:
        return Family(value["family"])
    return tuple(_restored(part, arrays) for part in value["tuple"])
