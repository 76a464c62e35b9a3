"""Roads from SUMO networks that netconvert makes: edges, lane counts and lines against what was given to netconvert."""

import gzip
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shapely

from wzsumo.errors import InputError, SpecError
from wzsumo.frames import FloatArray
from wzsumo.geography import LocalFrame
from wzsumo.roads.matching import check_edges, edges_of_traces
from wzsumo.roads.network_road import read_network_road
from wzsumo.roads.stretch import road_of_edges
from wzsumo.roads.sumo_net import NetConnection, NetEdge, NetLane, SumoNet, read_net
from wzsumo.simulation.connection import sumo_binary

# A freeway of 3 lanes that runs east on a bend, an auxiliary lane from an on-ramp to an off-ramp, and its other direction.
NODES = {"w": (0, 0), "on": (400, 10), "off": (800, 60), "e": (1400, 200), "ramp_in": (100, -120), "ramp_out": (1200, -20)}
EDGES = {
    "west": ("w", "on", 3, 3.66), "weave": ("on", "off", 4, 3.66), "east": ("off", "e", 3, 3.66),
    "entry": ("ramp_in", "on", 1, 3.66), "exit": ("off", "ramp_out", 1, 3.66),
    "back_e": ("e", "off", 2, 3.5), "back_w": ("off", "w", 2, 3.5),
}  # fmt: skip


