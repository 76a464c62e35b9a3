"""Bad and odd networks, demand, zones, roads and feeds: one function a kind of input."""

import copy
import json
import random
import re
import tomllib
from pathlib import Path
from typing import Any

from damage import NUMBERS, break_key, damaged, write_toml

REPOSITORY = Path(__file__).parents[2]
FREEWAY = REPOSITORY / "scenarios" / "networks" / "freeway"
DATA = REPOSITORY / "tests" / "data" / "prairie_center"
ZONE = REPOSITORY / "scenarios" / "right_lane.toml"
XML_VALUES = (
    "", "0", "-1", "1e300", "nan", "inf", "x", "9" * 400, "-inf", "0.0,0.0", "1,2 3", "all", "m1 m1", "\x85", "&#10;",
    "a" * 5000, "10 20", "1:2:3", "true", ":m2_0", "m3", "free", "best",
)  # fmt: skip


def placement(rng: random.Random, folder: Path) -> list[str]:
    """A network, its demand or a zone's file with odd values or damage, for `place`."""
    net, routes, zone = folder / "freeway.net.xml", folder / "freeway.rou.xml", folder / "zone.toml"
    net.write_bytes((FREEWAY / net.name).read_bytes())
    routes.write_bytes((FREEWAY / routes.name).read_bytes())
    content = tomllib.loads((REPOSITORY / "docs" / "guide" / "place_example" / "zone.toml").read_text())
    for path in rng.sample([net, net, routes, routes, zone], k=rng.choice((1, 1, 1, 2))):
        if path == zone:
            for _ in range(rng.choice((1, 2))):
                break_key(content, rng)
        elif rng.random() < 0.85:
            path.write_bytes(_broken_xml(path.read_text(), rng).encode("utf-8", "surrogatepass"))
        else:
            path.write_bytes(damaged(path.read_bytes(), rng))
    write_toml(content, zone)
    if rng.random() < 0.1:
        zone.write_bytes(damaged(zone.read_bytes(), rng))
    edges = re.findall(r'<edge id="([^":]+)"', (FREEWAY / net.name).read_text())
    edge = rng.choice(edges) if rng.random() < 0.2 else rng.choice(("none", "", ":m_0", "-m1")) if rng.random() < 0.1 else "m2"
    at = ["--at", edge, rng.choice(NUMBERS) if rng.random() < 0.1 else rng.choice(("100", "200", "-900"))]
    if rng.random() < 0.1:
        at = ["--at-latlon", rng.choice(("42.3", *NUMBERS)), rng.choice(("-83.1", *NUMBERS))]
    words = ["place", str(net), "--zone", str(zone), *at, "--out", str(folder / "out")]
    if rng.random() < 0.8:
        words += ["--routes", str(routes if rng.random() < 0.95 else rng.choice((net, zone, folder)))]
    if rng.random() < 0.2:
        additional = folder / "more.add.xml"
        additional.write_text(_ADDITIONALS)
        additional.write_bytes(_broken_xml(_ADDITIONALS, rng).encode("utf-8", "surrogatepass"))
        words += ["--additionals", str(additional)]
    if rng.random() < 0.2:
        words += [rng.choice(("--closed-from", "--closed-for")), rng.choice(NUMBERS)]
    return words


def network_scenario(rng: random.Random, folder: Path) -> list[str]:
    """A scenario in a network with odd keys or files, for commands that read it."""
    (folder / "freeway").mkdir()
    for path in FREEWAY.iterdir():
        content = path.read_bytes()
        if rng.random() < 0.3:
            content = _broken_xml(content.decode(), rng).encode("utf-8", "surrogatepass")
        (folder / "freeway" / path.name).write_bytes(content)
    scenario = tomllib.loads((REPOSITORY / "scenarios" / "networks" / "freeway.toml").read_text())
    for _ in range(rng.choice((0, 1, 1, 2))):
        break_key(scenario, rng)
    write_toml(scenario, folder / "zone.toml")
    words = [rng.choice(("layout", "net", "capacity")), str(folder / "zone.toml")]
    return words if words[0] == "capacity" else [*words, "--out", str(folder / "out")]


def feed(rng: random.Random, folder: Path) -> list[str]:
    """A WZDx feed with odd values, for `init --from`."""
    path = folder / "feed.geojson"
    content = json.loads((DATA / "announced.geojson").read_text())
    for _ in range(rng.choice((1, 1, 2))):
        break_key(content, rng)
    path.write_text(json.dumps(content), encoding="utf-8", errors="surrogatepass")
    if rng.random() < 0.2:
        path.write_bytes(damaged(path.read_bytes(), rng))
    ids = [str(each.get("id")) for each in json.loads((DATA / "announced.geojson").read_text())["features"]]
    event = f"#{rng.choice(ids)}" if rng.random() < 0.8 else rng.choice(("", "#none", "#\x1b[2J"))
    out = "z.toml" if rng.random() < 0.85 else rng.choice(("a b.toml", "x" * 300, ".", "", "scenario.schema.json"))
    return ["init", "--from", f"{path}{event}", "--out", str(folder / out)]


