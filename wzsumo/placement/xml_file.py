"""XML files that are changed in places and stay byte for byte the same elsewhere.

SUMO's files are read with expat, which tells at which byte each element begins and ends. A change replaces these bytes alone:
comments, order, white space and whatever the toolkit does not know stay as they are.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self
from xml.parsers import expat
from xml.sax.saxutils import escape

from wzsumo.errors import MAX_SHOWN, PlacementError, one_line

_ATTRIBUTE = re.compile(rb"""\s+([^\s=<>/'"]+)\s*=\s*("[^"]*"|'[^']*')""")
_TAG_NAME = re.compile(rb"<[^\s/>]+")
_COMPRESSED = {b"\x1f\x8b": "gzip", b"PK": "zip", b"BZ": "bzip2", b"\xfd7": "xz"}  # first bytes of compressed files
MAX_DEPTH = 100  # of elements within each other; SUMO's files nest ten deep at most
MAX_SHOWN_TAG = 40  # letters of an element's name and id in a message
# What a rule raises at an attribute that does not hold what SUMO writes there: words, no number, a lane that is not there.
_UNREADABLE = (ValueError, LookupError, ArithmeticError, TypeError)
_WIDE_ENCODINGS = (b"\xff\xfe", b"\xfe\xff")  # byte order marks of UTF-16


@dataclass(slots=True, eq=False)
class Element:
    """One element: its attributes, its children, and the bytes [begin, end) that it fills in its file."""

    tag: str
    attributes: dict[str, str]
    begin: int
    end: int = 0
    children: list["Element"] = field(default_factory=list)

    def get(self, name: str, default: str = "") -> str:
        """The value of an attribute, `default` where it has none."""
        return self.attributes.get(name, default)

    def walk(self) -> Iterator["Element"]:
        """The element and all below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True, kw_only=True, eq=False)
class XmlFile:
    """An XML file in memory."""

    path: Path
    data: bytes
    encoding: str = "utf-8"

    @classmethod
    def read(cls, path: Path, *, role: str) -> Self:
        """The file at `path`. `role` names it in errors. Raises PlacementError where it is missing, compressed or in UTF-16."""
        try:
            data = path.read_bytes()
        except OSError as error:
            raise PlacementError(f"{role} {path}: cannot be read ({error.strerror}); name an existing XML file") from None
        for start, name in _COMPRESSED.items():
            if data.startswith(start):
                raise PlacementError(f"{role} {path}: is compressed ({name}); unpack it first and name the unpacked file")
        if data.startswith(_WIDE_ENCODINGS):
            raise PlacementError(f"{role} {path}: is written in UTF-16; convert it to UTF-8, as SUMO writes its files")
        declared = re.match(rb"""(?:\xef\xbb\xbf)?<\?xml[^>]*encoding=["']([\w.-]+)["']""", data)
        return cls(path=path, data=data, encoding=declared[1].decode() if declared else "utf-8")

    def root_and_children(self, on_child: Callable[[Element], None]) -> Element:
        """The root element, without children; `on_child` is called with each element below it, complete, in order.

        Raises PlacementError with line and column where the file is not XML, and with the line of an element at which
        `on_child` stumbles.
        """
        return _Reader(self, on_child).read()


@dataclass(eq=False)
class _Reader:
    file: XmlFile
    on_child: Callable[[Element], None]
    open_elements: list[Element] = field(default_factory=list)
    root: Element | None = None

    def read(self) -> Element:
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        try:
            self._parser.Parse(self.file.data, True)
        except expat.ExpatError as error:
            raise PlacementError(
                f"{self.file.path}: is not XML ({error}); give the file as SUMO's tools wrote it, whole"
            ) from None
        except (LookupError, ValueError) as error:  # of an encoding that Python does not know
            raise PlacementError(
                f"{self.file.path}: cannot be read ({error}); save it as UTF-8, as SUMO writes its files"
            ) from None
        return self.root or Element("", {}, 0)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if len(self.open_elements) >= MAX_DEPTH:
            raise PlacementError(
                f"{self.file.path}: line {self._parser.CurrentLineNumber}: elements nest more than {MAX_DEPTH} deep; give the "
                "file as SUMO's tools wrote it"
            )
        self.open_elements.append(Element(tag, attributes, self._parser.CurrentByteIndex))

    def _end(self, _tag: str) -> None:
        element, at = self.open_elements.pop(), self._parser.CurrentByteIndex
        # At the end of <a/> expat stands behind the element, at that of <a></a> on the closing tag.
        empty = not element.children and self.file.data[at - 2 : at] == b"/>"
        element.end = at if empty else self.file.data.index(b">", at) + 1
        if not self.open_elements:
            element.children = []
            self.root = element
        elif len(self.open_elements) == 1:
            self.open_elements[0].children = [element]  # the root keeps none but its last child
            self._take(element)
        else:
            self.open_elements[-1].children.append(element)

    def _take(self, element: Element) -> None:
        try:
            self.on_child(element)
        except _UNREADABLE as error:
            name = one_line(f"<{element.tag}> {element.get('id')}", limit=MAX_SHOWN_TAG).strip()
            line = self._parser.CurrentLineNumber
            raise PlacementError(
                f"{self.file.path}: line {line}, {name}: an attribute does not hold what SUMO reads there "
                f"({one_line(str(error), limit=MAX_SHOWN)}); mend it, or write the file anew with SUMO's tools"
            ) from None


@dataclass(frozen=True, kw_only=True)
class Change:
    """One element of a file and what became of it."""

    file: str
    element: str
    id: str
    what: str  # the rule
    to: str  # what stands there now

    def as_row(self) -> dict[str, str]:
        """The change as a row of changes.json."""
        return {"file": self.file, "element": self.element, "id": self.id, "what": self.what, "to": self.to}


@dataclass(eq=False)
class Edits:
    """Changes of one file, applied together by `apply`."""

    file: XmlFile
    _spans: list[tuple[int, int, int, bytes]] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self._spans)

    def replace(self, begin: int, end: int, text: str) -> None:
        """Put `text` in the place of the bytes [begin, end)."""
        self._spans.append((begin, end, len(self._spans), text.encode(self.file.encoding, "xmlcharrefreplace")))

    def insert(self, at: int, text: str) -> None:
        """Put `text` before the byte `at`."""
        self.replace(at, at, text)

    def set_attributes(self, element: Element, values: dict[str, str | None]) -> None:
        """Give attributes of an element new values; those that it has not are added at the end, those set to None go."""
        spans, end_of_tag = _attribute_spans(self.file.data, element)
        for name, value in values.items():
            if name in spans:
                whole, inner = spans[name]
                self.replace(*(whole if value is None else inner), "" if value is None else escaped(value))
            elif value is not None:
                self.insert(end_of_tag, f' {name}="{escaped(value)}"')

    def apply(self) -> bytes:
        """The file's bytes with all changes."""
        parts, at = [], 0
        for begin, end, _, text in sorted(self._spans, key=lambda span: span[:3]):
            if begin < at:
                raise ValueError(f"two changes of {self.file.path} overlap at byte {begin}")
            parts += [self.file.data[at:begin], text]
            at = end
        return b"".join([*parts, self.file.data[at:]])


def escaped(value: str) -> str:
    """An attribute's value as it is written between double quotes."""
    return escape(value, {'"': "&quot;"})


def start_tag(tag: str, attributes: dict[str, str], *, empty: bool) -> str:
    """The text of an element's start tag, closed at once where it is empty."""
    words = "".join(f' {name}="{escaped(value)}"' for name, value in attributes.items())
    return f"<{tag}{words}{'/>' if empty else '>'}"


def _attribute_spans(data: bytes, element: Element) -> tuple[dict[str, tuple[tuple[int, int], tuple[int, int]]], int]:
    """Of each attribute the bytes that it fills and those of its value; and the byte at which more can be added."""
    name = _TAG_NAME.match(data, element.begin)
    at, spans = name.end() if name else element.begin, {}
    while found := _ATTRIBUTE.match(data, at):
        at = found.end()
        spans[found[1].decode()] = (found.span(), (found.start(2) + 1, found.end(2) - 1))
    return spans, at