@pytest.fixture(scope="session")
def net_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("net")
    nodes = "".join(f'<node id="{name}" x="{x}" y="{y}" type="priority"/>' for name, (x, y) in NODES.items())
    edges = "".join(
        f'<edge id="{name}" from="{a}" to="{b}" numLanes="{n}" width="{width}" speed="30"/>'
        for name, (a, b, n, width) in EDGES.items()
    )
    (folder / "n.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    (folder / "e.edg.xml").write_text(f"<edges>{edges}</edges>")
    lanes = [("west", "weave", k, k + 1) for k in range(3)] + [("entry", "weave", 0, 0)]
    lanes += [("weave", "east", k + 1, k) for k in range(3)] + [("weave", "exit", 0, 0)]
    lanes += [("back_e", "back_w", k, k) for k in range(2)]
    links = "".join(f'<connection from="{a}" to="{b}" fromLane="{i}" toLane="{j}"/>' for a, b, i, j in lanes)
    (folder / "c.con.xml").write_text(f"<connections>{links}</connections>")
    out = folder / "freeway.net.xml"
    command = [str(sumo_binary("netconvert")), "-n", str(folder / "n.nod.xml"), "-e", str(folder / "e.edg.xml"), "-x",
               str(folder / "c.con.xml"), "-o", str(out), "--no-warnings", "--offset.disable-normalization"]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    return out


@pytest.fixture(scope="session")
def net(net_file: Path) -> SumoNet:
    return read_net(net_file)


def drive(net: SumoNet, edges: list[str], *, from_left: int = 0, error_m: float = 1.0, seed: int = 0) -> pd.DataFrame:
    """Three vehicles in one lane of edges, counted from the left, with errors of fixes."""
    line = shapely.LineString(np.concatenate([net.edges[edge].car_lanes[-1 - from_left].shape for edge in edges]))
    rng = np.random.default_rng(seed)
    tables = []
    for number in range(3):
        at = np.arange(0.0, line.length, 25.0)
        points = shapely.get_coordinates(shapely.line_interpolate_point(line, at)) + rng.normal(0, error_m, (len(at), 2))
        tables.append(pd.DataFrame({"vehicle_id": f"v{number}", "time_s": at / 25, "x_m": points[:, 0], "y_m": points[:, 1]}))
    return pd.concat(tables, ignore_index=True)


def middle_of(net: SumoNet, edge: str, lanes: tuple[int, int]) -> FloatArray:
    """Points in the middle between two lanes of an edge, away from its ends."""
    share = np.linspace(0.1, 0.9, 9)
    sides = [shapely.LineString(net.edges[edge].lanes[k].shape) for k in lanes]
    ends = [shapely.get_coordinates(shapely.line_interpolate_point(side, share, normalized=True)) for side in sides]
    return np.asarray((ends[0] + ends[1]) / 2)


@pytest.mark.parametrize("error_m", [0.3, 3.0])
def test_stretch_is_found_from_traces_and_their_direction(net: SumoNet, error_m: float) -> None:
    assert edges_of_traces(net, drive(net, ["west", "weave", "east"], error_m=error_m), source="t") == ["west", "weave", "east"]
    assert edges_of_traces(net, drive(net, ["back_e", "back_w"], error_m=error_m), source="t") == ["back_e", "back_w"]
    assert edges_of_traces(net, drive(net, ["entry", "weave", "east"]), source="t") == ["entry", "weave", "east"]


def test_road_has_the_lanes_that_go_through_with_their_middle_and_tells_the_rest(net: SumoNet) -> None:
    found = road_of_edges(net, ["west", "weave", "east"], shoulders=None, source="net")
    assert found.road.lane_widths == pytest.approx([3.66] * 3, abs=0.01)
    assert [(count.name, count.lanes, count.extra) for count in found.counts] == [
        ("west", 3, 0),
        ("weave", 4, 1),
        ("east", 3, 0),
    ]
    assert [(ramp.kind, ramp.name) for ramp in found.ramps] == [("on-ramp", "entry"), ("off-ramp", "exit")]
    assert found.ramps[0].at_m == pytest.approx(400, abs=50)  # where its junction begins
    assert found.speed_mps == 30
    line = shapely.LineString(found.road.reference_line)
    for edge, lanes in (("west", (0, 2)), ("weave", (1, 3)), ("east", (0, 2))):
        assert shapely.distance(shapely.points(middle_of(net, edge, lanes)), line).max() < 0.15
    assert any("shoulders of 3.05 m on the left and 3.05 m on the right" in word for word in found.assumed)
    assert not road_of_edges(net, ["west"], shoulders=(1.0, 2.0), source="net").assumed


def test_compressed_network_is_the_same(net: SumoNet, net_file: Path, tmp_path: Path) -> None:
    (tmp_path / "n.net.xml.gz").write_bytes(gzip.compress(net_file.read_bytes()))
    assert list(read_net(tmp_path / "n.net.xml.gz").edges) == list(net.edges)


def with_place(net_file: Path, path: Path, crs: str, offset: str) -> Path:
    text = net_file.read_text()
    text = text.replace('projParameter="!"', f'projParameter="{crs}"').replace('netOffset="0.00,0.00"', f'netOffset="{offset}"')
    path.write_text(text)
    return path


def test_network_of_another_frame_is_moved_to_the_traces(net: SumoNet, net_file: Path, tmp_path: Path) -> None:
    placed = with_place(
        net_file, tmp_path / "p.net.xml", "+proj=utm +zone=17 +ellps=WGS84 +units=m +no_defs", "-270000.00,-4680000.00"
    )
    utm = LocalFrame(crs="EPSG:32617", origin_m=(270_000.0, 4_680_000.0))
    other = LocalFrame(crs="EPSG:32616", origin_m=(760_000.0, 4_680_000.0))
    traces = drive(net, ["west", "weave", "east"])
    xy = other.from_lonlat(utm.to_lonlat(traces[["x_m", "y_m"]].to_numpy()))
    moved = traces.assign(x_m=xy[:, 0], y_m=xy[:, 1])
    found = read_network_road(placed, traces=moved, frame=other, edges=(), shoulders=None, source="t")
    expected = other.from_lonlat(utm.to_lonlat(middle_of(net, "east", (0, 2))))
    line = shapely.LineString(found.road.reference_line)
    assert shapely.distance(shapely.points(expected), line).max() < 0.15


def test_traces_of_another_place_are_refused(net: SumoNet, net_file: Path, tmp_path: Path) -> None:
    traces = drive(net, ["west", "weave", "east"])
    with pytest.raises(InputError, match="different places or frames"):
        edges_of_traces(net, traces.assign(y_m=traces["y_m"] + 5000), source="t")
    frame = LocalFrame(crs="EPSG:32617", origin_m=(270_000.0, 4_680_000.0))
    with pytest.raises(SpecError, match="names no projection"):
        read_network_road(net_file, traces=traces, frame=frame, edges=(), shoulders=None, source="t")


def test_edges_that_do_not_connect_or_are_not_there_are_refused(net: SumoNet) -> None:
    assert check_edges(net, ["entry", "weave"], source="n") == ["entry", "weave"]
    with pytest.raises(InputError, match="no connection leads from west to exit in n; west goes on to weave"):
        check_edges(net, ["west", "exit"], source="n")
    with pytest.raises(InputError, match="n has no edge south for cars"):
        check_edges(net, ["south"], source="n")
    with pytest.raises(InputError, match="no lane goes through from edge entry to east"):
        road_of_edges(net, ["entry", "weave", "east"], shoulders=None, source="net")


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "no such file"), ("<net", "is no SUMO network"), ("<net></net>", "no edge for cars"),
     ('<net><edge id="a"><lane id="a_0" index="0"/></edge></net>', "is no SUMO network"),
     ('<net><edge id="a"><lane id="a_0" index="0" speed="9" allow="rail" shape="0,0 9,9"/></edge></net>', "no edge for cars")],
)  # fmt: skip
def test_file_that_is_no_network_of_roads_is_refused(tmp_path: Path, content: str | None, said: str) -> None:
    if content is not None:
        (tmp_path / "a.net.xml").write_text(content)
    with pytest.raises(SpecError, match=said):
        read_net(tmp_path / "a.net.xml")


