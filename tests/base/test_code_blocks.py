"""The code blocks of README and guide do what they say: Python runs, commands are run or, where they take long, understood."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from builders import straight_traces
from sweep_trials import a_study, evaluate_cases, simulate, sweep

from wzsumo import cli
from wzsumo.scenario.road_before import read_map_before
from wzsumo.scenario.scenario import load_scenario
from wzsumo.scenario.zone_to_place import read_zone_to_place
from wzsumo.simulation.connection import sumo_binary
from wzsumo.sweep import task_queue
from wzsumo.sweep.study_file import load_study

ROOT = Path(__file__).parents[2]
GUIDE = ROOT / "docs" / "guide"
PAGES = sorted([ROOT / "README.md", *GUIDE.glob("*.md")])
BLOCK = re.compile(
    r"^```(\w*)\n(.*?)^```|(?:(?<=\n\n)|\A)((?: {4}[^\n]*\n)(?:(?: {4}[^\n]*)?\n)*)", flags=re.MULTILINE | re.DOTALL
)
PROGRAMS = {"wzsumo", "make", "pip", "cp", "cd", "dask", "netconvert", "sumo-gui", "producer", "D=tests/data/prairie_center"}
# Words that stand for something of the reader's, and what they are here.
PLACES = {"ZONE": "right_lane", "FORMAT": "lanelet2", "N": "1", "NAME": "c1", "EDGE": "E12", "POS": "340"}
# What is run: it takes seconds. The tests of the other commands run them.
RUN = {"init", "layout", "capacity", "export", "plan", "map"}


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of code of a page in a language: "python", "toml" or "sh"."""
    found = []
    for named, fenced, indented in BLOCK.findall(page.read_text(encoding="utf-8")):
        code = fenced or re.sub(r"^    ", "", indented, flags=re.MULTILINE)
        kind = named or ("python" if code.startswith("import ") else "toml" if code.startswith("[") else "sh")
        found += [code] if kind == language else []
    return found


def commands(page: Path) -> list[list[str]]:
    """The words of every command of a page, without remarks."""
    lines = [line.strip().removeprefix(".venv/bin/") for code in blocks(page, "sh") for line in code.splitlines()]
    lines = [re.split(r"\s{2,}|\s#", line)[0] for line in lines if line.split(" ")[0] in PROGRAMS]
    return [shlex.split(re.sub(r"\[.*?\]", "", line)) for line in lines]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_of_a_page_are_those_of_the_programs(page: Path) -> None:
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    for command in commands(page):
        before_pipe = len(command) - command[::-1].index("|") if "|" in command else 0
        program, *words = command[before_pipe:]
        if program == "make":
            assert set(words) <= targets
        if program == "wzsumo":
            words = [PLACES.get(word, word) for word in words]
            words = ["1.0" if word in {"X", "Y", "DEG"} else word for word in words]
            assert cli._parser(words).parse_args(words).command == words[0]


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the guide talks about: scenarios of little traffic, traces along a road, a road, a feed."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").mkdir()
    for name in ("paper", "left_lane", "right_lane"):
        text = (ROOT / "scenarios" / f"{name}.toml").read_text(encoding="utf-8")
        text = re.sub("^penetration = .*", "penetration = 1.0", text, flags=re.MULTILINE)
        (tmp_path / "scenarios" / f"{name}.toml").write_text(text.replace("duration_s = 900", "duration_s = 300"))
    shutil.copyfile(tmp_path / "scenarios" / "paper.toml", "SCENARIO.toml")
    traces = straight_traces([1.8, 1.9, 5.4, 5.6], length_m=600.0)
    (tmp_path / "PARTS").mkdir()
    for name in ("TRACES.csv", "MONDAY.csv.gz", "PARTS/1.csv", "traces.csv", "TRACES"):
        traces.to_csv(name, index=False)
    road = next(code for code in blocks(GUIDE / "your_traces.md", "toml") if "[announced]" in code)
    for name in ("road.toml", "ROAD.toml"):
        Path(name).write_text(road)
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    (tmp_path / "out").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("page", "names"),
    [
        ("scenarios.md", {"init", "layout"}),
        ("your_traces.md", {"map"}),
        ("worked_example.md", {"map", "export"}),
    ],
)
def test_commands_of_a_page_run_one_after_the_other(desk: Path, page: str, names: set[str]) -> None:
    ran = set()
    for command in commands(GUIDE / page):
        if command[0] == "wzsumo" and command[1] in RUN:
            words = [word.replace("$D", "tests/data/prairie_center") for word in command[1:]]
            words = [name for word in words for name in (sorted(map(str, desk.glob(word))) if "*" in word else [word])]
            with pytest.raises(SystemExit) as stopped:
                cli.main(words)
            assert stopped.value.code == 0, command
            ran.add(command[1])
    assert ran >= names


