"""Bad and odd inputs for every command: one function a kind of input, from a random generator and an empty folder to the words.

Each breaks a good input in one or two places. What a value is replaced by is in VALUES; damage to whole files in `damaged`.
"""

import json
import random
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomli_w
import yaml
from PIL import Image

REPOSITORY = Path(__file__).parents[2]
LIBRARY = sorted((REPOSITORY / "scenarios").glob("*.toml"))
HUGE = 10**30
VALUES: tuple[Any, ...] = (
    0, 1, -1, 2, 7, 1e-300, 1e-9, -1e-9, 0.5, 1e6, 1e9, -1e9, 1e300, 2**31 - 1, 2**31, 2**53 + 1, 2**63 - 1, 2**63,
    HUGE, float("nan"),
    float("inf"), float("-inf"), True, False, "", "3", "60 mph", "nan", "left", "right", "\x1b[2J", "\u202e\u2028",
    "x" * 20_000,
    [], [1], [0, 0], [-1], [1.0, float("nan")], ["a"], [[1]], [[0.0, 0.0], [0.0, 0.0]], [HUGE, HUGE], {}, {"a": 1},
    {"first": 1, "count": 10**7},
    {"first": 1, "count": 10**9}, {"first": -1, "count": 2}, list(range(3000)),
)  # fmt: skip
NUMBERS = (
    "0",
    "-1",
    "1e-300",
    "1e300",
    "nan",
    "inf",
    "-inf",
    "",
    "x",
    "9" * 5000,
    "1e5",
    "0x10",
    "²",
    "10",
    "0.5",
    "-0",
    "1_0",
)
Words = list[str]
Kind = Callable[[random.Random, Path], Words]


def scenario(rng: random.Random, folder: Path) -> Words:
    """A scenario of the library with odd values of one to three keys, for a command that reads one."""
    content = tomllib.loads(rng.choice(LIBRARY).read_text())
    for _ in range(rng.choice((1, 1, 2, 3))):
        _break_key(content, rng)
    path = folder / "zone.toml"
    _write_toml(content, path)
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
        _break_key(content, rng)
    path = folder / "study.toml"
    _write_toml(content, path)
    return ["sweep", str(path), "--out", str(folder / "out"), "--dry-run"]