def road_of_network(rng: random.Random, folder: Path) -> list[str]:
    """A road or a zone's file of any kind, whole or damaged, as options of `map`."""
    kind = rng.choice(("freeway.net.xml", "road.geojson", "zone.toml", "a.osm", "a.xodr", "road.toml", "a.osm.pbf"))
    path = folder / kind
    sources = {"freeway.net.xml": FREEWAY, "road.geojson": DATA}
    content = (sources[kind] / kind).read_bytes() if kind in sources else _SMALL_ROADS.get(kind, ZONE.read_bytes())
    if kind in {"zone.toml", "road.toml"}:
        table = tomllib.loads(content.decode())
        if rng.random() < 0.6:
            break_key(table, rng)
        write_toml(table, path)
    else:
        path.write_bytes(damaged(content, rng) if rng.random() < 0.5 else content)
    options = ["--road", str(path)]
    if rng.random() < 0.3:
        zone: Any = copy.copy(DATA / "announced.geojson")
        options += ["--zone", rng.choice((str(zone), f"{zone}#x", str(path), "", "/dev/null"))]
    if rng.random() < 0.2:
        options += ["--edges", rng.choice(("m1", "m2", "none", ""))]
    if rng.random() < 0.2:
        options += ["--shoulders-ft", rng.choice(NUMBERS), rng.choice(NUMBERS)]
    return options


def _broken_xml(text: str, rng: random.Random) -> str:
    """An XML text with one to three attributes changed or gone, or elements gone, doubled or moved."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        attributes = list(re.finditer(r'\s([\w]+)="([^"]*)"', text))
        elements = list(re.finditer(r"<\w+[^<>]*/>", text))
        how = rng.choice(("value",) * 8 + ("gone", "element", "double", "swap", "nest"))
        if how in {"value", "gone"} and attributes:
            found = rng.choice(attributes)
            new = "" if how == "gone" else f' {found[1]}="{rng.choice((*XML_VALUES, rng.choice(attributes)[2]))}"'
            text = text[: found.start()] + new + text[found.end() :]
        elif elements:
            found = rng.choice(elements)
            nested = "<a>" * 3000 + "</a>" * 3000
            new = {"double": found[0] * 2, "swap": rng.choice(elements)[0], "nest": nested}.get(how, "")
            text = text[: found.start()] + new + text[found.end() :]
    return text


_ADDITIONALS = """<additional>
<inductionLoop id="l1" lane="m2_0" pos="100" freq="60" file="out.xml"/>
<laneAreaDetector id="a1" lane="m3_1" pos="10" endPos="200" freq="60" file="out.xml"/>
<busStop id="b1" lane="m2_0" startPos="100" endPos="130"/>
<rerouter id="r1" edges="m1"><interval begin="0" end="100"><closingReroute id="m3"/></interval></rerouter>
<variableSpeedSign id="v1" lanes="m2_0 m2_1"><step time="0" speed="10"/></variableSpeedSign>
<calibrator id="c1" edge="m2" pos="0" freq="60">
<flow begin="0" end="100" vehsPerHour="100" speed="10" route="r" type="t"/></calibrator>
<taz id="t" edges="m1 m2"/>
</additional>
"""
_SMALL_ROADS = {
    "a.osm": b"""<osm version="0.6"><node id="1" lat="42.28" lon="-83.74"/><node id="2" lat="42.28" lon="-83.72"/>
<way id="3"><nd ref="1"/><nd ref="2"/>
<tag k="highway" v="motorway"/><tag k="oneway" v="yes"/><tag k="lanes" v="2"/></way></osm>""",
    "a.xodr": b"""<OpenDRIVE><header revMajor="1" revMinor="4"/>
<road name="" length="1000" id="1" junction="-1"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="1000"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center>
<right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>""",
    "road.toml": b"""[road]
lane_count = 2
left_shoulder_ft = 10
right_shoulder_ft = 10
reference_points_m = [[0.0, 3.66], [1000.0, 3.66]]
[announced]
start_ft = 1000
end_ft = 2400
""",
    "a.osm.pbf": b"\0\0\0\x0d\x0a\x09OSMHeader",
}
