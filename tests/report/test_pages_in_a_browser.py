"""Pages in a real browser, with names that try to run scripts everywhere."""

import base64
import hashlib
import html
import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from sweep_trials import FLEET, a_study, sweep

from wzsumo.report.page import json_block, page_template, policy, script, style
from wzsumo.report.sweep_report import write_sweep_report
from wzsumo.sweep import task_queue as engine
from wzsumo.sweep.evaluation.study_case import StudyCase

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
OWN = "document.documentElement.dataset.owned=1"
HOSTILE = f"`${{{OWN}}}'\"${{{OWN}}}<img src=x onerror={OWN}>&$(touch owned)"
REASON = f"</script><script>{OWN}</script><img src=x onerror={OWN}>{HOSTILE}\u2028\x1b"
CLICK = """document.querySelector("button.case").click();
document.title = document.querySelector("#rerun code").textContent;"""


def evaluate_cases(_fleet: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
    done = {"status": "DONE", "iou": 0.5, "precision": 0.9, "recall": 0.8, "safe_plan": True, "minutes_to_collect": 1.0}
    done |= {"planned_min_clearance_devices_m": 0.5}
    refused = {"status": "REFUSED", "reason": REASON}
    return [{"case": case.id} | (done if case.scenario.crowd.used > 1 else refused) for case in cases]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study in a folder whose name holds markup, the end of a script, a template literal and a command of a shell."""
    out = tmp_path_factory.mktemp("study") / f"a{HOSTILE}<" / f"script>{HOSTILE}"
    out.mkdir(parents=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "simulate", lambda _scenario: FLEET)
        patch.setattr(engine, "evaluate_cases", evaluate_cases)
        sweep(a_study(seed=[1, 2], crowd__used=[1, 2]), out)
    (out / "cases" / HOSTILE).mkdir(parents=True)
    (out / "cases" / HOSTILE / "report.html").write_text("a case")
    write_sweep_report(out)
    return out


def opened(page: str, folder: Path, *, options: Sequence[str] = ()) -> str:
    """The document that the browser has made of a page, after its scripts have run."""
    (folder / "page.html").write_text(page, encoding="utf-8")
    quiet = (
        "--headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking --disable-component-update "
        "--disable-sync --disable-dev-shm-usage --virtual-time-budget=2000 --dump-dom"
    )
    profile = f"--user-data-dir={folder / 'profile'}"
    command = [str(CHROMIUM), *quiet.split(), *options, profile, (folder / "page.html").as_uri()]
    return subprocess.run(command, capture_output=True, check=True, text=True, errors="replace").stdout


def with_script(page: str, content: str, *, allowed: bool) -> str:
    """The page with one more script, which its policy allows or not."""
    if allowed:
        value = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        page = page.replace("script-src ", f"script-src &#39;sha256-{value}&#39; ")
    return page.replace("</body>", f"<script>{content}</script></body>")


@needs_browser
def test_hostile_names_in_a_study_run_nothing_and_the_command_is_safe_to_copy(folder: Path, tmp_path: Path) -> None:
    """Without the policy, too: escaping alone must hold."""
    page = (folder / "report.html").read_text(encoding="utf-8")
    without_policy = re.sub(r"<meta http-equiv[^>]*>", "", page)
    assert without_policy != page
    shown = opened(with_script(without_policy, CLICK, allowed=False), tmp_path)
    title = html.unescape(re.findall(r"<title>(.*?)</title>", shown, flags=re.S)[0])
    assert "data-owned" not in shown
    words = shlex.split(title)
    case = words[4]
    assert re.fullmatch("[0-9a-f]{16}", case)
    assert words == ["wzsumo", "run", str(folder), "--case", case, "--out", str(folder / "cases" / case)]


@needs_browser
def test_tables_of_a_study_are_searched_sorted_and_turned_over(folder: Path, tmp_path: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    ask = """
    const section = [...document.querySelectorAll("section.data")].at(-1), find = name => section.querySelector(`.${name}`);
    const seeds = () => [...section.querySelectorAll("tbody tr")].map(row => row.cells[2].textContent).join("");
    const seen = () => document.title += " | " + find("count").textContent + ": " + seeds();
    const type = words => { find("search").value = words; find("search").dispatchEvent(new Event("input")); seen(); };
    document.title = "t"; seen(); type("done"); type("nothing at all"); type("");
    const seed = [...section.querySelectorAll("button.sort")][2];
    seed.click(); seen(); seed.click(); seen();
    find("rows").insertAdjacentHTML("beforeend", "<option selected>3</option>");
    find("rows").dispatchEvent(new Event("change"));
    seen(); find("later").click(); seen(); document.title += find("later").disabled;"""
    shown = opened(with_script(page, ask, allowed=True), tmp_path)
    (title,) = re.findall(r"<title>(.*?)</title>", shown, flags=re.S)
    # Two seeds with one and two traces; those with one trace are refused.
    assert title.split(" | ")[1:] == [
        "1 to 4 of 4 rows: 1122", "1 to 2 of 2 rows: 12", "no row:", "1 to 4 of 4 rows: 1122", "1 to 4 of 4 rows: 1122",
        "1 to 4 of 4 rows: 2211", "1 to 3 of 4 rows: 221", "4 to 4 of 4 rows: 1true",
    ]  # fmt: skip


@needs_browser
def test_policy_of_a_study_lets_its_own_script_alone_run(folder: Path, tmp_path: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    shown = opened(with_script(with_script(page, CLICK, allowed=True), OWN, allowed=False), tmp_path)
    assert "<title>wzsumo run" in shown  # the page's script answered the click
    assert "data-owned" not in shown


@needs_browser
def test_policy_of_a_played_drive_lets_its_own_script_alone_run(tmp_path: Path) -> None:
    shown = opened(with_script(player_page(), OWN, allowed=False), tmp_path)
    assert 'max="3"' in shown  # the player has set the length of its slider
    assert "data-owned" not in shown


@needs_browser
def test_player_starts_at_the_zone_and_obeys_the_keys(tmp_path: Path) -> None:
    press = "document.getElementById('player').dispatchEvent(new KeyboardEvent('keydown', {key: '%s'}));"
    told = "document.title += ' | ' + document.getElementById('now').textContent;"
    keys = "".join(press % key + told for key in ("ArrowLeft", "ArrowRight", "Home", "End"))
    title = re.findall(r"<title>(.*?)</title>", opened(with_script(player_page(), told + keys, allowed=True), tmp_path))[0]
    # Frames of 1 s, the zone begins with frame 2; the ego is held back from 2.5 s on.
    at_zone = "2.0 s, 7.0 m/s"
    at_end = "3.0 s, 7.0 m/s, held back by a bend of its path"
    assert title.split(" | ")[1:] == [at_zone, "1.0 s, 6.0 m/s", at_zone, at_zone, at_end]


def player_page() -> str:
    ego = [[0, 0, 0, 5, 0], [1, 0, 0, 6, 0], [2, 0, 0, 7, 1], [3, 0, 0, 8, 0]]
    drive: dict[str, Any] = {
        "frame_s": 1.0,
        "zone_frame": 2,
        "size": [5, 2],
        "ego": ego,
        "others": [[[9, 3, 0, 1, 5, 2, 1]], *[[]] * 3],
    }
    drive |= {"devices": [[5, 5, 0.2]], "areas": {name: [] for name in ("pavement", "drivable", "closed_area")}}
    drive |= {"slowed": [[2.5, 4.0, "a bend of its path"]], "lines": [{"kind": "lane", "points": [[0, 2], [9, 2]]}]}
    part = page_template("drive_player.html.j2").render(best="b", player=json_block(drive))
    head = f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{policy("drive_player.js")}">'
    body = f"<main><h1>t</h1><h2>t</h2>{part}</main>"
    looks = f"<style>{style('page.css')}</style>"
    return f'<!DOCTYPE html><html lang="en"><head>{head}<title>t</title>{looks}</head><body>{body}</body></html>'


def test_script_of_a_page_is_the_packages_own_to_the_letter(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert re.findall(r"<script[^>]*>(.*?)</script>", page, flags=re.S) == [str(script("sweep.js"))]


def test_block_of_json_holds_no_end_of_a_script_and_reads_back() -> None:
    block = json_block({"name": "</script><!--<script>&"})
    assert not set("<>&") & set(block)
    assert json.loads(block) == {"name": "</script><!--<script>&"}
