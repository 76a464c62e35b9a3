import re
from pathlib import Path
from typing import Any

import pytest
from sweep_trials import PAPER, a_study

from wzsumo.errors import SpecError
from wzsumo.sweep.study_file import load_study, study_of


def refused(tmp_path: Path, text: str) -> str:
    """The message with which a study file is refused; the paper's scenario lies beside it."""
    (tmp_path / "paper.toml").write_text(PAPER.read_text())
    path = tmp_path / "study.toml"
    path.write_text('name = "s"\nscenarios = ["paper.toml"]\nmethods = ["swept"]\n' + text)
    with pytest.raises(SpecError) as error:
        load_study(path)
    assert str(path) in str(error.value)
    return str(error.value)


def test_grid_makes_every_combination_with_every_method_once() -> None:
    study = a_study(methods=("swept", "lanes"), seed=[21, 22, 23], crowd__used=[2, 5])
    assert len(study.cases) == 3 * 2 * 2
    assert {(c.scenario.seed, c.scenario.crowd.used, c.method) for c in study.cases} == {
        (seed, used, method) for seed in (21, 22, 23) for used in (2, 5) for method in ("swept", "lanes")
    }
    assert study.factors == ("seed", "crowd.used")


def test_first_and_count_give_consecutive_seeds(tmp_path: Path) -> None:
    (tmp_path / "paper.toml").write_text(PAPER.read_text())
    path = tmp_path / "study.toml"
    path.write_text(
        'name="s"\nscenarios=["paper.toml"]\nmethods=["swept"]\n[grid]\nseed={first=30, count=3}\ncrowd.used=[1, 2]\n'
    )
    assert [case.scenario.seed for case in load_study(path).cases] == [30, 30, 31, 31, 32, 32]


def test_combinations_meet_every_point_of_the_grid_but_not_each_other() -> None:
    pairs = [
        {"crowd.penetration": 0.1, "simulation.demand.flow_vph": 900},
        {"crowd.penetration": 0.2, "simulation.demand.flow_vph": 500},
    ]
    study = a_study(combinations=pairs, seed=[1, 2])
    found = [(c.scenario.seed, c.scenario.crowd.penetration, c.scenario.simulation.demand.flow_vph) for c in study.cases]
    assert sorted(found) == [(1, 0.1, 900), (1, 0.2, 500), (2, 0.1, 900), (2, 0.2, 500)]


def test_cases_that_differ_after_the_simulation_share_it_and_others_do_not() -> None:
    after = a_study(crowd__used=[1, 2], gnss__error_m=[0.0, 1.0], map__resolution_m=[0.127, 0.2], planner__smooth=[True, False])
    assert len(after.simulations) == 1
    before = a_study(seed=[1, 2], simulation__demand__flow_vph=[900, 1000], work_zone__work_length_ft=[600, 650])
    assert len(before.simulations) == 8


def test_lidar_maps_share_the_drive_of_their_own_faults_and_other_maps_do_not_look_at_them() -> None:
    study = a_study(methods=("slam_raw", "slam_barrier", "hd_map", "lanes"), slam__scene__faults__missing_share=[0.0, 0.4])
    sources = {method: [case.source for case in study.cases if case.method == method] for method in study.spec.methods}
    assert sources["slam_raw"] == sources["slam_barrier"]
    assert {method: len(set(names)) for method, names in sources.items()} == {
        "slam_raw": 2, "slam_barrier": 2, "hd_map": 1, "lanes": 1,
    }  # fmt: skip
    assert len(set().union(*sources.values())) == 4


def test_factor_in_a_section_that_the_scenario_leaves_out_makes_that_section(tmp_path: Path) -> None:
    (tmp_path / "paper.toml").write_text(PAPER.read_text())
    path = tmp_path / "study.toml"
    path.write_text(
        'name="s"\nscenarios=["paper.toml"]\nmethods=["slam_raw"]\n[grid]\nslam.scene.faults.missing_share=[0.1, 0.2]\n'
    )
    specs = [case.scenario.slam for case in load_study(path).cases]
    assert [slam.scene.faults.missing_share for slam in specs if slam] == [0.1, 0.2]


def test_ids_of_cases_differ_and_do_not_depend_on_the_rest_of_the_study() -> None:
    wide = {case.id: case.factors for case in a_study(seed=[1, 2, 3], crowd__used=[2, 5]).cases}
    narrow = {case.id: case.factors for case in a_study(crowd__used=[5], seed=[2]).cases}
    assert len(wide) == 6
    assert wide[next(iter(narrow))] == {"seed": 2, "crowd.used": 5}