def made_net(*shapes: list[tuple[float, float]], width: float | None = 3.5, n_lanes: int = 1) -> SumoNet:
    """Edges e0, e1 ... one after the other, each with lanes beside the rightmost one's shape, without internal lanes."""
    edges = {}
    for number, shape in enumerate(shapes):
        lanes = tuple(
            NetLane(id=f"e{number}_{k}", index=k, shape=np.add(shape, (0.0, 3.5 * k)), width=width, speed=30.0,
                    for_cars=True)
            for k in range(n_lanes)
        )  # fmt: skip
        edges[f"e{number}"] = NetEdge(id=f"e{number}", start=str(number), end=str(number + 1), lanes=lanes, internal=False)
    connections = {
        (f"e{k}", f"e{k + 1}"): [
            NetConnection(start=f"e{k}", start_lane=lane, end=f"e{k + 1}", end_lane=lane, via=None) for lane in range(n_lanes)
        ]
        for k in range(len(shapes) - 1)
    }
    return SumoNet(edges=edges, connections=connections, internal_lanes={}, next_internal={})


def test_lanes_that_jump_where_edges_meet_are_smoothed_and_said() -> None:
    jumping = made_net([(0, 0), (300, 0)], [(300.2, 3.0), (600, 3.0)], [(600.2, 0), (900, 0)])
    found = road_of_edges(jumping, ["e0", "e1", "e2"], shoulders=(3.0, 3.0), source="net")
    assert any("jump where edges meet: smoothed over" in word for word in found.assumed)
    line = shapely.LineString(found.road.reference_line)
    for x, y in ((150.0, 0.0), (450.0, 3.0), (750.0, 0.0)):
        assert line.distance(shapely.Point(x, y)) < 0.01
    straight = made_net([(0, 0), (300, 0)], [(300.2, 0.0), (600, 0.0)])
    assert not road_of_edges(straight, ["e0", "e1"], shoulders=(3.0, 3.0), source="net").assumed


def test_lanes_without_a_width_are_as_wide_as_they_lie_apart_or_as_sumo_says() -> None:
    shapes: list[tuple[float, float]] = [(0, 0), (700, 0)]
    two = road_of_edges(made_net(shapes, width=None, n_lanes=2), ["e0"], shoulders=None, source="net")
    assert two.road.lane_widths == pytest.approx([3.5, 3.5])
    assert two.road.reference_line[:, 1] == pytest.approx(1.75)  # between the centre lines at y = 0 and 3.5
    assert (two.road.left_shoulder, two.road.right_shoulder) == pytest.approx((1.2192, 3.048))  # AASHTO: 4 ft and 10 ft
    assert not any("wide" in word for word in two.assumed)
    one = road_of_edges(made_net(shapes, width=None), ["e0"], shoulders=None, source="net")
    assert one.road.lane_widths == pytest.approx([3.2])
    assert any("3.2 m wide, SUMO's default" in word for word in one.assumed)


def test_short_edge_that_no_fix_speaks_for_does_not_end_the_stretch() -> None:
    chain = made_net([(0, 0), (300, 0)], [(300, 0), (304, 0)], [(304, 0), (700, 0)])
    fixes = drive(chain, ["e0", "e2"])
    fixes = fixes[(fixes["x_m"] < 280) | (fixes["x_m"] > 320)]
    assert edges_of_traces(chain, fixes, source="t") == ["e0", "e1", "e2"]


@pytest.mark.parametrize(("shift_m", "found"), [(0.0, ["e0"]), (20.0, ["e0"]), (40.0, None)])
def test_traces_count_up_to_25_m_beside_an_edge(shift_m: float, found: list[str] | None) -> None:
    net = made_net([(0, 0), (700, 0)])
    traces = drive(net, ["e0"], error_m=0.2)
    moved = traces.assign(y_m=traces["y_m"] + shift_m)
    if found is None:
        with pytest.raises(InputError, match="different places"):
            edges_of_traces(net, moved, source="t")
    else:
        assert edges_of_traces(net, moved, source="t") == found
