"""The gallery: every zone of the library as `wzsumo layout` draws it, and the studies with what was measured of them."""

import re
from pathlib import Path

from site_pages import ROOT

from wzsumo.figures.layout_figure import draw_zone
from wzsumo.files.layout import layout_geojson
from wzsumo.files.result_folder import ResultFolder
from wzsumo.scenario.scenario import load_scenario

# Figures of docs/results/ that answer a study.
ANSWERS = {
    "how_many_traces": ("../results/how_many_traces.md", "../results/how_many_traces.png"),
    "device_faults": ("../results/lidar_baseline.md", "../results/lidar_faults.png"),
}


def zones_page(site: Path) -> str:
    """Every zone of the library with its figure, which is written beside the page."""
    lines = ["# The zones of the library", "",
             "Each as `wzsumo layout NAME` draws it: signs, the plan along the road, a stretch to scale.",
             "What they are in the manual's terms: [zones](../guide/zones.md).", ""]  # fmt: skip
    for path in sorted((ROOT / "scenarios").glob("*.toml")):
        scenario = load_scenario(path)
        drawing = ResultFolder(folder=site, result={}, layout=layout_geojson(scenario.facility().layout))
        target = site / "gallery" / "zones" / f"{path.stem}.png"
        target.parent.mkdir(parents=True, exist_ok=True)
        draw_zone(drawing).savefig(target, dpi=100)
        about = f"The zone {path.stem}: signs, plan and a stretch to scale"
        lines += [f"## {path.stem}", "", _remarks(path), "", f"![{about}](zones/{path.stem}.png)", ""]
    return "\n".join(lines)


def studies_page() -> str:
    """The studies that come with the toolkit: what they ask, their files, and the figures that were measured."""
    lines = ["# The studies", "", "`wzsumo sweep scenarios/studies/NAME.toml --out DIR`, then `wzsumo report DIR`.",
             "How to write one: [studies](../guide/studies.md).", ""]  # fmt: skip
    for path in sorted((ROOT / "scenarios" / "studies").glob("*.toml")):
        body = re.sub(r"\A(?:#.*\n)+", "", path.read_text(encoding="utf-8"))
        lines += [f"## {path.stem}", "", _remarks(path), "", "```toml", body.strip(), "```", ""]
        if path.stem in ANSWERS:
            page, figure = ANSWERS[path.stem]
            lines += [f"![What was measured of {path.stem}]({figure})", "", f"[What was measured]({page})", ""]
    return "\n".join(lines)


def _remarks(path: Path) -> str:
    """The comment at the head of a file, without the lines for editors."""
    head = re.match(r"(?:#.*\n)+", path.read_text(encoding="utf-8"))
    lines = [line.lstrip("#").rstrip() for line in head.group().splitlines() if not line.startswith("#:")] if head else []
    return "\n".join(line if line.startswith("     ") else line.strip() for line in lines)
