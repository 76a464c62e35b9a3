"""Bad and odd inputs for every command: one function a kind of input, from a random generator and an empty folder to the words.

Each breaks a good input in one or two places. The kinds of maps, traces and networks have modules of their own.
"""

import json
import random
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import known_answers
from damage import NUMBERS, VALUES, break_key, damaged, write_toml
from map_inputs import cloud, lanes, ros_map
from networks import feed, network_scenario, placement
from trace_inputs import stream, traces

REPOSITORY = Path(__file__).parents[2]
LIBRARY = sorted((REPOSITORY / "scenarios").glob("*.toml"))
Words = list[str]
Kind = Callable[[random.Random, Path], Words]


def scenario(rng: random.Random, folder: Path) -> Words:
    """A scenario of the library with odd values of one to three keys, for a command that reads one."""
    content = tomllib.loads(rng.choice(LIBRARY).read_text())
    for _ in range(rng.choice((1, 1, 2, 3))):
        break_key(content, rng)
    path = folder / "zone.toml"
    write_toml(content, path)
    return _with_scenario(path, rng, folder)


def scenario_text(rng: random.Random, folder: Path) -> Words:
    """A scenario whose bytes are damaged."""
    path = folder / "zone.toml"
    path.write_bytes(damaged(rng.choice(LIBRARY).read_bytes(), rng))
    return _with_scenario(path, rng, folder)


def study(rng: random.Random, folder: Path) -> Words:
    """A study with odd keys, factors and values; its cases are counted, not run."""
    (folder / "paper.toml").write_bytes((REPOSITORY / "scenarios" / "paper.toml").read_bytes())
    content: dict[str, Any] = {
        "name": "s",
        "scenarios": ["paper.toml"],
        "methods": ["swept", "lanes"],
        "grid": {"seed": [1, 2]},
    }
    factors = (
        "crowd.used",
        "work_zone.posted_speed_mph",
        "gnss.error_m",
        "simulation.demand.flow_vph",
        "seed",
        "road",
        "nonsense.key",
    )
    for _ in range(rng.choice((1, 2, 3))):
        place = content[rng.choice(("grid", "fixed"))] = content.get("grid", {})
        value = rng.choice(VALUES)
        place[rng.choice(factors)] = rng.choice(
            (value, [value], [value, value], [1, value], list(range(300)), [float(n) for n in range(99)])
        )
    if rng.random() < 0.4:
        break_key(content, rng)
    path = folder / "study.toml"
    write_toml(content, path)
    return ["sweep", str(path), "--out", str(folder / "out"), "--dry-run"]


def words(rng: random.Random, folder: Path) -> Words:
    """Commands with wrong, missing and repeated options; folders in the place of files, files in the place of folders."""
    (folder / "file").write_text("a file")
    (folder / "folder").mkdir()
    paper = str(REPOSITORY / "scenarios" / "paper.toml")
    places = (
        paper,
        str(folder / "file"),
        str(folder / "folder"),
        "/dev/null",
        "/",
        ".",
        "",
        "x" * 300,
        str(folder / "file" / "x"),
        "-",
        "/proc/self/mem",
        "\udce9.toml",
    )
    outs = (str(folder / "out"), str(folder / "file"), "/dev/null/x", "/proc/x", "y" * 300, str(folder / "file" / "x"), "/")
    good = {
        "init": ["paper"], "layout": [paper], "net": [paper], "capacity": [paper], "sweep": [paper, "--dry-run"],
        "report": [str(folder)],
        "plan": [paper, "--start", "0", "0", "0", "--goal", "1", "0", "0"], "ground": [paper], "register": [paper, paper],
        "export": [paper, "--to", "opendrive"], "map": [paper], "place": [paper, "--zone", paper, "--at", "e", "1"],
        "run": [paper, "--method", "none"],
    }  # fmt: skip
    name = rng.choice(list(good))
    chosen = [rng.choice(places) if word == paper and rng.random() < 0.6 else word for word in good[name]]
    if name not in {"capacity", "report"} and rng.random() < 0.9:
        chosen += ["--out", rng.choice(outs)]
    for _ in range(rng.choice((0, 0, 1, 2))):
        extra = rng.choice(
            (
                "--seed",
                "--json",
                "--method",
                "--workers",
                "--columns",
                "--direction",
                "--resolution-m",
                "--origin",
                "--nonsense",
                "--help",
                "--to",
                "--at-latlon",
            )
        )
        chosen += [extra, *rng.choices(NUMBERS, k=rng.choice((0, 1, 1, 2)))]
    if rng.random() < 0.15:
        rng.shuffle(chosen)
    return [name, *chosen]


def report_folder(rng: random.Random, folder: Path) -> Words:
    """A run's or a study's folder of which one or two files are damaged, of another kind, folders or gone; for `report`."""
    files = [
        path
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix not in {".png", ".html", ".xml", ".sumocfg"}
    ]
    for path in rng.sample(files, k=min(len(files), rng.choice((1, 1, 1, 2)))):
        how = rng.choice(("damage", "damage", "json", "empty", "folder", "gone", "link", "other", "null"))
        content = path.read_bytes()
        path.unlink()
        if how == "folder":
            path.mkdir()
        elif how == "link":
            path.symlink_to("/nowhere")
        elif how == "other":
            path.write_bytes(rng.choice([other for other in files if other.is_file()]).read_bytes())
        elif how == "json" and path.suffix in {".json", ".geojson"}:
            value = json.loads(content)
            break_key(value, rng)
            path.write_text(json.dumps(value))
        elif how != "gone":
            path.write_bytes({"empty": b"", "null": b"null"}.get(how) or damaged(content, rng))
    return ["report", str(folder)]


KINDS: dict[str, Kind] = {
    "scenario": scenario, "scenario as text": scenario_text, "study": study, "ROS map": ros_map, "cloud": cloud, "words": words,
    "run's folder": report_folder, "study's folder": report_folder, "lanes": lanes, "traces": traces, "live": stream,
    "place": placement, "network": network_scenario, "feed": feed, "known table": known_answers.table,
    "known image": known_answers.image,
}  # fmt: skip


def _with_scenario(path: Path, rng: random.Random, folder: Path) -> Words:
    command = rng.choice(("layout", "capacity", "net"))
    return [command, str(path), *(["--out", str(folder / "out")] if command != "capacity" else [])]
