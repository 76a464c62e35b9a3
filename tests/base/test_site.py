"""The documentation builds without a warning, whole, and needs no network."""

import re
import subprocess
import sys
from pathlib import Path

import site_math
import site_pages
from report.test_accessibility import axe
from report.test_pages_in_a_browser import CHROMIUM

import wzsumo
from wzsumo import cli

ROOT = Path(__file__).parents[2]
LOADED = re.compile(r'<(?:img|script|link|source|iframe)\b[^>]*?\b(?:src|href)="([^"]+)"')
LINKED = re.compile(r'<a\b[^>]*?\bhref="([^"]+)"')


def test_documentation_builds_without_a_warning_whole_and_for_use_without_a_network(tmp_path: Path) -> None:
    """One test, for one build."""
    site = tmp_path / "site"
    command = [sys.executable, str(ROOT / ".ci" / "site" / "build_site.py"), "--out", str(site)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    assert "No issues found" in built.stdout + built.stderr
    check_links(site)
    check_reference_and_gallery(site)
    check_equations(site)
    if CHROMIUM:
        for name, width, dark in (
            ("index.html", 1280, False),
            ("guide/keys.html", 390, True),
            ("method/lanes.html", 1280, False),
        ):
            page = site / name
            assert axe(page.read_text(encoding="utf-8"), page.parent, width=width, dark=dark) == [], name


def check_links(site: Path) -> None:
    """Nothing that a page shows or links to is absent, or loaded from elsewhere."""
    pages = [page for page in site.rglob("*.html") if page.name != "404.html"]
    assert len(pages) > 45
    ids = {page: set(re.findall(r'\bid="([^"]+)"', page.read_text(encoding="utf-8"))) for page in pages}
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for target in LOADED.findall(text) + LINKED.findall(text):
            name, _, anchor = target.partition("#")
            if re.match(r"[a-z]+:", target):
                assert target not in LOADED.findall(text) or target.startswith("data:"), f"{page.name}: {target}"
                continue
            file = (page.parent / name).resolve() if name else page
            assert file.exists(), f"{page.name}: {target}"
            assert not anchor or anchor == "__comments" or file not in ids or anchor in ids[file], f"{page.name}: {target}"
        assert "unpkg.com" not in text
        assert 'class="mermaid"' not in text


def check_reference_and_gallery(site: Path) -> None:
    python, commands, zones, studies = (
        (site / name).read_text(encoding="utf-8")
        for name in ("reference/python.html", "reference/commands.html", "gallery/zones.html", "gallery/studies.html")
    )
    assert [name for name in wzsumo.__all__ if f'id="{name.lower()}"' not in python] == []
    assert [name for name in cli.COMMANDS if f'id="{name}"' not in commands] == []
    library = sorted(path.stem for path in (ROOT / "scenarios").glob("*.toml"))
    assert len(library) > 15
    assert [name for name in library if f'src="zones/{name}.png"' not in zones] == []
    assert [path.stem for path in (ROOT / "scenarios" / "studies").glob("*.toml") if f'id="{path.stem}"' not in studies] == []


def check_equations(site: Path) -> None:
    """They are MathML, and no page shows their source."""
    text = (site / "method" / "lanes.html").read_text(encoding="utf-8")
    assert text.count("<math ") > 40
    for page in (site / "method").glob("*.html"):
        shown = re.sub(r"<(code|annotation)\b.*?</\1>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert "$" not in re.sub(r"<script.*?</script>", "", shown, flags=re.DOTALL), page.name


def test_equation_holds_nothing_that_markdown_would_take_for_its_own() -> None:
    made = site_math.with_mathml(r"so $a_i * b_i | c$ and 5 $ a day")
    assert made.startswith('so <span class="equation"><math')
    assert made.endswith("</span> and 5 $ a day")
    assert not set("*_|`") & set(made.removeprefix("so ").removesuffix(" and 5 $ a day"))


def test_links_lead_to_the_places_of_the_site(tmp_path: Path) -> None:
    readme = site_pages.site_page(ROOT / "README.md", tmp_path)
    assert "](guide/index.md)" in readme
    assert "](project/architecture.md)" in readme
    assert "](files/CITATION.cff)" in readme
    assert (tmp_path / "files" / "CITATION.cff").read_text() == (ROOT / "CITATION.cff").read_text()
    assert "<!--" not in readme


def test_list_and_table_get_the_empty_line_that_the_site_needs() -> None:
    assert site_pages._spaced("so:\n- one\n- two\n") == "so:\n\n- one\n- two\n"
    assert site_pages._spaced("so:\n| a |\n|---|\n") == "so:\n\n| a |\n|---|\n"
    assert site_pages._spaced("- one\n  more\n- two\n") == "- one\n  more\n- two\n"
