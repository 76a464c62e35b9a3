"""Demand and additional files rewritten for cut edges, element by element; the rest of each file stays byte for byte.

Each rule says for one kind of element which piece of a cut edge it means now. Elements without a rule carry no edge, lane or
position of the network.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from wzsumo.errors import PlacementError
from wzsumo.placement.cuts import CutEdge
from wzsumo.placement.xml_file import Change, Edits, Element, XmlFile


@dataclass(eq=False)
class Rewriting:
    """The rewriting of all files of one configuration; what was changed and what is doubtful gathers here."""

    cuts: dict[str, CutEdge]  # by the old id
    routes: dict[str, list[str]]  # edges by the id of a route, of all files
    rules: "dict[str, Rule]"  # by the element's tag
    lane_counts: dict[str, int]  # of the network's edges, by id
    closed_lanes: frozenset[str] = frozenset()  # ids of pieces' lanes that the zone closes
    changes: list[Change] = field(default_factory=list)
    departures: Counter[str] = field(default_factory=Counter)  # vehicles that depart on a cut edge, by edge
    doubts: list[str] = field(default_factory=list)

    def rewrite(self, file: XmlFile) -> bytes:
        """The file's bytes, rewritten. Raises PlacementError where an element cannot be kept."""
        rewritten = RewrittenFile(file=file, rewriting=self, edits=Edits(file))
        file.root_and_children(lambda element: rewritten.visit(element, None))
        return rewritten.edits.apply() if rewritten.edits else file.data


@dataclass(frozen=True, kw_only=True, eq=False)
class RewrittenFile:
    """One file on its way: what rules read of the cuts, and how they change elements."""

    file: XmlFile
    rewriting: Rewriting
    edits: Edits

    @property
    def cuts(self) -> dict[str, CutEdge]:
        """The cut edges by their old ids."""
        return self.rewriting.cuts

    def visit(self, element: Element, parent: Element | None) -> None:
        """Apply the rules to an element and to all below it."""
        if rule := self.rewriting.rules.get(element.tag):
            rule(self, element, parent)
        for child in element.children:
            self.visit(child, element)

    def set(self, element: Element, values: dict[str, str | None], what: str) -> None:
        """Give an element new attributes, None for those that go, and note it."""
        if values:
            self.edits.set_attributes(element, values)
            to = " ".join(f"{key}={value}" for key, value in values.items() if value is not None)
            self.note(element, what, to)

    def append_children(self, element: Element, rows: list[str], what: str) -> None:
        """Add children to an element as their text says."""
        text, data = "".join(f"\n        {row}" for row in rows), self.file.data
        if not element.children and data[element.end - 2 : element.end] == b"/>":
            self.edits.replace(element.end - 2, element.end, f">{text}\n    </{element.tag}>")
        else:
            self.edits.insert(data.rindex(b"</", element.begin, element.end), f"{text.lstrip()}\n    ")
        self.note(element, what, " ".join(rows))

    def repeat(self, element: Element, key: str, values: list[str], what: str) -> None:
        """Let an element stand once for each of several values of an attribute."""
        text = self.file.data[element.begin : element.end].decode(self.file.encoding)
        given = element.get(key)
        for value in values[1:]:
            copy = text.replace(f'{key}="{given}"', f'{key}="{value}"').replace(f"{key}='{given}'", f"{key}='{value}'")
            self.edits.insert(element.end, copy)
        self.set(element, {key: values[0]}, what)

    def note(self, element: Element, what: str, to: str) -> None:
        """Put a change on record."""
        change = Change(file=self.file.path.name, element=element.tag, id=element.get("id"), what=what, to=to)
        self.rewriting.changes.append(change)

    def cut_edge(self, edge: str) -> CutEdge | None:
        """The cuts of an edge; None where it is not cut. Raises PlacementError where the network has no such edge."""
        if edge not in self.rewriting.lane_counts:
            raise PlacementError(f"{self.file.path}: the network has no edge {edge!r}; give the files of this network")
        return self.cuts.get(edge)

    def cut_lane(self, lane: str) -> tuple[CutEdge | None, str]:
        """The cut edge of a lane and the lane's index; no edge where it is not cut, or no lane is named.

        Raises PlacementError where the network has no such lane.
        """
        edge, index = split_lane(lane)
        if lane and not (index.isdecimal() and int(index) < self.rewriting.lane_counts.get(edge, 0)):
            raise PlacementError(f"{self.file.path}: the network has no lane {lane!r}; give the files of this network")
        return self.cuts.get(edge), index

    def first_piece(self, edge: str) -> str:
        """The piece on which an edge begins."""
        cut = self.cut_edge(edge)
        return cut.ids[0] if cut else edge

    def pieces(self, edge: str) -> tuple[str, ...]:
        """All pieces of an edge; the edge itself where it is not cut."""
        cut = self.cut_edge(edge)
        return cut.ids if cut else (edge,)


Rule = Callable[[RewrittenFile, Element, Element | None], None]


def split_lane(lane: str) -> tuple[str, str]:
    """(edge, index) of a lane's id."""
    edge, _, index = lane.rpartition("_")
    return edge, index


def from_start(position: float, cut: CutEdge) -> float:
    """A position from the edge's beginning [m]: SUMO counts negative ones from its end."""
    return position if position >= 0 else position + cut.edge.length
