import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", *ROOT.glob("CONTRIBUTING.md"), *ROOT.glob("docs/**/*.md")])
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
NAMED_FILE = re.compile(r"\b(?:(?:wzsumo|analysis|tests|scenarios|docs)/[\w./-]*[\w/]|[a-z_]+(?:/[a-z_]+)*/[a-z_]+\.py)\b")
COMMIT_HASH = r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*\d)[0-9a-f]{7}\b"
DIARY = ("the round before", "for want of", "older code", "code of before", "code as it is", "network of before", COMMIT_HASH)
every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def anchors_of(page: Path) -> set[str]:
    """What the links to a page's headings are called on GitHub."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@every_page
def test_every_relative_link_and_image_of_a_page_leads_somewhere(page: Path) -> None:
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), link
        assert not anchor or anchor in anchors_of(target), link


@every_page
def test_every_file_and_folder_of_the_project_that_a_page_names_is_there(page: Path) -> None:
    named = set(NAMED_FILE.findall(page.read_text(encoding="utf-8")))
    assert {
        name for name in named if not any((start / name).exists() for start in (ROOT, ROOT / "wzsumo", page.parent))
    } == set()


@every_page
def test_no_page_tells_how_it_came_about(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert [phrase for phrase in DIARY if re.search(phrase, text)] == []


@every_page
def test_what_is_to_be_measured_again_is_marked_with_one_of_two_phrases(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    marked = re.findall(r"\*\*Not yet measured on the present (?:traffic|code)\.\*\*", text)
    assert len(re.findall(r"not\s+yet\s+measured\s+on", text, flags=re.IGNORECASE)) == len(marked)


def test_table_of_the_calibration_page_is_that_of_its_csv() -> None:
    results = ROOT / "docs" / "results"
    script = ROOT / "analysis" / "traffic" / "calibrate_traffic.py"
    command = [sys.executable, str(script), "--out", str(results / "traffic_calibration.csv"), "table"]
    table = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert f"<!-- table -->\n{table}\n<!-- end -->" in (results / "traffic_calibration.md").read_text(encoding="utf-8")


def test_clearances_on_the_page_of_drives_are_those_of_its_csv() -> None:
    results = ROOT / "docs" / "results"
    rows = pd.read_csv(results / "library_drives.csv", dtype={"speed": str})
    page = (results / "library_drives.md").read_text(encoding="utf-8")
    drives = rows[rows["seed"].between(121, 125)]
    assert len(drives) == 320
    assert (drives["outcome"] == "REACHED_GOAL").all()
    for (method, speed), part in drives.groupby(["method", "speed"]):
        clearance = part["driven_min_clearance_devices_m"]
        name = f"`{method}`, {'10 m/s' if speed == '10' else 'posted speed'}"
        below = (clearance < 0.5).sum()
        assert f"| {name} | 80 | 80 | {clearance.min():.2f} | {clearance.median():.2f} | {below} |" in page


@pytest.mark.parametrize("page", ["README.md", "docs/results/paper_case.md"])
def test_figures_of_the_papers_case_are_those_of_its_csv(page: str) -> None:
    rows = pd.read_csv(ROOT / "docs" / "results" / "paper_case_seeds.csv")
    text = (ROOT / page).read_text(encoding="utf-8")
    assert sorted(rows["seed"].unique()) == list(range(121, 131))
    swept, lanes = (rows[rows["method"] == method] for method in ("swept", "lanes"))
    for name, column in (("precision", "precision"), ("recall", "recall"), ("IoU", "iou")):
        told = [re.escape(f"{part[column].mean():.3f}") for part in (swept, lanes)]
        assert re.search(rf"^\| {name} \| {told[0]} \[[^]]*\] \| {told[1]} \[[^]]*\] \|$", text, flags=re.MULTILINE)
    clearances = [part["min_clearance_devices_m"] for part in (swept, lanes)]
    worst = [f"{clearance.min():.2f} m ({clearance.mean():.2f} m)" for clearance in clearances]
    assert f"worst seed (mean) | {worst[0]} | {worst[1]} |" in text
    assert (rows["outcome"] == "REACHED_GOAL").all()


def test_figures_of_roads_and_exports_are_those_of_their_csv() -> None:
    results = ROOT / "docs" / "results"
    roads, page = pd.read_csv(results / "roads.csv"), (results / "roads.md").read_text(encoding="utf-8")
    made = roads[roads["refused"].isna()]
    near = int((made["line_max_m"] < 0.15).sum())
    assert f"{len(made)} of {len(roads)} stretches became a road, {near} with the reference line within 0.15 m" in page
    exports, page = pd.read_csv(results / "exports.csv"), (results / "exports.md").read_text(encoding="utf-8")
    for row in exports.itertuples():
        read = "yes" if row.netconvert_reads else "no"
        cells = [
            f"`{row.zone}`",
            row.lanelets,
            row.lanes_at_start,
            row.with_a_way_through,
            read,
            row.qc_errors,
            row.qc_warnings,
        ]
        assert f"| {' | '.join(map(str, cells))} |" in page
