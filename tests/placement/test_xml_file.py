from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.errors import PlacementError
from wzsumo.placement.xml_file import Edits, Element, XmlFile

TEXT = b"""<?xml version="1.0" encoding="UTF-8"?>
<!-- a comment -->
<net  version="1.20">
    <edge id="a"   from='x'><lane id="a_0" note="a &amp; b > c"/></edge>
    <edge id='b'/><edge id="c"></edge>
</net>
"""


def children(file: XmlFile) -> list[Element]:
    found: list[Element] = []
    file.root_and_children(found.append)
    return found


def file_of(data: bytes) -> XmlFile:
    return XmlFile(path=Path("some.xml"), data=data)


def test_bytes_of_each_element_are_those_that_it_fills() -> None:
    file = file_of(TEXT)
    found = children(file)
    assert [file.data[e.begin : e.end] for e in found] == [
        b"""<edge id="a"   from='x'><lane id="a_0" note="a &amp; b > c"/></edge>""",
        b"<edge id='b'/>",
        b'<edge id="c"></edge>',
    ]
    assert found[0].children[0].get("note") == "a & b > c"


def test_edits_change_their_attributes_and_nothing_else() -> None:
    file = file_of(TEXT)
    first, second, _ = children(file)
    edits = Edits(file)
    edits.set_attributes(first, {"from": 'y"z', "to": "w"})
    edits.set_attributes(first.children[0], {"note": None})
    edits.set_attributes(second, {"id": "bb"})
    assert edits.apply() == (
        TEXT.replace(b"from='x'", b"from='y&quot;z' to=\"w\"")
        .replace(b' note="a &amp; b > c"', b"")
        .replace(b"id='b'", b"id='bb'")
    )


def test_a_file_without_edits_stays_byte_for_byte() -> None:
    assert Edits(file_of(TEXT)).apply() == TEXT


names = st.text("abcdefghij", min_size=1, max_size=5)


@given(st.lists(st.tuples(names, names), min_size=1, max_size=8), st.data())
def test_any_attribute_set_in_any_element_is_read_back_and_the_others_stay(
    rows: list[tuple[str, str]], data: st.DataObject
) -> None:
    text = "<r>" + "".join(f"\n <e k=\"{key}\" v = '{value}'/>" for key, value in rows) + "</r>"
    file = file_of(text.encode())
    number = data.draw(st.integers(0, len(rows) - 1))
    value = data.draw(st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), max_size=6))
    edits = Edits(file)
    edits.set_attributes(children(file)[number], {"v": value})
    read = [(e.get("k"), e.get("v")) for e in children(file_of(edits.apply()))]
    assert read == [(key, value if n == number else old) for n, (key, old) in enumerate(rows)]


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"\x1f\x8b\x08rest", "gzip"), (b"<net><edge></net>", "mismatched tag"), (b"\xff\xfe<", "UTF-16"), (b"", "no element")],
)
def test_files_that_are_no_plain_xml_are_refused_by_name(content: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "some.xml"
    path.write_bytes(content)
    with pytest.raises(PlacementError, match=words) as refused:
        children(XmlFile.read(path, role="the network"))
    assert str(path) in str(refused.value)


def test_a_rule_that_stumbles_names_file_line_and_element() -> None:
    def whole_number(element: Element) -> None:
        int(element.get("lane", "0"))

    file = file_of(b'<routes>\n<trip id="a" lane="1"/>\n<trip id="b\x1b" lane="free"/>\n</routes>'.replace(b"\x1b", b""))
    with pytest.raises(PlacementError, match=r"some\.xml: line 3, <trip> b: .*invalid literal for int"):
        file.root_and_children(whole_number)


def test_elements_that_nest_without_end_are_refused() -> None:
    with pytest.raises(PlacementError, match=r"some\.xml: line 1: elements nest more than 100 deep"):
        children(file_of(b"<net>" + b"<a>" * 5000 + b"</a>" * 5000 + b"</net>"))


def test_an_encoding_that_is_not_known_is_refused() -> None:
    with pytest.raises(PlacementError, match=r"some\.xml: "):
        children(file_of(b'<?xml version="1.0" encoding="klingon"?><net/>'))
