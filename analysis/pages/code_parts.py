"""The parts of the code that decide results, and a fingerprint of each that only a change of what the code does alters."""

import ast
import hashlib
import json
import subprocess
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
# Files and folders of each part, and files of them that are left out (-). A result may name a file or a folder beside them.
PARTS: dict[str, tuple[str, ...]] = {
    "zone": (
        "wzsumo/mutcd", "-wzsumo/mutcd/other_states.py", "wzsumo/road.py", "wzsumo/tapers.py", "wzsumo/work_zone.py",
    ),
    "zone that changes": ("wzsumo/mutcd/other_states.py",),
    "traffic": (  # without what places an ego in it, and without how SUMO is begun and ended
        "wzsumo/simulation", "-wzsumo/simulation/ego_bodies.py", "-wzsumo/simulation/session.py",
        "-wzsumo/simulation/connection.py", "wzsumo/capacity.py", "wzsumo/traffic.py",
    ),
    "sensing": ("wzsumo/sensing", "wzsumo/scan.py"),
    "lane map": (
        "wzsumo/crowd_mapping/cleaning", "wzsumo/crowd_mapping/lanes", "wzsumo/crowd_mapping/reference_line.py",
        "wzsumo/announced_zone.py", "wzsumo/grid.py", "wzsumo/lane_map.py", "wzsumo/road_projection.py",
    ),
    "mixture map": ("wzsumo/crowd_mapping/mixture", "wzsumo/crowd_mapping/map_before.py"),
    "LiDAR map": ("wzsumo/lidar_mapping",),
    "plan": ("wzsumo/planning", "wzsumo/path.py", "wzsumo/vehicle.py"),
    "drive": (
        "wzsumo/behaviour", "wzsumo/control", "wzsumo/ego.py", "wzsumo/simulation/ego_bodies.py",
        "wzsumo/simulation/session.py",
    ),
    "case": ("wzsumo/case", "wzsumo/scenario"),
    "metrics": ("wzsumo/metrics",),
    "live map": (  # what decides an alarm; not the folder that keeps it (wzsumo/live/stream)
        "wzsumo/live/ageing.py", "wzsumo/live/alarms.py", "wzsumo/live/charts", "wzsumo/live/ground.py",
        "wzsumo/live/live_map.py", "wzsumo/live/redraw.py", "wzsumo/live/shift_fit.py", "wzsumo/live/trace",
    ),
    "placement": ("wzsumo/placement",),
    "roads": ("wzsumo/roads",),
    "feeds": ("wzsumo/feeds",),
    "files": ("wzsumo/files", "wzsumo/input_files.py"),
    "studies": ("wzsumo/sweep",),
    "scenarios": ("scenarios",),
}  # fmt: skip
SUFFIXES = (".py", ".toml", ".json")


def fingerprint(part: str, *, commit: str | None = None) -> str:
    """Ten hex digits of what a part, or a file or folder named by its path, says in the folder as it is, or in a commit.

    Comments, docstrings, blank lines and the order of keys do not count. Raises LookupError where there is no such file.
    """
    names = PARTS.get(part, (part,))
    left_out = {name[1:] for name in names if name.startswith("-")}
    digest, n_files = hashlib.sha256(), 0
    for name in (name for name in names if not name.startswith("-")):
        files = _files_there(name) if commit is None else _files_at(name, commit)
        for path, text in (file for file in files if file[0] not in left_out):
            digest.update(f"{path}\n{_meaning(path, text)}\n".encode())
            n_files += 1
    if not n_files:
        raise LookupError(f"{part}: no part of the code and no file of the project; parts are {', '.join(PARTS)}")
    return digest.hexdigest()[:10]


def _files_there(name: str) -> Iterator[tuple[str, str]]:
    start = ROOT / name
    found = [start] if start.is_file() else sorted(path for path in start.rglob("*") if path.suffix in SUFFIXES)
    for path in found:
        yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")


def _files_at(name: str, commit: str) -> Iterator[tuple[str, str]]:
    for path in sorted(_git("ls-tree", "-r", "--name-only", commit, "--", name).splitlines(), key=Path):
        if path.endswith(SUFFIXES):
            yield path, _git("show", f"{commit}:{path}")


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout


@cache
def _meaning(path: str, text: str) -> str:
    """A file's text without what decides nothing."""
    if path.endswith(".py"):
        return _said(ast.parse(text))
    read = tomllib.loads if path.endswith(".toml") else json.loads
    return json.dumps(read(text), sort_keys=True, default=str)


def _said(node: object) -> str:
    """A syntax tree as text that is the same in every version of Python: empty fields and docstrings are left out."""
    if isinstance(node, ast.AST):
        fields: Mapping[str, object] = dict(ast.iter_fields(node))
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            fields = dict(fields) | {"body": [line for line in node.body if not _is_remark(line)]}
        told = (f"{name}={_said(value)}" for name, value in sorted(fields.items()) if value is not None and value != [])
        return f"{type(node).__name__}({','.join(told)})"
    if isinstance(node, list):
        return f"[{','.join(map(_said, node))}]"
    return repr(node)


def _is_remark(line: ast.stmt) -> bool:
    return isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant) and isinstance(line.value.value, str)
