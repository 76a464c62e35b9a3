"""The network with the zone's cuts, with nothing closed or with the zone's lanes closed; all else as it is in its file."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from wzsumo.placement.cuts import CutEdge, number_text, text_of_shape
from wzsumo.placement.lane_states import ClosedLanes, Piece
from wzsumo.placement.net import Net, NetLane, point_on
from wzsumo.placement.xml_file import Change, Edits, Element, start_tag

ONLY_AT_THE_END = ("stopOffset",)  # children of an edge or a lane that count from its end
Lanes = dict[int, dict[str, str | None]]


@dataclass(eq=False)
class NetPatch:
    """The changes of one network; `closed` tells what the zone makes of the lanes, None leaves all of them open."""

    net: Net
    cuts: dict[str, CutEdge]  # by the old id
    closed: ClosedLanes | None
    changes: list[Change] = field(default_factory=list)

    def apply(self) -> bytes:
        """The patched file; what was changed is then in `changes`."""
        edits = Edits(self.net.file)
        for cut in self.cuts.values():
            self._replace_edge(cut, edits)
        self._rename(edits)
        if self.closed:
            self._change_whole_edges(self.closed, edits)
        return edits.apply()

    def _pieces_of(self, cut: CutEdge) -> list[Piece]:
        pieces = self.closed.pieces if self.closed else []
        return [piece for piece in pieces if piece.link.edge.id == cut.edge.id]

    def _replace_edge(self, cut: CutEdge, edits: Edits) -> None:
        element, net, states = cut.edge.element, self.net, self._pieces_of(cut)
        nodes = [cut.edge.from_node, *cut.nodes(), cut.edge.to_node]
        edges = [
            self._edge_text(cut, number, nodes[number : number + 2], states[number].lanes if states else {})
            for number in range(len(cut.ids))
        ]
        edits.replace(element.begin, element.end, "\n    ".join(edges))
        junctions, connections = [], []
        for number, (first, second) in enumerate(pairwise(cut.ids)):
            onward = {lane.index: lane.index for lane in cut.edge.lanes}
            if states and self.closed:
                onward = self.closed.leads_to(states[number], states[number + 1])
            junctions.append(self._junction_text(cut, number, n_links=len(onward)))
            connections += [_connection_text(first, second, lane, to) for lane, to in sorted(onward.items())]
        edits.insert(net.junctions_end, "".join(f"\n    {text}" for text in junctions))
        edits.insert(net.connections_begin, "".join(f"{text}\n    " for text in connections))
        self._note(element, "cut into pieces", f"{', '.join(cut.ids)} at {', '.join(f'{p:.2f} m' for p in cut.positions)}")
        for piece in states:
            self._note_lanes(piece.id, piece.lanes)

    def _edge_text(self, cut: CutEdge, number: int, nodes: list[str], lanes: Lanes) -> str:
        data, element, last = self.net.file, cut.edge.element, number == len(cut.ids) - 1
        attributes = dict(element.attributes) | {"id": cut.ids[number], "from": nodes[0], "to": nodes[1]}
        if shape := element.get("shape"):
            attributes["shape"] = cut.shape_text(shape, number)
        if distance := element.get("distance"):
            attributes["distance"] = f"{float(distance) + cut.bounds[number]:.2f}"
        rows = [start_tag("edge", attributes, empty=False)]
        for lane in cut.edge.lanes:
            own = dict(lane.element.attributes) | {
                "id": f"{cut.ids[number]}_{lane.index}",
                "length": number_text(cut.lane_length(lane, number)),
                "shape": cut.shape_text(lane.element.get("shape"), number),
            }
            if not last:
                own.pop("endOffset", None)
            own = {key: value for key, value in (own | lanes.get(lane.index, {})).items() if value is not None}
            kept = [child for child in lane.element.children if last or child.tag not in ONLY_AT_THE_END]
            rows.append("    " + start_tag("lane", own, empty=not kept))
            rows += [f"        {_text_of(data.data, child, data.encoding)}" for child in kept]
            rows += ["    </lane>"] if kept else []
        others = [child for child in element.children if child.tag != "lane" and (last or child.tag not in ONLY_AT_THE_END)]
        rows += [f"    {_text_of(data.data, child, data.encoding)}" for child in others]
        rows.append(f"    {start_tag('param', {'key': 'origId', 'value': cut.edge.id}, empty=True)}")
        return "\n    ".join([*rows, "</edge>"])

    def _junction_text(self, cut: CutEdge, number: int, *, n_links: int) -> str:
        position, lanes = cut.positions[number], cut.edge.lanes
        right, left = (_edge_point(lane, position, cut, side) for lane, side in ((lanes[0], -1), (lanes[-1], 1)))
        middle = (right + left) / 2
        attributes = {
            "id": cut.nodes()[number],
            "type": "priority",
            "x": f"{middle[0]:.2f}",
            "y": f"{middle[1]:.2f}",
            "incLanes": " ".join(f"{cut.ids[number]}_{lane.index}" for lane in lanes),
            "intLanes": "",
            "shape": text_of_shape(np.array([right, left])),
        }
        none = "0" * n_links
        rows = [
            start_tag("request", {"index": str(i), "response": none, "foes": none, "cont": "0"}, empty=True)
            for i in range(n_links)
        ]
        return "\n        ".join([start_tag("junction", attributes, empty=False), *rows]) + "\n    </junction>"

    def _rename(self, edits: Edits) -> None:
        """Cut edges by the ids of their pieces in connections, junctions, roundabouts and crossings."""
        cuts = self.cuts
        for link in self.net.connections:
            values: dict[str, str | None] = {}
            if link.from_edge in cuts:
                values["from"] = cuts[link.from_edge].ids[-1]
            if link.to_edge in cuts:
                values["to"] = cuts[link.to_edge].ids[0]
            if values:
                edits.set_attributes(link.element, values)
                self._note(link.element, "renamed", " ".join(f"{key}={value}" for key, value in values.items()))
        incoming = {lane.id: f"{cut.ids[-1]}_{lane.index}" for cut in cuts.values() for lane in cut.edge.lanes}
        for junction in self.net.junctions.values():
            lanes = junction.get("incLanes").split()
            if any(lane in incoming for lane in lanes):
                renamed = " ".join(incoming.get(lane, lane) for lane in lanes)
                edits.set_attributes(junction, {"incLanes": renamed})
                self._note(junction, "renamed", f"incLanes={renamed}")
        for element, key, renamed in self._lists_of_edges():
            edits.set_attributes(element, {key: renamed})
            self._note(element, "renamed", f"{key}={renamed}")

    def _lists_of_edges(self) -> Iterator[tuple[Element, str, str]]:
        for element in self.net.roundabouts:
            ids = element.get("edges").split()
            if any(id_ in self.cuts for id_ in ids):
                pieces = [piece for id_ in ids for piece in (self.cuts[id_].ids if id_ in self.cuts else (id_,))]
                yield element, "edges", " ".join(pieces)
        for edge in self.net.edges.values():
            ids = edge.element.get("crossingEdges").split()
            if any(id_ in self.cuts for id_ in ids):
                yield edge.element, "crossingEdges", " ".join(self._crossed_piece(id_, edge.id) for id_ in ids)

    def _crossed_piece(self, id_: str, crossing: str) -> str:
        """The piece that a crossing of a junction, :JUNCTION_c0, leads over."""
        if id_ not in self.cuts:
            return id_
        cut = self.cuts[id_]
        return cut.ids[-1] if crossing[1:].rpartition("_c")[0] == cut.edge.to_node else cut.ids[0]

    def _change_whole_edges(self, closed: ClosedLanes, edits: Edits) -> None:
        for piece in closed.pieces:
            if piece.link.edge.id not in self.cuts:
                for index, values in piece.lanes.items():
                    edits.set_attributes(piece.link.edge.lanes[index].element, values)
                self._note_lanes(piece.id, piece.lanes)
        for lane_id, values in closed.via_lanes.items():
            edits.set_attributes(self.net.lane_of(lane_id).element, values)
            self._note_values("lane", lane_id, values)

    def _note_lanes(self, edge: str, lanes: Lanes) -> None:
        for index, values in sorted(lanes.items()):
            self._note_values("lane", f"{edge}_{index}", values)

    def _note_values(self, tag: str, id_: str, values: dict[str, str | None]) -> None:
        told = ", ".join(f"{key} {'goes' if value is None else value}" for key, value in values.items() if key != "shape")
        bent = "bent; " if "shape" in values else ""
        self.changes.append(Change(file=self.net.file.path.name, element=tag, id=id_, what="lane of the zone", to=bent + told))

    def _note(self, element: Element, what: str, to: str) -> None:
        id_ = (
            element.get("id")
            or f"{element.get('from')}_{element.get('fromLane')} -> {element.get('to')}_{element.get('toLane')}"
        )
        self.changes.append(Change(file=self.net.file.path.name, element=element.tag, id=id_, what=what, to=to))


def _connection_text(first: str, second: str, from_lane: int, to_lane: int) -> str:
    attributes = {"from": first, "to": second, "fromLane": str(from_lane), "toLane": str(to_lane), "dir": "s", "state": "M"}
    return start_tag("connection", attributes, empty=True)


def _edge_point(lane: NetLane, position: float, cut: CutEdge, side: int) -> np.ndarray:
    """The point (2,) beside a lane, at its edge, where it is cut; side +1 is the left."""
    at = position / cut.edge.length * lane.length
    here, ahead = point_on(lane, at), point_on(lane, min(at + 1.0, lane.length))
    along = ahead - here
    normal = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
    return np.asarray(here + side * normal * lane.width / 2)


def _text_of(data: bytes, element: Element, encoding: str) -> str:
    return data[element.begin : element.end].decode(encoding)
