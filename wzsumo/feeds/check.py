"""The rules that a WZDx 4.2 work zone feed keeps: the schemas of the specification, and its business rules.

The schemas are those of the specification (CC0, see schemas/LICENSE). They refer to the GeoJSON schemas of geojson.org; the two
that are needed are written out here.
"""

import json
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from typing import Any

from jsonschema import Draft7Validator
from referencing import Registry
from referencing.jsonschema import DRAFT7

VERSION = "4.2"
_ROOT = f"https://raw.githubusercontent.com/usdot-jpo-ode/wzdx/main/schemas/{VERSION}"
_SCHEMAS = ("WorkZoneFeed", "RoadEventFeature", "BoundingBox", "Direction", "FeedInfo")
_POSITION = {"type": "array", "minItems": 2, "items": {"type": "number"}}
_PLACES = {"LineString": 2, "MultiPoint": 1}  # least number of positions (RFC 7946, 3.1)


def schema_faults(feed: Mapping[str, Any]) -> list[str]:
    """What a feed does against the schemas: place and rule of each fault, the first first."""
    found = sorted(_validator().iter_errors(feed), key=lambda error: list(map(str, error.absolute_path)))
    return [f"{_place(error.absolute_path)}: {str(error.message)[:160]}" for error in map(_innermost, found)]


def rule_faults(feed: Mapping[str, Any]) -> list[str]:
    """What a feed does against the business rules that a file alone can break (rules 2 to 5 of WZDx 4.2).

    Rule 1, a road event for each stretch of unchanged lanes, and whether all lanes are listed, only the road can tell.
    """
    info = feed.get("feed_info") or feed.get("road_event_feed_info") or {}
    sources = {source.get("data_source_id") for source in info.get("data_sources", [])}
    faults = _times_not_utc("feed_info", info, ("update_date",))
    for number, event in enumerate(feed.get("features", [])):
        place, properties = f"features[{number}]", event.get("properties", {})
        core = properties.get("core_details", {})
        if core.get("data_source_id") not in sources:
            faults.append(f"{place}: data_source_id {core.get('data_source_id')!r} is none of feed_info.data_sources (rule 4)")
        orders = [lane.get("order") for lane in properties.get("lanes", [])]
        if sorted(orders) != list(range(1, len(orders) + 1)):
            faults.append(f"{place}: orders of lanes {orders} must be 1 (leftmost) to {len(orders)}, each once (rules 2 and 3)")
        faults += _times_not_utc(place, properties, ("start_date", "end_date"))
        faults += _times_not_utc(place, core, ("creation_date", "update_date"))
    return faults


def _times_not_utc(place: str, content: Mapping[str, Any], keys: tuple[str, ...]) -> list[str]:
    return [
        f"{place}: {key}={content[key]!r} must be in UTC, as 2026-06-01T14:00:00Z (rule 5)"
        for key in keys
        if isinstance(content.get(key), str) and not content[key].endswith(("Z", "+00:00"))
    ]


@lru_cache(maxsize=1)
def _validator() -> Draft7Validator:
    folder = files("wzsumo.feeds") / "schemas"
    schemas = {f"{_ROOT}/{name}.json": json.loads((folder / f"{name}.json").read_text("utf-8")) for name in _SCHEMAS}
    for name, least in _PLACES.items():
        schemas[f"https://geojson.org/schema/{name}.json"] = {
            "type": "object",
            "required": ["type", "coordinates"],
            "properties": {"type": {"enum": [name]}, "coordinates": {"type": "array", "minItems": least, "items": _POSITION}},
        }
    resources = [(uri, DRAFT7.create_resource(schema)) for uri, schema in schemas.items()]
    registry: Registry[Any] = Registry().with_resources(resources)
    return Draft7Validator(
        schemas[f"{_ROOT}/WorkZoneFeed.json"], registry=registry, format_checker=Draft7Validator.FORMAT_CHECKER
    )


def _place(path: Any) -> str:
    words = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in path]
    return "".join(words).lstrip(".") or "feed"


def _innermost(error: Any) -> Any:
    """The fault behind a fault: of alternatives, that of the kind that the content says it is."""
    while error.context:
        branches: dict[Any, list[Any]] = {}
        for inner in error.context:
            branches.setdefault(inner.relative_schema_path[0], []).append(inner)
        fitting = [branch for branch in branches.values() if not any(inner.validator == "const" for inner in branch)]
        error = max((fitting or list(branches.values()))[0], key=lambda inner: len(inner.absolute_path))
    return error
