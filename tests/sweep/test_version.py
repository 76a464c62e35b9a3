from pathlib import Path

import pytest

import wzsumo
from wzsumo.sweep.version import code_version, digest_of

PACKAGE = Path(wzsumo.__file__).parent


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The package's modules, to be edited."""
    for path in PACKAGE.rglob("*.py"):
        target = tmp_path / path.relative_to(PACKAGE)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(path.read_bytes())
    return tmp_path


def test_version_is_that_of_the_package_and_the_digest_of_its_modules(copy: Path) -> None:
    assert code_version() == f"{wzsumo.__version__}+{digest_of(copy)}"


@pytest.mark.parametrize(
    "module",
    ["report/report.py", "figures/figures.py", "commands/sweep.py", "sweep/summary.py", "cli.py", "api.py", "__init__.py"],
)
def test_edit_of_a_module_that_tells_or_draws_keeps_finished_results(copy: Path, module: str) -> None:
    before = digest_of(copy)
    (copy / module).write_text((copy / module).read_text() + "# edited\n")
    assert digest_of(copy) == before


@pytest.mark.parametrize(
    "module",
    ["case/evaluation.py", "sweep/evaluation/tasks.py", "sweep/evaluation/study_case.py", "scenario/site.py",
     "crowd_mapping/lanes/fit.py", "simulation/network.py", "planning/plan.py",
     "behaviour/speed_plan.py", "metrics/drive.py", "files/ros_map.py", "road.py", "frames.py"],
)  # fmt: skip
def test_edit_of_a_module_that_decides_a_result_makes_new_results(copy: Path, module: str) -> None:
    before = digest_of(copy)
    (copy / module).write_text((copy / module).read_text() + "# edited\n")
    assert digest_of(copy) != before


def test_new_module_and_one_that_moves_make_new_results_and_a_page_does_not(copy: Path) -> None:
    before = digest_of(copy)
    (copy / "report" / "other.py").write_text("")
    assert digest_of(copy) == before
    (copy / "case" / "other.py").write_text("")
    with_one_more = digest_of(copy)
    assert with_one_more != before
    (copy / "case" / "other.py").rename(copy / "scenario" / "other.py")
    assert digest_of(copy) not in {before, with_one_more}
