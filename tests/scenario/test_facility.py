"""A scenario whose road lies in somebody's network: what it makes of the network, and what it refuses."""

from pathlib import Path

import numpy as np
import pytest
from placement.study_case import scenario_file, street

from wzsumo.errors import InputError, SpecError
from wzsumo.scenario.facility import NetworkCorridor, OwnRoad
from wzsumo.scenario.scenario import load_scenario
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.study_file import load_study
from wzsumo.units import METRES_PER_FOOT

LIBRARY = Path(__file__).parents[2] / "scenarios"


def test_scenario_with_a_road_is_an_own_road_and_with_a_network_a_corridor_in_it() -> None:
    own, placed = load_scenario(LIBRARY / "paper.toml"), load_scenario(scenario_file("placed"))
    assert isinstance(own.facility(), OwnRoad)
    facility = placed.facility()
    assert isinstance(facility, NetworkCorridor)
    assert facility.frame is None
    assert facility.standing == (0.0, float("inf"))


def test_zone_of_a_network_begins_at_the_position_on_its_edge_and_ends_before_the_road_does() -> None:
    layout = load_scenario(scenario_file("placed")).layout()
    x, y = layout.road.to_xy(layout.start, layout.road.lane_centre(0))
    assert float(x) == pytest.approx(500 + 250, abs=8.0)
    assert float(y) == pytest.approx(150 - 4.8, abs=0.3)
    assert layout.end - layout.start == pytest.approx(sum(area.length for area in layout.areas), abs=0.1)
    assert layout.area("activity area").length == pytest.approx(100 * METRES_PER_FOOT)


def test_start_and_goal_lie_on_the_lanes_of_the_network() -> None:
    scenario = load_scenario(scenario_file("placed"))
    start, goal = scenario.start_and_goal(scenario.layout())
    assert [start[1], goal[1]] == pytest.approx([148.4, 148.4], abs=0.05)  # the left of two lanes of 3.2 m
    assert goal[0] > 1000 > start[0]


@pytest.mark.parametrize(
    ("keys", "rule"),
    [
        ({"zone": "start_ft = 30"}, "start_ft=30.*leave it out"),
        ({"demand": "flow_vph = 900"}, r"simulation\.demand\.flow_vph: the demand of a network is that of its routes"),
        ({"times": "closed_from_s = 20", "warm_up": 30}, "warm_up_s=30.*the zone stands from"),
        ({"times": "lane_side = 'middle'"}, r"network\.lane_side"),
        ({"times": "latitude_deg = 36.0"}, "either as edge and position_m, or as latitude_deg and longitude_deg"),
        ({"times": "routes = ['a.xml']"}, "sumocfg names its routes"),
    ],
)
def test_what_does_not_go_with_a_network_is_refused_in_one_line(keys: dict[str, object], rule: str) -> None:
    path = scenario_file("wrong", **keys)  # type: ignore[arg-type]  # the keys are those of the function
    with pytest.raises(SpecError, match=rule) as error:
        load_scenario(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_network_of_the_library_and_its_study_can_be_run() -> None:
    scenario = load_scenario(LIBRARY / "networks" / "freeway.toml")
    assert scenario.layout().area("activity area").length == pytest.approx(500 * METRES_PER_FOOT)
    study = load_study(LIBRARY / "studies" / "network.toml")
    assert [case.scenario.seed for case in study.cases] == [31, 32, 33, 34, 35]
    assert {case.scenario.network for case in study.cases} == {scenario.network}


def test_scenario_with_both_a_road_and_a_network_or_with_neither_is_refused() -> None:
    text = scenario_file("placed").read_text()
    path = street().parent / "both.toml"
    path.write_text(
        text.replace(
            "[work_zone]", "[road]\nlane_count = 2\nleft_shoulder_ft = 4\nright_shoulder_ft = 4\nlength_ft = 4000\n[work_zone]"
        )
    )
    with pytest.raises(SpecError, match=r"either a section \[road\] or a section \[network\]"):
        load_scenario(path)
    begin, end = text.index("[network]"), text.index("[work_zone]")
    path.write_text(text[:begin] + text[end:])
    with pytest.raises(SpecError, match=r"start_ft|either a section \[road\] or a section \[network\]"):
        load_scenario(path)


@pytest.mark.parametrize(
    ("old", "new"), [('net = "street/small.net.xml"', 'net = "street/none.net.xml"'), ('edge = "e2"', 'edge = "e9"')]
)
def test_network_or_edge_that_is_not_there_is_refused(old: str, new: str) -> None:
    path = street().parent / "missing.toml"
    path.write_text(scenario_file("placed").read_text().replace(old, new))
    with pytest.raises(InputError) as error:
        load_scenario(path)
    assert "\n" not in str(error.value)
    assert "none.net.xml" in str(error.value) or "e9" in str(error.value)


def test_case_gets_another_name_when_the_routes_of_its_network_change() -> None:
    scenario = load_scenario(scenario_file("placed"))
    routes = street() / "demand.rou.xml"
    before = StudyCase(scenario=scenario, method="lanes", drive=False)
    names = before.id, before.simulation
    text = routes.read_text()
    try:
        routes.write_text(text.replace('period="5"', 'period="6"'))
        after = StudyCase(scenario=scenario, method="lanes", drive=False)
        assert {after.id, after.simulation}.isdisjoint(names)
    finally:
        routes.write_text(text)


def test_zone_is_moved_to_the_other_side_by_lane_side() -> None:
    right, left = (
        load_scenario(scenario_file("side", times=f"lane_side = '{side}'")).layout().work_zone.closed_lanes
        for side in ("right", "left")
    )
    assert (right, left) == ((0,), (1,))
    assert np.isfinite(load_scenario(scenario_file("side")).layout().start)
