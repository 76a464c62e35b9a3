"""The worked example of docs/guide/worked_example.md: four drives through a work zone, from files to map, feed and exports.

    python analysis/worked_example/prairie_center.py --out docs/results

Writes prairie_center.json (where the zone was announced, where the drivers marked it, what the map shows) and the drawings of
zone.html as prairie_center_map.svg and prairie_center_road.svg.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wzsumo.files.frame import read_frame
from wzsumo.files.lanes import read_lanes
from wzsumo.files.traces import read_fixes

DRIVES = Path(__file__).parents[2] / "tests" / "data" / "prairie_center"
FORMATS = {"lanelet2": "zone.osm", "opendrive": "zone.xodr", "geoparquet": "lanes.parquet", "wzdx": "feed.geojson"}
ABOUT = ("--about", "road_name=Prairie Center Cir", "publisher=Example", "end_date=2020-06-22T11:57:00Z")


def wzsumo(*words: str | Path) -> dict[str, Any]:
    """The figures that a command prints with --json."""
    command = [sys.executable, "-m", "wzsumo", *map(str, words), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def marked(folder: Path) -> dict[str, Any]:
    """Stations [m] along the map's road at which the drivers marked that the left lane closes (LC) and opens (LO)."""
    frame, lanes = read_frame(folder), read_lanes(folder).lanes
    if frame is None:
        raise RuntimeError(f"{folder}: no frame")
    drives = pd.concat([pd.read_csv(path) for path in sorted(DRIVES.glob("*.csv.gz"))])
    found = {}
    for name, marker in (("start", "LC"), ("end", "LO")):
        rows = drives[drives["Marker"] == marker]
        stations, _ = lanes.axis.to_sd(frame.from_lonlat(rows[["Longitude", "Latitude"]].to_numpy()))
        found[name] = {"mean_m": float(stations.mean()), "sd_m": float(stations.std(ddof=1)), "n": len(stations)}
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        road, zone = DRIVES / "road.geojson", DRIVES / "announced.geojson"
        figures = wzsumo("map", *sorted(DRIVES.glob("*.csv.gz")), "--road", road, "--zone", zone, "--out", folder)
        exports = {}
        for kind, file in FORMATS.items():
            about = ABOUT if kind == "wzdx" else ()
            wzsumo("export", folder, "--to", kind, "--out", folder / file, *about)
            exports[kind] = (folder / file).stat().st_size
        feed = json.loads((folder / "feed.geojson").read_text())
        result = {
            "n_fixes": len(read_fixes([DRIVES]).table),
            "announced": {key: figures["announced"][key] for key in ("start_m", "end_m", "start_sd_m", "end_sd_m")},
            "marked": marked(folder),
            "verified": figures.get("verified"),
            "open_lanes": figures.get("open_lanes"),
            "free_m2": figures["free_m2"],
            "feed_verified": [
                [found["properties"][f"is_{end}_position_verified"] for end in ("start", "end")] for found in feed["features"]
            ],
            "export_bytes": exports,
            "warnings": figures["warnings"],
        }
        page = (folder / "zone.html").read_text()
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "prairie_center.json").write_text(json.dumps(_rounded(result), indent=1) + "\n")
    for drawing, svg in zip(("map", "road"), re.findall(r"<svg .*?</svg>", page, flags=re.DOTALL), strict=True):
        placed = svg.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" font-size="13" ', 1)
        (args.out / f"prairie_center_{drawing}.svg").write_text(placed + "\n")


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_rounded(inner) for inner in value]
    return round(float(value), 1) if isinstance(value, float | np.floating) else value


if __name__ == "__main__":
    main()
