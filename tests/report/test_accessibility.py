"""Pages for everybody: headings, names, tables and contrast, on wide and narrow screens, light and dark; by axe where there is
a browser, and by checks of our own everywhere."""

import html
import json
import re
from pathlib import Path
from typing import Any

import pytest
from report.page_checks import PageChecks, colours_of, contrast
from report.test_pages_in_a_browser import needs_browser, opened, player_page
from report.test_report import folder as run_folder  # noqa: F401 - a fixture
from report.test_sweep_report import folder as study_folder  # noqa: F401 - a fixture
from report.test_zone_page import ANNOUNCED, EXACT

from wzsumo.report.page import page_template, style
from wzsumo.report.report import write_report
from wzsumo.report.zone_page import zone_page

NAMES = ("run", "study", "zone", "live", "player")
ALARM = {
    "trace": 125,
    "words": "all lanes moved",
    "start": "688 ± 20",
    "end": "",
    "since": "1 s",
    "n_traces": 5,
    "once_in": "9",
}
VERSION = {"version": 1, "trace": 0, "why": "the map that it began with", "by_alarm": False}


@pytest.fixture(scope="module")
def pages(run_folder: Path, study_folder: Path) -> dict[str, str]:  # noqa: F811 - the fixtures
    figure = {"title": "Lanes", "caption": "a caption", "png": "iVBORw0KGgo=", "narrow": "iVBORw0KGgo="}
    live = page_template("live.html.j2").render(
        number=160, alarms=[ALARM], versions=[VERSION], figures=[figure], error_m=0.5, one_in=20_000
    )
    return {
        "run": write_report(run_folder).read_text(encoding="utf-8"),
        "study": (study_folder / "report.html").read_text(encoding="utf-8"),
        "zone": zone_page(EXACT, announced=ANNOUNCED, title="Work zone as driven", words=["a word"]),
        "live": live,
        "player": player_page(),
    }


@pytest.mark.parametrize("name", NAMES)
def test_page_has_names_scopes_and_headings_in_order(name: str, pages: dict[str, str]) -> None:
    assert PageChecks(pages[name]).mistakes == []


@pytest.mark.parametrize(
    ("damage", "mistake"),
    [
        ((' scope="col"', ""), "no scope"),
        ((' alt="', ' data-alt="'), "no alt"),
        (("<h2>", "<h4>"), "a heading of level 4 follows one of level"),
        ((' id="traffic"', ' id="drive"'), "#traffic is nowhere"),
        ((' tabindex="0"', ""), "scrolls without a name or the keyboard"),
        ((' lang="en"', ""), "no lang"),
    ],
)
def test_checks_notice_what_is_wrong(damage: tuple[str, str], mistake: str, pages: dict[str, str]) -> None:
    assert any(mistake in each for each in PageChecks(pages["run"].replace(*damage)).mistakes)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_colours_of_text_and_of_drawings_stand_out(scheme: str) -> None:
    colours = colours_of(style("page.css"))[scheme]
    for text in ("text", "muted", "link", "good", "bad"):
        for ground in ("ground", "raised"):
            assert contrast(colours[text], colours[ground]) >= 4.5, (text, ground)  # WCAG 2.2, 1.4.3 (AA)
    for mark, ground in (
        ("line", "drivable"), ("line", "pavement"), ("ego", "drivable"), ("device", "closed"), ("centre", "drivable"),
        ("strong-rule", "ground"), ("other", "drivable"), ("trail", "drivable"), ("brake", "drivable"),
    ):  # fmt: skip
        assert contrast(colours[mark], colours[ground]) >= 3, (mark, ground)  # ibid., 1.4.11


def test_contrast_is_that_of_the_guideline() -> None:
    assert contrast("#fff", "#000") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)  # the grey that just fails


@needs_browser
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("width", "dark"), [(1280, False), (390, True)])
def test_axe_finds_nothing(name: str, width: int, dark: bool, pages: dict[str, str], tmp_path: Path) -> None:
    assert axe(pages[name], tmp_path, width=width, dark=dark) == []


@needs_browser
def test_axe_notices_what_is_wrong(pages: dict[str, str], tmp_path: Path) -> None:
    damaged = pages["run"].replace("--muted: #545b63", "--muted: #c9c9c9").replace(' alt="', ' data-alt="')
    assert {found["id"] for found in axe(damaged, tmp_path, width=1280, dark=False)} >= {"color-contrast", "image-alt"}


def axe(page: str, folder: Path, *, width: int, dark: bool) -> list[dict[str, Any]]:
    """What axe-core finds of a page at a width of the window; each with its id and the first nodes."""
    core = pytest.importorskip("axe_core_python")
    source = (Path(core.__file__).parent / "axe.min.js").read_text(encoding="utf-8").replace("</script", r"<\/script")
    ask = """axe.run({resultTypes: ["violations"]}).then(found => { const told = document.createElement("pre"); told.id = "axe";
    told.textContent = JSON.stringify(found.violations.map(({id, nodes}) => ({id, nodes: nodes.slice(0, 3).map(n => n.html)})));
    document.body.append(told); })"""
    body, end = page.rsplit("</body>", 1)
    body = re.sub(r"<meta http-equiv[^>]*>", "", body)  # whose policy lets no script of others run
    scripts = f"<script>{source}</script><script>{ask}</script></body>"
    scheme = ["--blink-settings=preferredColorScheme=0"] if dark else []
    shown = opened(f"{body}{scripts}{end}", folder, options=[f"--window-size={width},900", *scheme])
    (told,) = re.findall(r'<pre id="axe">(.*?)</pre>', shown, flags=re.S)
    found: list[dict[str, Any]] = json.loads(html.unescape(told))
    return found
