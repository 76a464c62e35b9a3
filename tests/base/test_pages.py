import re
from pathlib import Path

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
