"""What becomes of elements that name whole edges: traffic zones, rerouters, signs, output by edge."""

from collections.abc import Callable

from wzsumo.errors import PlacementError
from wzsumo.placement.demand_files.rewriting import RewrittenFile, Rule, split_lane
from wzsumo.placement.demand_files.vehicles import number_in
from wzsumo.placement.xml_file import Element, start_tag


def list_pieces(file: RewrittenFile, element: Element, key: str) -> None:
    """A list of edges lists all pieces."""
    _rewrite_list(file, element, key, file.pieces)


def refuse_other_file(file: RewrittenFile, element: Element, key: str) -> None:
    """Raise PlacementError where an element has its content in a file of its own, which no option names."""
    if element.get(key):
        raise PlacementError(
            f"{file.file.path}: <{element.tag}> reads {key}={element.get(key)!r}, which is not rewritten; put its content "
            "here instead"
        )


def refuse_inclusion(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """Raise PlacementError for a file that includes another."""
    refuse_other_file(file, element, "href")


def rewrite_output(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """Output by edge or lane tells of all pieces, which are then to be added up."""
    refuse_other_file(file, element, "edgesFile")
    list_pieces(file, element, "edges")


def rewrite_speed_sign(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """A variable speed sign holds on all pieces."""
    refuse_other_file(file, element, "file")

    def lanes(lane: str) -> tuple[str, ...]:
        cut, index = file.cut_lane(lane)
        return tuple(f"{piece}_{index}" for piece in cut.ids) if cut else (lane,)

    _rewrite_list(file, element, "lanes", lanes)


def rewrite_rerouter(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """A rerouter acts where the edge begins; vehicles that depart further on do not meet it."""
    refuse_other_file(file, element, "file")
    if cut := [edge for edge in element.get("edges").split() if edge in file.cuts]:
        file.rewriting.doubts.append(
            f"rerouter {element.get('id')!r} acts on the first piece of {', '.join(cut)}: vehicles that depart on the others "
            "do not meet it"
        )
    _rewrite_list(file, element, "edges", lambda edge: (file.first_piece(edge),))


def rewrite_zone(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """A cut edge of a traffic zone stays one source and one sink: as a list of pieces it would count once for each."""
    ids = element.get("edges").split()
    cut = [id_ for id_ in ids if file.cut_edge(id_)]
    if cut:
        kept = " ".join(id_ for id_ in ids if id_ not in file.cuts)
        file.set(element, {"edges": kept or None}, "lists source and sink of a cut edge by themselves")
        rows = [f'<tazSource id="{file.cuts[id_].ids[0]}" weight="1"/>' for id_ in cut]
        rows += [f'<tazSink id="{file.cuts[id_].ids[-1]}" weight="1"/>' for id_ in cut]
        file.append_children(element, rows, "source and sink")


def repeat_for_pieces(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """A closing of an edge or a lane is repeated for each piece."""
    edge, index = split_lane(element.get("id")) if element.tag == "closingLaneReroute" else (element.get("id"), "")
    if edge in file.cuts:
        ids = [f"{piece}_{index}" if index else piece for piece in file.cuts[edge].ids]
        file.repeat(element, "id", ids, f"repeated for {', '.join(ids)}")


def share_weight(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """The weight of an edge, as a file of travel times gives it, is shared among the pieces by their lengths."""
    cut = file.cuts.get(element.get("id"))
    if cut is None:
        return
    rows = []
    for number, piece in enumerate(cut.ids):
        share = (cut.bounds[number + 1] - cut.bounds[number]) / cut.edge.length
        values = element.attributes | {"id": piece}
        for key in ("traveltime", "effort"):
            if (value := number_in(element.get(key))) is not None:
                values[key] = f"{value * share:.3f}"
        rows.append(start_tag("edge", values, empty=True))
    file.edits.replace(element.begin, element.end, "".join(rows))
    file.note(element, "shared by length", ", ".join(cut.ids))


def refuse_calibrator(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """Raise PlacementError for a calibrator on a cut edge."""
    edge = element.get("edge") or split_lane(element.get("lane"))[0]
    if edge in file.cuts:
        raise PlacementError(
            f"{file.file.path}: calibrator {element.get('id')!r} acts on edge {edge!r} as a whole, which the zone cuts; move "
            "the zone to another edge, or the calibrator"
        )


def _renamed(key: str, *, last: bool) -> Rule:
    """A rule: the edge under `key` is its first, or its last piece."""

    def rule(file: RewrittenFile, element: Element, _: Element | None) -> None:
        if element.get(key) in file.cuts:
            file.set(element, {key: file.cuts[element.get(key)].ids[-1 if last else 0]}, "renamed")

    return rule


def _rewrite_list(file: RewrittenFile, element: Element, key: str, pieces: Callable[[str], tuple[str, ...]]) -> None:
    given = element.get(key)
    separator = "," if "," in given else " "
    ids = given.replace(",", " ").split()
    now = [piece for id_ in ids for piece in pieces(id_)]
    if now != ids:
        file.set(element, {key: separator.join(now)}, "lists the pieces")


EDGE_RULES: dict[str, Rule] = {
    "include": refuse_inclusion,
    "edgeData": rewrite_output,
    "laneData": rewrite_output,
    "variableSpeedSign": rewrite_speed_sign,
    "taz": rewrite_zone,
    "tazSource": _renamed("id", last=False),
    "tazSink": _renamed("id", last=True),
    "rerouter": rewrite_rerouter,
    "routeProbe": _renamed("edge", last=False),
    "viaProbReroute": _renamed("id", last=False),
    "destProbReroute": _renamed("id", last=True),
    **dict.fromkeys(("closingReroute", "closingLaneReroute", "vaporizer"), repeat_for_pieces),
    "calibrator": refuse_calibrator,
    "edge": share_weight,
}