def test_worked_example_of_placing_a_zone_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("freeway.nod.xml", "freeway.edg.xml", "freeway.rou.xml", "freeway.add.xml", "zone.toml"):
        shutil.copyfile(GUIDE / "place_example" / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    found = [command for command in commands(GUIDE / "place.md") if any("freeway" in word for word in command[1:])]
    made = {command[0]: [re.sub("^/tmp/", f"{tmp_path}/", word) for word in command[1:]] for command in found}
    subprocess.run([sumo_binary("netconvert"), *made["netconvert"]], check=True, capture_output=True)
    with pytest.raises(SystemExit) as stopped:
        cli.main(made["wzsumo"])
    assert stopped.value.code == 0
    assert (tmp_path / "placed" / "closed" / "run.sumocfg").exists()


def test_first_lines_of_the_readme_print_what_it_shows_but_for_the_figures(
    desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copyfile(desk / "scenarios" / "right_lane.toml", "right_lane.toml")
    (code,) = blocks(ROOT / "README.md", "python")
    exec(compile(code, "README.md", "exec"), {})  # noqa: S102 - this is what is tested
    (shown,) = blocks(ROOT / "README.md", "text")
    figure = r"\d+(\.\d+)?"
    assert re.sub(figure, "#", capsys.readouterr().out).strip() == re.sub(figure, "#", shown).strip()


def test_python_of_the_guide_runs_in_the_order_of_its_pages(desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task_queue, "simulate", simulate)
    monkeypatch.setattr(task_queue, "evaluate_cases", evaluate_cases)
    sweep(a_study(seed=[1, 2], crowd__used=[1, 2], methods=["swept", "lanes"]), desk / "results" / "how_many_traces")
    for page in ("your_traces.md", "plan_on_a_map.md", "studies.md"):
        for code in blocks(GUIDE / page, "python"):
            if "dask_jobqueue" not in code:  # needs SLURM: the page says so
                exec(compile(code, page, "exec"), {})  # noqa: S102 - this is what is tested


def test_toml_of_the_guide_is_taken(desk: Path) -> None:
    (desk / "scenarios" / "studies").mkdir()
    study, _ = blocks(GUIDE / "studies.md", "toml")  # the other is a pyproject.toml
    Path("scenarios/studies/STUDY.toml").write_text(study)
    assert len(load_study(desk / "scenarios" / "studies" / "STUDY.toml").cases) > 4
    (place,) = blocks(GUIDE / "place.md", "toml")
    Path("zone.toml").write_text(place)
    assert read_zone_to_place(desk / "zone.toml").road.left_shoulder_ft == 4
    assert read_map_before(desk / "road.toml") is not None
    for part in blocks(GUIDE / "scenarios.md", "toml"):
        text = (ROOT / "scenarios" / "paper.toml").read_text(encoding="utf-8")
        Path("whole.toml").write_text(f"{text}\n{part}")
        load_scenario("whole.toml")
