"""What each section of a scenario decides, and that the names of a study's results change exactly where it decides them."""

from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import BaseModel
from sweep_trials import a_study

from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.sections import CrowdSpec, Decides
from wzsumo.sweep.evaluation.study_case import StudyCase

# Section -> what it decides, as the design has it.
DECIDED = {
    "name": "nothing", "seed": "simulation", "road": "simulation", "network": "simulation", "work_zone": "simulation",
    "site": "simulation", "simulation": "simulation", "crowd": "reports", "gnss": "reports", "mixture": "reports",
    "map": "site", "route": "site", "vehicle": "site", "slam": "LiDAR", "live": "simulation", "planner": "drive",
    "control": "drive", "plant": "drive",
}  # fmt: skip
# A key of each section that a study can vary, and another value than the paper's.
OTHER_VALUES: dict[str, tuple[str, Any]] = {
    "seed": ("seed", 99), "road": ("road.left_shoulder_ft", 11.0), "work_zone": ("work_zone.work_length_ft", 700.0),
    "site": ("site.light", "night"), "simulation": ("simulation.demand.flow_vph", 901.0), "crowd": ("crowd.used", 4),
    "gnss": ("gnss.error_m", 1.0), "mixture": ("mixture.k_max", 7), "map": ("map.resolution_m", 0.2),
    "route": ("route.start_before_zone_m", 140.0), "vehicle": ("vehicle.width_m", 1.9), "slam": ("slam.traffic", False),
    "live": ("live", {"changed_at_s": 300.0, "ego_after_s": 100.0}), "planner": ("planner.planned_speed_mps", 11.0),
    "control": ("control.target_speed_mps", 11.0), "plant": ("plant.mass_kg", 1600.0),
}  # fmt: skip
# What the names of simulation, source and evaluation depend on, by the source of the method's map.
SOURCE_DEPENDS = {
    "swept": {"simulation", "reports"}, "slam_raw": {"simulation", "site", "LiDAR"}, "hd_map": {"simulation", "site"},
}  # fmt: skip


def case_with(method: str, **changes: Any) -> StudyCase:
    (case,) = a_study(methods=(method,), seed=[21], fixed=changes).cases
    return case


def case_of(method: str, section: str) -> StudyCase:
    """The paper's case with another value in one section."""
    key, value = OTHER_VALUES[section]
    if section == "seed":
        (case,) = a_study(methods=(method,), seed=[value]).cases
        return case
    return case_with(method, **{key: value})


def test_every_section_says_once_what_it_decides() -> None:
    said = {
        name: [mark.value for mark in field.metadata if isinstance(mark, Decides)]
        for name, field in Scenario.model_fields.items()
    }
    assert said == {name: [what] for name, what in DECIDED.items()}
    assert set(OTHER_VALUES) == set(DECIDED) - {"name", "network"}


@pytest.mark.parametrize("method", SOURCE_DEPENDS)
@pytest.mark.parametrize("section", OTHER_VALUES)
def test_cases_share_simulation_source_and_evaluation_unless_a_section_decides_them(method: str, section: str) -> None:
    usual, other = case_with(method), case_of(method, section)
    what, source = DECIDED[section], SOURCE_DEPENDS[method]
    assert usual.id != other.id
    assert (usual.simulation != other.simulation) == (what == "simulation")
    assert (usual.site != other.site) == (what in {"simulation", "site"})
    assert (usual.source != other.source) == (what in source)
    assert (usual.evaluation != other.evaluation) == (what in source | {"site", "drive"})


def test_share_of_equipped_vehicles_and_number_of_collected_traces_decide_no_map() -> None:
    marked = {name for name, key in CrowdSpec.model_fields.items() if Decides.COLLECTION in key.metadata}
    assert marked == {"penetration", "collected"}
    usual = case_with("swept")
    for key, value in (("crowd.penetration", 0.5), ("crowd.collected", 29)):
        other = case_with("swept", **{key: value})
        assert usual.id != other.id
        assert (usual.source, usual.evaluation) == (other.source, other.evaluation)


def test_methods_of_one_source_share_it_and_no_evaluation() -> None:
    swept, lanes, before = (case_with(name) for name in ("swept", "lanes", "hd_map"))
    assert swept.source == lanes.source != before.source
    assert len({case.evaluation for case in (swept, lanes, before)}) == 3
    (driven,) = a_study(methods=("swept",), drive=True, seed=[21]).cases
    assert driven.source == swept.source
    assert driven.evaluation != swept.evaluation


def test_ego_drives_the_posted_speed_unless_the_scenario_names_one_and_its_path_is_planned_for_it() -> None:
    for name, speed in (("right_lane", 65 * 0.44704), ("one_lane_signal", 45 * 0.44704), ("paper", 10.0)):
        scenario = load_scenario(f"scenarios/{name}.toml")
        assert scenario.control.target_speed_mps == pytest.approx(speed)
        assert scenario.planner.planned_speed_mps == pytest.approx(speed)


def _sections_of_defaults(spec: type[BaseModel], path: str = "") -> Iterator[tuple[str, BaseModel]]:
    """Each section, at any depth, that stands for itself where it is left out."""
    for name, field in spec.model_fields.items():
        if isinstance(default := field.get_default(call_default_factory=True, validated_data={}), BaseModel):
            yield f"{path}{name}", default
            yield from _sections_of_defaults(type(default), f"{path}{name}.")


def test_key_that_is_left_out_has_the_same_value_whether_its_section_is_given_or_not() -> None:
    sections = dict(_sections_of_defaults(Scenario))
    assert {"gnss", "planner", "simulation.demand"} <= sections.keys()
    for path, left_out in sections.items():
        for name, field in type(left_out).model_fields.items():
            if f"{path}.{name}" == "simulation.demand.drivers.name":  # a label: drivers that a scenario gives are its own
                continue
            if not field.is_required() and (own := field.get_default(call_default_factory=True, validated_data={})) is not None:
                assert getattr(left_out, name) == own, f"{path}.{name}"