def ros_map(rng: random.Random, folder: Path) -> Words:
    """A ROS map with odd metadata and images of all kinds, for `plan`."""
    shape = rng.choice(((40, 160), (1, 1), (1, 400), (400, 1), (41, 163)))
    pixels = np.full(shape, 254, dtype=np.uint8)
    if rng.random() < 0.3:
        pixels[:, shape[1] // 2 :] = rng.choice((0, 205))
    kind = rng.choice(("pgm", "png", "png16", "palette", "rgba", "float", "bmp", "one", "ascii"))
    name = f"m.{'tif' if kind == 'float' else 'bmp' if kind == 'bmp' else 'pgm' if kind in ('pgm', 'ascii') else 'png'}"
    _write_image(pixels, kind, folder / name)
    if rng.random() < 0.4:
        (folder / name).write_bytes(damaged((folder / name).read_bytes(), rng))
    metadata: dict[str, Any] = {
        "image": name,
        "resolution": 0.5,
        "origin": [0.0, -10.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
    }
    metadata |= {"free_thresh": 0.196, "mode": rng.choice(("trinary", "scale", "raw"))}
    for _ in range(rng.choice((0, 1, 2))):
        metadata[rng.choice((*metadata, "width", "height", "extra"))] = rng.choice(
            (*VALUES, "..", "/dev/zero", "/", "nothing.png", "m.yaml")
        )
    text = yaml.safe_dump(metadata) if rng.random() < 0.85 else _odd_yaml(metadata, rng)
    content = text.encode("utf-8", "surrogatepass")
    (folder / "m.yaml").write_bytes(damaged(content, rng) if rng.random() < 0.15 else content)
    start, goal = ["10", "0", "0"], ["60", "0", "0"]
    if rng.random() < 0.3:
        rng.choice((start, goal))[rng.randrange(3)] = rng.choice(NUMBERS)
    speed = ["--speed-mps", rng.choice(NUMBERS)] if rng.random() < 0.3 else []
    return ["plan", str(folder / "m.yaml"), "--start", *start, "--goal", *goal, "--out", str(folder / "p.csv"), *speed]


def cloud(rng: random.Random, folder: Path) -> Words:
    """A point cloud that is damaged, empty, of odd types or says that it is huge."""
    points = np.random.default_rng(rng.randrange(1000)).normal(0, 5, (rng.choice((0, 1, 3, 300)), rng.choice((2, 3, 3, 3, 4))))
    kind = rng.choice(("npy", "csv", "ply"))
    path = folder / f"c.{kind}"
    if kind == "npy":
        values: Any = (
            points
            if rng.random() < 0.6
            else rng.choice((points.astype("f2"), points.astype(complex), points.astype(str), points * 1e300))
        )
        np.save(path, values)
        if rng.random() < 0.4:
            count = rng.choice((10**9, 10**15, 10**30, -1))
            header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({count}, 3), }}".ljust(117) + "\n"
            path.write_bytes(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + b"\0" * 2400)
    elif kind == "csv":
        pd.DataFrame(points).to_csv(path, index=False, header=rng.random() < 0.5)
    else:
        count = rng.choice((len(points), 10**9, 10**30, -1))
        head = (
            f"ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        )
        path.write_text(head + "\n".join(" ".join(map(str, row)) for row in points))
    if rng.random() < 0.5:
        path.write_bytes(damaged(path.read_bytes(), rng))
    option = [rng.choice(("--cell-m", "--slope", "--window-m", "--scalar")), rng.choice(NUMBERS)] if rng.random() < 0.3 else []
    if rng.random() < 0.7:
        return ["ground", str(path), "--out", str(folder / "labels.npy"), *option]
    return ["register", str(path), str(path), "--out", str(folder / "t.txt")]


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
            _break_key(value, rng)
            path.write_text(json.dumps(value))
        elif how != "gone":
            path.write_bytes({"empty": b"", "null": b"null"}.get(how) or damaged(content, rng))
    return ["report", str(folder)]


def lanes(rng: random.Random, folder: Path) -> Words:
    """The lanes of a layout with odd values, for `export`."""
    path = folder / "lanes.geojson"
    content = json.loads(path.read_text())
    for _ in range(rng.choice((1, 1, 2))):
        _break_key(content, rng)
    text = json.dumps(content).encode()
    path.write_bytes(damaged(text, rng) if rng.random() < 0.2 else text)
    origin = ["--origin", rng.choice(("42.3", *NUMBERS)), rng.choice(("-83.1", *NUMBERS))]
    about = [
        "--about",
        rng.choice(("start_date=2026-06-01T00:00:00Z", "start_date=\x1b", "x", "publisher=" + "y" * 5000)),
        "end_date=2026-06-02T00:00:00Z",
    ]
    target = rng.choice(("lanelet2", "opendrive", "geoparquet", "wzdx"))
    limit = ["--speed-limit-mph", rng.choice(NUMBERS)] if rng.random() < 0.3 else []
    return [
        "export",
        str(path),
        "--to",
        target,
        "--out",
        str(folder / "exported"),
        *origin,
        *limit,
        *(about if target == "wzdx" else []),
    ]


def damaged(content: bytes, rng: random.Random) -> bytes:
    """The bytes cut, with bits flipped, with bytes put in, doubled, or with a byte order mark."""
    how = rng.choice(("cut", "flip", "insert", "double", "bom", "zeros", "nest", "latin", "digits"))
    at = rng.randrange(len(content) + 1)
    if how == "flip" and content:
        changed = bytearray(content)
        for _ in range(rng.choice((1, 4, 40))):
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
        return bytes(changed)
    inserted = {
        "insert": rng.randbytes(5), "zeros": b"\0" * 100, "nest": b"\na = " + b"[" * 20_000, "latin": b"\xe9\xff",
        "digits": b"\nb = " + b"9" * 6000,
    }  # fmt: skip
    if how in inserted:
        return content[:at] + inserted[how] + content[at:]
    return {"cut": content[:at], "double": content + content, "bom": b"\xef\xbb\xbf" + content}.get(how, content)


KINDS: dict[str, Kind] = {
    "scenario": scenario, "scenario as text": scenario_text, "study": study, "ROS map": ros_map, "cloud": cloud, "words": words,
    "run's folder": report_folder, "study's folder": report_folder, "lanes": lanes,
}  # fmt: skip


def _with_scenario(path: Path, rng: random.Random, folder: Path) -> Words:
    command = rng.choice(("layout", "capacity", "net"))
    return [command, str(path), *(["--out", str(folder / "out")] if command != "capacity" else [])]


def _break_key(content: Any, rng: random.Random) -> None:
    """Replace, remove, rename or add something at a random place of nested tables and lists."""
    at = content
    while True:
        keys = list(at) if isinstance(at, dict) else list(range(len(at)))
        if not keys:
            break
        key = rng.choice(keys)
        if isinstance(at[key], dict | list) and at[key] and rng.random() < 0.85:
            at = at[key]
            continue
        how = rng.random()
        if how < 0.8:
            at[key] = rng.choice(VALUES)
        elif how < 0.9:
            del at[key]
        elif isinstance(at, dict):
            at[rng.choice(("\x1b]0;x\x07", "k" * 3000, str(key).upper(), ""))] = at[key]
        break


def _write_toml(content: dict[str, Any], path: Path) -> None:
    path.write_text(tomli_w.dumps(content), encoding="utf-8", errors="surrogatepass")


def _odd_yaml(metadata: dict[str, Any], rng: random.Random) -> str:
    text = yaml.safe_dump(metadata)
    layers = "\n".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9) if n else 1}]" for n in range(9))
    odd = ("\n? [a, b]\n: 1\n", "\nx: !!python/object/apply:os.system [ls]\n", "\nx: " + "[" * 3000,
    f"\n{layers}\norigin: *a8\n", "\nresolution: 2001-99-99\n",
           "\nnegate: 'no'\n", "\nresolution: 1" + "0" * 5000 + "\n", "\n---\na: 1\n", "\n<<: *z\n")  # fmt: skip
    return text + rng.choice(odd)


def _write_image(pixels: Any, kind: str, path: Path) -> None:
    rows, cols = pixels.shape
    if kind == "pgm":
        path.write_bytes(b"P5\n%d %d\n255\n" % (cols, rows) + pixels.tobytes())
    elif kind == "ascii":
        path.write_text(f"P2\n{cols} {rows}\n255\n" + " ".join(map(str, pixels.ravel())))
    elif kind == "png16":
        Image.fromarray(pixels.astype(np.uint16) * 257).save(path)
    elif kind == "float":
        Image.fromarray(pixels.astype(np.float32) / 255).save(path)
    else:
        modes = {"palette": "P", "rgba": "RGBA", "one": "1"}
        Image.fromarray(pixels).convert(modes.get(kind, "L")).save(path)
