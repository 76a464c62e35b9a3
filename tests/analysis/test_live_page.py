"""The page of the live map's results holds the tables that lie beside it."""

import runpy
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_page_of_the_live_map_is_that_of_its_tables() -> None:
    page = runpy.run_path(str(ROOT / "analysis" / "live" / "tables.py"))["page"]()
    assert (ROOT / "docs" / "results" / "live.md").read_text(encoding="utf-8") == page
