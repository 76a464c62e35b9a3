"""What becomes of elements that stand at a place of a lane, or along it: detectors, stops, points to draw."""

import math

from wzsumo.errors import PlacementError
from wzsumo.placement.cuts import CutEdge, number_text
from wzsumo.placement.demand_files.rewriting import RewrittenFile, Rule, from_start
from wzsumo.placement.demand_files.vehicles import number_in
from wzsumo.placement.xml_file import Element

Values = dict[str, str | None]


def rewrite_point(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """What stands at a position of a lane stands there on its piece."""
    cut, index = file.cut_lane(element.get("lane"))
    if cut:
        number, on_piece = cut.on_piece(from_start(number_in(element.get("pos")) or 0.0, cut))
        file.set(element, {"lane": f"{cut.ids[number]}_{index}", "pos": number_text(on_piece)}, "moved to its piece")


def rewrite_stretch(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """A stop lies on one piece. Raises PlacementError where a cut runs through it, or on a lane that the zone closes."""
    name = f"{element.tag} {element.get('id')!r}" if element.get("id") else "a stop of a vehicle"
    _refuse_in_closed_lane(file, element.get("lane"), name, element.get("lane"))
    cut, index = file.cut_lane(element.get("lane"))
    edge_cut = file.cuts.get(element.get("edge"))
    if cut is None and edge_cut is None:
        return
    cut = cut or edge_cut
    assert cut is not None  # noqa: S101 for the reader of types
    start, end = _stretch(element, cut)
    number, end_on_piece = cut.on_piece(end, ends=True)
    start_on_piece = start - cut.bounds[number]
    if start_on_piece < 0:
        at = cut.positions[number - 1]
        raise PlacementError(
            f"{file.file.path}: {name} lies on edge {cut.edge.id!r} from {start:.1f} to {end:.1f} m, where the zone cuts it at "
            f"{at:.1f} m; move the zone by more than {math.ceil(min(end - at, at - start))} m, or the stop"
        )
    _refuse_in_closed_lane(file, f"{cut.ids[number]}_{index}", name, element.get("lane"))
    values: Values = {"edge": cut.ids[number]} if edge_cut else {"lane": f"{cut.ids[number]}_{index}"}
    if element.get("startPos") or (start_on_piece > 0 and element.tag != "stop"):
        values["startPos"] = number_text(start_on_piece)
    if element.get("endPos") or number < len(cut.ids) - 1:
        values["endPos"] = number_text(end_on_piece)
    file.set(element, values, "moved to its piece")


def rewrite_lane_area(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """A lane-area detector lies on its piece, or over several as a list of lanes."""
    values = _over_lanes(file, element) if element.get("lanes") else _on_lane(file, element)
    cut, index = file.cut_lane(element.get("to"))  # the lane behind the signal up to which it counts
    if cut:
        values["to"] = f"{cut.ids[0]}_{index}"
    file.set(element, values, "lies on the pieces")


def _refuse_in_closed_lane(file: RewrittenFile, lane: str, name: str, old_lane: str) -> None:
    if lane in file.rewriting.closed_lanes:
        raise PlacementError(
            f"{file.file.path}: {name} lies on lane {old_lane!r} where the zone closes it; move the stop, or the zone"
        )


def _stretch(element: Element, cut: CutEdge) -> tuple[float, float]:
    """Positions [m] between which a stop lies; those left out are SUMO's: the whole lane, for a vehicle's stop its end."""
    given_end, given_start = number_in(element.get("endPos")), number_in(element.get("startPos"))
    end = from_start(given_end, cut) if given_end is not None else cut.edge.length
    if given_start is not None:
        return from_start(given_start, cut), end
    return (end if element.tag == "stop" else 0.0), end


def _on_lane(file: RewrittenFile, element: Element) -> Values:
    cut, index = file.cut_lane(element.get("lane"))
    if cut is None:
        return {}
    start, end = _area(element, cut)
    first, start_on_piece = cut.on_piece(start)
    last, end_on_piece = cut.on_piece(min(end, cut.edge.length), ends=True)
    if first >= last:
        values: Values = {"lane": f"{cut.ids[first]}_{index}"}
        values |= {"pos": number_text(start_on_piece)} if element.get("pos") else {}
        return values | ({"endPos": number_text(end_on_piece)} if element.get("endPos") else {})
    lanes = " ".join(f"{cut.ids[number]}_{index}" for number in range(first, last + 1))
    ends: Values = {"pos": number_text(start_on_piece), "endPos": number_text(end_on_piece)}
    return {"lane": None, "length": None, "lanes": lanes} | ends


def _area(element: Element, cut: CutEdge) -> tuple[float, float]:
    """Positions [m] between which a lane-area detector on one lane lies, given by two of pos, endPos and length."""
    start, end, length = (number_in(element.get(key)) for key in ("pos", "endPos", "length"))
    if start is not None:
        start = from_start(start, cut)
        if end is not None:
            return start, from_start(end, cut)
        return start, start + length if length is not None else cut.edge.length
    end = from_start(end, cut) if end is not None else cut.edge.length
    return (max(end - length, 0.0) if length is not None else 0.0), end


def _over_lanes(file: RewrittenFile, element: Element) -> Values:
    lanes, values, now = element.get("lanes").split(), {}, []
    for place, lane in enumerate(lanes):
        cut, index = file.cut_lane(lane)
        if cut is None:
            now.append(lane)
            continue
        first, last = 0, len(cut.ids) - 1
        if place == 0 and (position := number_in(element.get("pos"))) is not None:
            first, on_piece = cut.on_piece(from_start(position, cut))
            values["pos"] = number_text(on_piece)
        if place == len(lanes) - 1 and (position := number_in(element.get("endPos"))) is not None:
            last, on_piece = cut.on_piece(from_start(position, cut), ends=True)
            values["endPos"] = number_text(on_piece)
        now += [f"{cut.ids[number]}_{index}" for number in range(first, last + 1)]
    return {**values, "lanes": " ".join(now)} if now != lanes else {}


LANE_RULES: dict[str, Rule] = {
    **dict.fromkeys(
        ("e1Detector", "inductionLoop", "instantInductionLoop", "detEntry", "detExit", "poi", "access"), rewrite_point
    ),
    **dict.fromkeys(
        ("busStop", "trainStop", "containerStop", "chargingStation", "parkingArea", "overheadWireSegment", "stop"),
        rewrite_stretch,
    ),
    **dict.fromkeys(("e2Detector", "laneAreaDetector"), rewrite_lane_area),
}
