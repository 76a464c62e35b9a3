"""The road of a placed zone in SUMO's edges, beside what SUMO itself says of them."""

import functools
import itertools
import subprocess
from pathlib import Path

import numpy as np
import pytest
from placement.networks import new_folder, placed_on_freeway
from placement.study_case import scenario_file

from wzsumo.placement.demand_files.vehicle_sizes import CLASS_SIZES, vehicle_sizes
from wzsumo.placement.study.corridor_edges import road_edges
from wzsumo.placement.xml_file import XmlFile
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.connection import connected_library, sumo_binary
from wzsumo.simulation.files import SumoFiles


@functools.cache
def files() -> SumoFiles:
    folder = new_folder() / "files"
    folder.mkdir()
    return load_scenario(scenario_file("placed")).write_sumo_files(folder)


def test_edges_follow_one_another_without_a_gap_and_lead_on_in_sumo() -> None:
    edges = files().edges
    assert [edge.id for edge in edges] == ["e1", "e2.wz0", "e2.wz1", "e2.wz2", "e2.wz3", "e3"]
    assert all(before.end == after.start for before, after in itertools.pairwise(edges))
    with connected_library(["-c", str(files().config)]) as sumo:
        found = sumo.simulation.findRoute(edges[0].id, edges[-1].id)
    assert list(found.edges) == [edge.id for edge in edges]


def test_lanes_lie_where_sumo_has_them_and_bear_the_layouts_lane() -> None:
    layout = load_scenario(scenario_file("placed")).layout()
    with connected_library(["-c", str(files().config)]) as sumo:
        for edge in files().edges:
            for index, lane in enumerate(edge.lanes):
                shape = np.array(sumo.lane.getShape(f"{edge.id}_{index}"))
                stations, offsets = layout.road.to_sd(shape)
                assert lane.middle(stations) == pytest.approx(offsets, abs=1e-6)
                assert lane.width == pytest.approx(sumo.lane.getWidth(f"{edge.id}_{index}"))
    by_id = {edge.id: [lane.of.index if lane.of else None for lane in edge.lanes] for edge in files().edges}
    assert by_id["e1"] == by_id["e2.wz1"] == by_id["e3"] == [0, 1]
    assert by_id["e2.wz2"] == [0, None]


def test_ramp_is_around_the_road_and_not_along_it() -> None:
    around = files().surroundings
    assert around is not None
    assert "ramp" in around.around
    assert "ramp" not in around.along
    assert any(edge.startswith(":b") for edge in around.along)
    assert set(around.along) <= set(around.around)


def test_auxiliary_lane_beside_the_road_is_no_lane_of_it() -> None:
    placed = placed_on_freeway("m2", 300.0, closed_lanes=[2])
    (joined,) = [edge for edge in road_edges(placed.closed).edges if edge.id == "m2-AddedOnRampEdge"]
    assert [lane.of is None for lane in joined.lanes] == [True, False, False, False]


def test_sizes_of_vehicle_classes_are_sumos_own(tmp_path: Path) -> None:
    types = "".join(f'<vType id="t_{name}" vClass="{name}"/>' for name in CLASS_SIZES)
    routes = tmp_path / "types.rou.xml"
    routes.write_text(f'<routes>{types}<vType id="own" vClass="bus" length="18.25"/></routes>')
    sizes = vehicle_sizes([XmlFile.read(routes, role="types")])
    net = files().config.parent / "small.net.xml"
    with connected_library(["-n", str(net), "-a", str(routes)]) as sumo:
        known = {name: (sumo.vehicletype.getLength(name), sumo.vehicletype.getWidth(name)) for name in sizes}
    assert sizes == {name: pytest.approx(size) for name, size in known.items()}
    assert sizes["own"] == (18.25, 2.5)


def test_sumo_takes_the_configuration_without_a_word() -> None:
    command = [str(sumo_binary("sumo")), "-c", str(files().config), "--end", "28805"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
