"""Bad and odd ROS maps, point clouds and lanes: one function a kind of input."""

import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from damage import NUMBERS, VALUES, break_key, damaged
from PIL import Image


def ros_map(rng: random.Random, folder: Path) -> list[str]:
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


def cloud(rng: random.Random, folder: Path) -> list[str]:
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


def lanes(rng: random.Random, folder: Path) -> list[str]:
    """The lanes of a layout with odd values, for `export`."""
    path = folder / "lanes.geojson"
    content = json.loads(path.read_text())
    for _ in range(rng.choice((1, 1, 2))):
        break_key(content, rng)
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
