"""Networks that are XML but not whole, made from a good one by changing one attribute."""

import contextlib
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from placement.networks import freeway, new_folder

from wzsumo.errors import PlacementError
from wzsumo.placement.net import Net

TEXT = freeway().read_text()


def read(text: str) -> Net:
    path = new_folder() / "some.net.xml"
    path.write_text(text)
    return Net.read(path)


@pytest.mark.parametrize(
    ("pattern", "replacement", "words"),
    [
        (r'(<lane id="m3_1"[^>]* length=)"[^"]*"', r'\1"long"', "lane 'm3_1' has length='long'"),
        (r'(<lane id="m3_1"[^>]* length=)"[^"]*"', r'\1"0.00"', "lane 'm3_1' has length='0.00'"),
        (r'(<lane id="m3_1"[^>]*) speed="[^"]*"', r"\1", "lane 'm3_1' has speed=''"),
        (r'(<lane id="m3_1"[^>]* shape=)"[^"]*"', r'\1"1,2"', "lane 'm3_1' has shape='1,2'"),
        (r'(<lane id="m3_1")', r'\1 width="-3"', "lane 'm3_1' has width='-3'"),
        (r'(<connection from="m2"[^>]* fromLane=)"0"', r'\1"first"', "fromLane='first'"),
        (r'(<connection from="m2"[^>]* fromLane=)"0"', r'\1"9"', "names lane 'm2_9' under 'from'"),
        (r'(<connection from="m2"[^>]* to=)"m3"', r'\1"nowhere"', "names lane 'nowhere_"),
        (r'(<connection from="m2"[^>]* via=)"[^"]*"', r'\1":no_0_0"', "names lane ':no_0_0' under 'via'"),
        (r'(<junction id="d"[^>]* x=)"[^"]*"', r'\1"east"', "junction 'd' has x='east'"),
        (r'netOffset="[^"]*"', 'netOffset="0"', "netOffset='0'"),
    ],
)
def test_network_with_a_value_that_is_none_is_refused_by_its_place(pattern: str, replacement: str, words: str) -> None:
    broken, n = re.subn(pattern, replacement, TEXT)
    assert n
    with pytest.raises(PlacementError, match=re.escape(words)):
        read(broken)


@given(st.data())
def test_any_attribute_that_holds_a_word_is_read_or_refused_and_never_fails_otherwise(data: st.DataObject) -> None:
    spans = [found.span(1) for found in re.finditer(r'="([^"]*)"', TEXT)]
    begin, end = data.draw(st.sampled_from(spans))
    word = data.draw(st.sampled_from(["", "x", "-1", "1e999", "nan", "0", "m3", "m3_0", "1,2 3,4", "99"]))
    with contextlib.suppress(PlacementError):
        read(TEXT[:begin] + word + TEXT[end:])