def test_a_study_collects_what_it_uses_unless_it_says_otherwise() -> None:
    assert [c.scenario.crowd.collected for c in a_study(crowd__used=[2, 50]).cases] == [2, 50]
    assert [c.scenario.crowd.collected for c in a_study(crowd__used=[2], crowd__collected=[7]).cases] == [7]


def test_every_value_out_of_range_is_named_at_once(tmp_path: Path) -> None:
    message = refused(
        tmp_path,
        "[grid]\ncrowd.used = [0, 5, 50]\ncrowd.collected = [20]\ngnss.error_m = [-1.0, 200]\nseed = [3]\n",
    )
    assert "crowd.used=0: " in message
    assert "gnss.error_m=-1.0: " in message
    assert "gnss.error_m=200: " in message
    assert "crowd.used=50 must be at most crowd.collected=20" in message
    assert "seed" not in message


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", r"grid: empty, so nothing varies"),
        ("[grid]\nseed = []", r"grid\.seed: an empty list"),
        ("[grid]\nseed = 3", r"grid\.seed=3: must be a list"),
        ("[grid]\nseed = [1, 1]", r"grid\.seed=\[1, 1\]: a value is there twice"),
        (
            "[grid]\ncrowd.usd = [1]",
            r"grid\.crowd\.usd: unknown key \(did you mean used\?\); crowd has collected, known, penetration, used",
        ),
        ("[grid]\ngnss.error_m.x = [1]", r"grid\.gnss\.error_m\.x: unknown key; gnss\.error_m has no keys"),
        ("[grid]\nwork_zone.posted_speed_mph = [42]", r"posted_speed_mph=42\.0: .* between 40 and 45 mph"),
        ("[fixed]\nseed = 1\n[grid]\nseed = [1]", r"seed: given in more than one of"),
        (
            "[grid]\nseed = [1]\n[[combinations]]\ncrowd.used = 1\n[[combinations]]\ngnss.error_m = 1.0",
            r"must give the same keys",
        ),
        ("flow = 3\n[grid]\nseed = [1]", r"flow: unknown key"),
    ],
)
def test_study_that_cannot_be_is_refused_with_key_and_rule(tmp_path: Path, text: str, says: str) -> None:
    assert re.search(says, refused(tmp_path, text))


def test_several_wrong_factors_are_named_at_once(tmp_path: Path) -> None:
    message = refused(tmp_path, "[grid]\nseed = []\ngnss.error_cm = [1]\ncrowd.used = 3\n")
    assert all(key in message for key in ("grid.seed", "gnss.error_cm", "crowd.used"))


@pytest.mark.parametrize(
    ("second_value", "says"),
    [
        ("simulation.demand.flow_vph = [1500, 9000]", "simulation.demand.flow_vph=9000"),
        ("simulation.demand.warm_up_s = [60, 2000]", "simulation.demand.warm_up_s=2000"),
        ("map.resolution_m = [0.127, 0.01]", "map.resolution_m=0.01"),
        ("route.goal_after_zone_m = [100, 9000]", "goal_after_zone_m"),
    ],
)
def test_later_value_of_a_factor_that_does_not_fit_is_refused_though_the_first_fits(
    tmp_path: Path, second_value: str, says: str
) -> None:
    assert says in refused(tmp_path, f"[grid]\n{second_value}\n")


def test_method_that_is_none_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    (tmp_path / "paper.toml").write_text(PAPER.read_text())
    path = tmp_path / "study.toml"
    path.write_text('name = "s"\nscenarios = ["paper.toml"]\nmethods = ["magic"]\n[grid]\nseed = [1]\n')
    with pytest.raises(SpecError, match=r"methods: magic: unknown; known methods: .*swept"):
        load_study(path)


def test_base_scenario_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text('name = "s"\nscenarios = ["missing.toml"]\nmethods = ["swept"]\n[grid]\nseed = [1]\n')
    with pytest.raises(SpecError, match=r"missing\.toml: no such file"):
        load_study(path)


@pytest.mark.parametrize(
    "grid",
    [
        {"seed": {"first": 1, "count": 10**9}},
        {"seed": {"first": 1, "count": 10**30}},
        {"seed": list(range(3000)), "crowd": {"used": list(range(1, 3000))}},
    ],
)
def test_study_of_millions_of_cases_is_refused_before_they_are_made(grid: dict[str, Any]) -> None:
    content = {"name": "s", "scenarios": ["p.toml"], "methods": ["swept"], "grid": grid}
    with pytest.raises(SpecError, match="cases or more, at most 200000 make one study"):
        study_of({"study": content, "scenarios": {"p.toml": {}}}, source="s.toml")
