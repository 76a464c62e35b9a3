"""Imports run one way: cli -> study -> stages -> nouns -> base; everything but simulation/ and study/ works without SUMO."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import wzsumo

PACKAGE = Path(wzsumo.__file__).parent
BASE = {"cloud", "rigid", "errors", "output", "units", "frames", "tables", "spec"}
NOUNS = {"capacity", "scan", "traces_file", "road", "road_projection", "work_zone", "vehicle", "grid", "path", "ego"}
ENTRY = {"cli", "__main__"}
STAGES = {folder.name for folder in PACKAGE.iterdir() if (folder / "__init__.py").exists()} - {"study"}
SUMO_PACKAGES = {"libsumo", "traci", "sumo", "sumolib"}
FILES = sorted(PACKAGE.rglob("*.py"))


def module_name(path):
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(path):
    """Every module that a file imports, also inside functions; relative imports are resolved."""
    package = path.relative_to(PACKAGE.parent).with_suffix("").parts[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            stem = [*package[: len(package) - node.level + 1], *filter(None, [node.module])] if node.level else [node.module]
            yield ".".join(stem)
            yield from (".".join([*stem, alias.name]) for alias in node.names)


def part_of(module):
    """Second name of a module of ours: a root module or a folder; None for other packages and for the package itself."""
    names = module.split(".")
    return names[1] if names[0] == "wzsumo" and len(names) > 1 else None


def allowed_from(part):
    if part in BASE:
        return BASE
    if part in NOUNS:
        return BASE | NOUNS
    if part in STAGES:
        return BASE | NOUNS | {part}
    if part == "study":
        return BASE | NOUNS | STAGES | {"study"}
    assert part in ENTRY, f"wzsumo.{part} is neither base, noun, stage, study nor entry: give it a place"
    return BASE | NOUNS | STAGES | ENTRY | {"study"}


def modules_of_ours(path):
    known = BASE | NOUNS | STAGES | ENTRY | {"study"}
    return {part for module in imports_of(path) if (part := part_of(module)) in known or part == "study"}


@pytest.mark.parametrize("path", [p for p in FILES if part_of(module_name(p))], ids=module_name)
def test_module_imports_only_from_layers_below_it(path):
    assert modules_of_ours(path) <= allowed_from(part_of(module_name(path)))


def test_only_simulation_connection_imports_libsumo():
    importers = {module_name(p) for p in FILES for m in imports_of(p) if m.split(".")[0] in {"libsumo", "traci"}}
    assert importers == {"wzsumo.simulation.connection"}


def run_python(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=PACKAGE.parent)


def test_modules_outside_simulation_and_study_import_where_sumo_is_missing():
    names = [
        name for p in FILES if part_of(name := module_name(p)) not in {"simulation", "study"} and not name.endswith("__main__")
    ]
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


def test_importing_the_package_alone_loads_no_heavy_library():
    done = run_python("import sys, wzsumo; print(*sorted({name.split('.')[0] for name in sys.modules}))")
    heavy = {"numpy", "pandas", "scipy", "matplotlib", "numba", "shapely", "pydantic", "pyarrow", "sklearn", *SUMO_PACKAGES}
    assert done.returncode == 0, done.stderr
    assert not heavy & set(done.stdout.split())
