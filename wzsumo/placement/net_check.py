"""Whether a network's numbers and references are whole, before anything is made of them.

SUMO's files come from many tools and hands. What is read later trusts that each number is one, each shape has points, and each
connection joins lanes that are there.
"""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from wzsumo.errors import MAX_SHOWN, PlacementError
from wzsumo.placement.xml_file import Element

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,2})?"
_NUMBERS = re.compile(_NUMBER)
_SHAPE = re.compile(rf"\s*{_NUMBER},{_NUMBER}(?:,{_NUMBER})?(?:\s+{_NUMBER},{_NUMBER}(?:,{_NUMBER})?)+\s*")
_PAIR = re.compile(rf"{_NUMBER},{_NUMBER}")
_REMEDY = "give the file as netconvert or netedit wrote it, or build it anew with netconvert"


def whole_number(path: Path, element: Element, key: str) -> int:
    """The index that an attribute holds, 0 where there is none. Raises PlacementError where it holds something else."""
    text = element.get(key, "0")
    if not text.isdecimal():
        raise PlacementError(f"{path}: <{element.tag}> has {key}={text!r}, which is no lane's index; {_REMEDY}")
    return int(text)


def check_numbers(path: Path, edges: Iterable[Element], junctions: Iterable[Element], *, location: Mapping[str, str]) -> None:
    """Raise PlacementError where a length, speed, width, shape or place is none."""
    for edge in edges:
        lanes = [child for child in edge.children if child.tag == "lane"]
        if not lanes:
            raise PlacementError(
                f"{path}: edge {edge.get('id')!r} has no lanes; a plain edge file is no network: build it with netconvert"
            )
        for lane in lanes:
            _check_lane(path, lane)
    for node in junctions:
        for key in ("x", "y"):
            if not _NUMBERS.fullmatch(node.get(key)):
                raise _fault(path, f"junction {node.get('id')!r}", key, node.get(key), "which is no number")
    if not _PAIR.fullmatch(location.get("netOffset", "0,0")):
        raise _fault(path, "<location>", "netOffset", location["netOffset"], "which is no pair x,y")


def check_references(path: Path, connections: Iterable[Element], *, lane_counts: Mapping[str, int]) -> None:
    """Raise PlacementError where a connection names an edge or a lane that the network has not."""
    for link in connections:
        first, last = link.get("from"), link.get("to")
        lanes = [(key, f"{link.get(key)}_{link.get(f'{key}Lane', '0')}") for key in ("from", "to")]
        for key, lane in [*lanes, ("via", link.get("via"))]:
            edge, _, index = lane.rpartition("_")
            if lane and not (index.isdecimal() and int(index) < lane_counts.get(edge, 0)):
                raise PlacementError(
                    f"{path}: the connection from {first!r} to {last!r} names lane {lane!r} under {key!r}, which the network "
                    f"has not; {_REMEDY}"
                )


def _check_lane(path: Path, lane: Element) -> None:
    """Raise PlacementError where a lane has no length or width above 0, no speed, or no shape."""
    for key, least in (("length", 0.01), ("speed", 0.0), ("width", 0.01)):
        text = lane.get(key, "1" if key == "width" else "")
        if not (_NUMBERS.fullmatch(text) and float(text) >= least):
            raise _fault(path, f"lane {lane.get('id')!r}", key, text, f"which must be at least {least:g}")
    if not _SHAPE.fullmatch(lane.get("shape")):
        raise _fault(path, f"lane {lane.get('id')!r}", "shape", lane.get("shape"), "which is no list of points")


def _fault(path: Path, what: str, key: str, given: str, rule: str) -> PlacementError:
    return PlacementError(f"{path}: {what} has {key}={given[:MAX_SHOWN]!r}, {rule}; {_REMEDY}")
