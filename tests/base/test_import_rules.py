"""Imports run down the floors of the house; SUMO is loaded where it is used, and nowhere on the way to a map or a plan."""

import ast
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import wzsumo

PACKAGE = Path(wzsumo.__file__).parent
# The floors of the house, from the top. A module imports from its own folder and from lower floors; the stages share a floor
# and import none of each other.
FLOORS = (
    ({"cli", "__main__", "commands"}, "one house"),
    ({"api"}, "one house"),
    ({"report", "figures"}, "one house"),
    ({"sweep"}, "one house"),
    ({"case"}, "one house"),
    ({"live"}, "one house"),
    ({"scenario"}, "one house"),
    ({"placement"}, "one house"),
    (
        {"mutcd", "simulation", "sensing", "crowd_mapping", "lidar_mapping", "planning", "behaviour", "control", "metrics",
         "roads", "feeds", "files"},
        "apart",
    ),
    (
        {"announced_zone", "capacity", "ego", "grid", "lane_map", "path", "road", "road_projection", "scan", "tapers",
         "traffic", "vehicle", "work_zone"},
        "one house",
    ),
    ({"errors", "frames", "geography", "input_files", "rigid", "spec", "tables", "units"}, "one house"),
)  # fmt: skip
SUMO_PACKAGES = {"libsumo", "traci", "sumo", "sumolib"}
FILES = sorted(PACKAGE.rglob("*.py"))


def module_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(path: Path) -> Iterator[str]:
    """Every module that a file imports, also inside functions; relative imports are resolved."""
    package = path.relative_to(PACKAGE.parent).with_suffix("").parts[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            stem = [*above, *filter(None, [node.module])]
            yield ".".join(stem)
            yield from (".".join([*stem, alias.name]) for alias in node.names)


def part_of(module: str) -> str | None:
    """Second name of a module of ours: a root module or a folder; None for other packages and for the package itself."""
    names = module.split(".")
    return names[1] if names[0] == "wzsumo" and len(names) > 1 else None


def floor_of(part: str) -> int:
    floors = [number for number, (parts, _) in enumerate(FLOORS) if part in parts]
    assert len(floors) == 1, f"wzsumo.{part} must be on one floor of the house: give it a place in FLOORS"
    return floors[0]


def allowed_from(part: str) -> set[str]:
    floor = floor_of(part)
    parts, together = FLOORS[floor]
    below: set[str] = set().union(*(lower for lower, _ in FLOORS[floor + 1 :]))
    return below | (parts if together == "one house" else {part})


def modules_of_ours(path: Path) -> set[str]:
    known: set[str] = set().union(*(parts for parts, _ in FLOORS))
    return {part for module in imports_of(path) if (part := part_of(module)) and part in known}


@pytest.mark.parametrize("path", [p for p in FILES if part_of(module_name(p))], ids=module_name)
def test_module_imports_only_from_its_own_folder_and_from_lower_floors(path: Path) -> None:
    part = part_of(module_name(path))
    assert part is not None
    assert modules_of_ours(path) <= allowed_from(part)


def test_no_modules_import_each_other_in_a_circle() -> None:
    names = {module_name(path) for path in FILES}
    graph = {module_name(path): {module for module in imports_of(path) if module in names} for path in FILES}
    graph["wzsumo"] = set()  # its names are loaded when they are first used
    assert list(TopologicalSorter(graph).static_order())


def test_no_folder_holds_more_than_one_idea() -> None:
    sizes = Counter(path.parent.relative_to(PACKAGE).as_posix() for path in FILES if path.name != "__init__.py")
    assert {folder: size for folder, size in sizes.items() if size > (24 if folder == "." else 16)} == {}


def test_only_simulation_connection_imports_libsumo() -> None:
    importers = {module_name(p) for p in FILES for m in imports_of(p) if m.split(".")[0] in {"libsumo", "traci"}}
    assert importers == {"wzsumo.simulation.connection"}


def run_python(code: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=PACKAGE.parent)


def test_modules_below_the_case_import_where_sumo_is_missing() -> None:
    names = [name for p in FILES if (part := part_of(name := module_name(p))) and floor_of(part) > 4 and part != "simulation"]
    assert len(names) > 20
    done = run_python(f"""
import importlib, sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {SUMO_PACKAGES!r}:
            raise ImportError(name + " is blocked")
sys.meta_path.insert(0, Blocker())
for name in {names!r}:
    importlib.import_module(name)
""")
    assert done.returncode == 0, done.stderr


def test_importing_the_package_alone_loads_no_heavy_library() -> None:
    done = run_python("import sys, wzsumo; print(*sorted({name.split('.')[0] for name in sys.modules}))")
    heavy = {"numpy", "pandas", "scipy", "matplotlib", "numba", "shapely", "pydantic", "pyarrow", "sklearn", *SUMO_PACKAGES}
    assert done.returncode == 0, done.stderr
    assert not heavy & set(done.stdout.split())
