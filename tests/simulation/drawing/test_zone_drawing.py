"""What sumo-gui gets to show: the files that the configuration names, pictures and the view on the zone."""

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.drawing.zone_drawing import write_drawing, write_view


def drawn_pictures(name: str, folder: Path) -> dict[str, ET.Element]:
    layout = load_scenario(name).layout()
    root = ET.parse(write_drawing(layout, folder / "zone.add.xml")).getroot()
    return {poi.attrib["id"]: poi for poi in root.findall("poi")}


@pytest.mark.parametrize(
    ("name", "boards"),
    [("right_lane", ["left"]), ("left_lane", ["right"]), ("double_closure", ["left", "left"]), ("lane_shift", []),
     ("interior_lane", ["right"]), ("shoulder_two_lane", [])],
)  # fmt: skip
def test_every_lane_that_a_merging_taper_closes_has_an_arrow_board_to_the_open_side(
    tmp_path: Path, name: str, boards: list[str]
) -> None:
    pictures = drawn_pictures(name, tmp_path)
    found = [poi.attrib["imgFile"] for id_, poi in pictures.items() if id_.startswith("arrow_board")]
    assert found == [f"signs/arrow_board_{side}.png" for side in boards]


def test_signs_ahead_of_the_road_are_drawn_at_its_beginning_and_say_how_far_ahead_they_stand(tmp_path: Path) -> None:
    pictures = drawn_pictures("right_lane", tmp_path)
    # A = 1,000 ft, B = 1,600 ft, C = 2,640 ft ahead of a taper at 1,500 ft: MUTCD 11th ed., Table 6B-1.
    far = pictures["sign_00_ROAD_WORK_AHEAD_1119_m_further_ahead"]
    near = pictures["sign_02_RIGHT_LANE_CLOSED_AHEAD_335_m_further_ahead"]
    assert (float(far.attrib["x"]), float(near.attrib["x"])) == (10, 30)
    assert float(pictures["sign_04_RIGHT_LANE_ENDS"].attrib["x"]) == pytest.approx(152.4)
    assert float(far.attrib["y"]) < -10  # beside the road, not on it


def test_view_shows_the_first_device_without_marks_at_the_ends_of_edges(tmp_path: Path) -> None:
    scenario = load_scenario("right_lane")
    files = scenario.write_sumo_files(tmp_path)
    configuration = ET.parse(files.config).getroot()
    assert [item.attrib["value"] for item in configuration.iter("gui-settings-file")] == ["zone.view.xml"]
    view = ET.parse(tmp_path / "zone.view.xml").getroot()
    edges, viewport = view.find("scheme/edges"), view.find("viewport")
    assert edges is not None
    assert viewport is not None
    assert (edges.attrib["showLinkDecals"], edges.attrib["showLinkRules"]) == ("0", "0")
    width = 1829 * 100 / float(viewport.attrib["zoom"])  # of a road of 6,000 ft
    assert abs(float(viewport.attrib["x"]) - 457.2) < width / 2
    assert width < 400
    turns = write_view(load_scenario("one_lane_signal").layout(), tmp_path / "turns.xml", step_length=0.1)
    shown = ET.parse(turns).getroot().find("scheme/edges")
    assert shown is not None
    assert shown.attrib["showLinkRules"] == "1"  # the signal that both directions wait at
