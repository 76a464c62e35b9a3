"""What becomes of vehicles, their types and routes, and of persons and goods, where edges are cut."""

from itertools import accumulate

from wzsumo.placement.cuts import number_text
from wzsumo.placement.demand_files.edge_rules import list_pieces
from wzsumo.placement.demand_files.rewriting import RewrittenFile, Rule, from_start
from wzsumo.placement.demand_files.vehicles import number_in, vehicles_of
from wzsumo.placement.xml_file import Element
from wzsumo.simulation.demand import LOOK_AHEAD_M

_LOOKAHEAD = "lcStrategicLookahead"
Values = dict[str, str | None]


def widen_lookahead(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """A vType's drivers look ahead over the cuts."""
    if (number_in(element.get(_LOOKAHEAD)) or 0.0) < LOOK_AHEAD_M:
        file.set(element, {_LOOKAHEAD: f"{LOOK_AHEAD_M:.0f}"}, "drivers look ahead over the cuts")


def rewrite_route(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """A route leads over all pieces."""
    list_pieces(file, element, "edges")


def rewrite_vehicle(file: RewrittenFile, element: Element, _: Element | None) -> None:
    """A vehicle, trip or flow departs and arrives where it did."""
    embedded = [child for child in element.children if child.tag == "route"]
    edges = embedded[0].get("edges").split() if embedded else file.rewriting.routes.get(element.get("route"), [])
    if edges:
        values = _places_on_route(file, element, edges)
        index = element.get("departEdge")
        start = edges[int(index)] if index.isdigit() and int(index) < len(edges) else edges[0]
    else:
        values, start = _trip_ends(file, element), element.get("from")
    if start in file.cuts:
        file.rewriting.departures[start] += vehicles_of(element)
    file.set(element, values, "departs and arrives on the pieces")


def rewrite_stage(file: RewrittenFile, element: Element, parent: Element | None) -> None:
    """A stage of a person's or a container's plan: a walk, a ride, a transport."""
    list_pieces(file, element, "edges")
    values: Values = {}
    end = element.get("to")
    if end in file.cuts:
        values |= _place(file, end, element, position_key="arrivalPos", edge_key="to", last=True)
    begin = element.get("from") or element.get("edges").partition(" ")[0]
    is_first = parent is not None and parent.children[0] is element
    if begin in file.cuts:
        cut = file.cuts[begin]
        values |= {"from": cut.ids[0]} if element.get("from") else {}
        if is_first and parent is not None:
            file.rewriting.departures[begin] += 1
            if (position := number_in(parent.get("departPos"))) is not None:
                number, on_piece = cut.on_piece(from_start(position, cut))
                values |= {"from": cut.ids[number]} if element.get("from") else {}
                file.set(parent, {"departPos": number_text(on_piece)}, "departs on the piece")
    file.set(element, values, "walks and rides on the pieces")


def _trip_ends(file: RewrittenFile, element: Element) -> Values:
    values: Values = {}
    if element.get("from") in file.cuts:
        values |= _place(file, element.get("from"), element, position_key="departPos", edge_key="from", last=False)
    if element.get("to") in file.cuts:
        values |= _place(file, element.get("to"), element, position_key="arrivalPos", edge_key="to", last=True)
    via = " ".join(file.first_piece(edge) for edge in element.get("via").split())
    return values | ({"via": via} if via != " ".join(element.get("via").split()) else {})


def _place(file: RewrittenFile, edge: str, element: Element, *, position_key: str, edge_key: str, last: bool) -> Values:
    """Edge and position of an end of a trip; without a position it begins on the first piece and ends on the last."""
    cut, position = file.cuts[edge], number_in(element.get(position_key))
    if position is None:
        return {edge_key: cut.ids[-1 if last else 0]}
    number, on_piece = cut.on_piece(from_start(position, cut), ends=last)
    return {edge_key: cut.ids[number], position_key: number_text(on_piece)}


def _places_on_route(file: RewrittenFile, element: Element, edges: list[str]) -> Values:
    """Positions of departure and arrival, and the numbers of their edges in the route, which cuts shift."""
    values: Values = {}
    begins = [0, *accumulate(len(file.pieces(edge)) for edge in edges)]
    for edge_key, position_key, last in (("departEdge", "departPos", False), ("arrivalEdge", "arrivalPos", True)):
        given, position = element.get(edge_key), number_in(element.get(position_key))
        if given and not (given.isdigit() and int(given) < len(edges)):
            continue  # such as "random"
        index = int(given) if given else (len(edges) - 1 if last else 0)
        cut = file.cuts.get(edges[index])
        number = len(cut.ids) - 1 if cut and last else 0
        if cut and position is not None:
            number, on_piece = cut.on_piece(from_start(position, cut), ends=last)
            values[position_key] = number_text(on_piece)
        now, default = begins[index] + number, begins[-1] - 1 if last else 0
        if given or now != default:
            values[edge_key] = str(now)
    return {key: value for key, value in values.items() if value != element.get(key)}


VEHICLE_RULES: dict[str, Rule] = {
    "vType": widen_lookahead,
    "route": rewrite_route,
    **dict.fromkeys(("vehicle", "trip", "flow"), rewrite_vehicle),
    **dict.fromkeys(("walk", "ride", "personTrip", "transport", "tranship"), rewrite_stage),
}
