"""Build the documentation as a site: guide, gallery, notebook, method, results, reference, project.

    python .ci/site/build_site.py [--out build/site] [--run-notebook]

The pages are those of the project; reference and gallery are made from the code. A warning of the builder ends it with 1.
Nothing is loaded from the network, here or in the browser. --run-notebook: the notebook with its outputs.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import nbformat
import tomli_w
from site_gallery import studies_page, zones_page
from site_notebook import NOTEBOOK, executed, notebook_page
from site_pages import ROOT, copy_pages
from site_reference import api_page, commands_page

CITING = """\
# How to cite

```bibtex
{bibtex}
```

The same for programs: [CITATION.cff](../files/CITATION.cff).
"""
SECTIONS = {
    "Guide": "guide", "Gallery": "gallery", "Notebook": "notebooks", "Method": "method", "Results": "results",
    "Reference": "reference", "Project": "project",
}  # fmt: skip


def main() -> int:
    """0, or the exit code of the builder where it warned."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "site")
    parser.add_argument("--run-notebook", action="store_true")
    args = parser.parse_args()
    notebook = executed() if args.run_notebook else nbformat.read(NOTEBOOK, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        write_sources(work / "docs", notebook=notebook)
        (work / "zensical.toml").write_text(tomli_w.dumps(config(work / "docs")), encoding="utf-8")
        done = subprocess.run([sys.executable, "-m", "zensical", "build", "--strict", "--clean"], cwd=work, check=False)
        if done.returncode:
            return done.returncode
        for page in (work / "site").rglob("*.html"):
            page.write_text(for_everybody(page.read_text(encoding="utf-8")), encoding="utf-8")
        shutil.rmtree(args.out, ignore_errors=True)
        shutil.copytree(work / "site", args.out)
    sys.stdout.write(f"{args.out}/index.html\n")
    return 0


def for_everybody(page: str) -> str:
    """The page without links that have no name, and with the keyboard for what scrolls."""
    page = re.sub(r'<a id="__codelineno[^>]*></a>', "", page)
    page = re.sub(r"(<pre[^>]*>(?:<span></span>)?<code)(?=[ >])", r'\1 tabindex="0"', page)
    return page.replace("<table>", '<table tabindex="0">').replace(
        '<div class="equation"', '<div tabindex="0" class="equation"'
    )


def write_sources(site: Path, *, notebook: nbformat.NotebookNode) -> None:
    """Write the Markdown pages of the site, and what they show, into a folder."""
    copy_pages(site)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    bibtex = re.search(r"^    @software\{.*?^    \}", readme, flags=re.MULTILINE | re.DOTALL)
    if bibtex is None:
        raise ValueError("README.md: no @software entry to cite")
    made = {
        "gallery/zones.md": zones_page(site),
        "gallery/studies.md": studies_page(),
        "notebooks/paper_case.md": notebook_page(notebook, site),
        "reference/python.md": api_page(),
        "reference/commands.md": commands_page(),
        "project/citing.md": CITING.format(bibtex=re.sub(r"^    ", "", bibtex.group(), flags=re.MULTILINE)),
    }
    for name, text in made.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_text(text, encoding="utf-8")
    for name in ("CITATION.cff", "LICENSE"):
        shutil.copyfile(ROOT / name, site / "files" / name)
    shutil.copyfile(Path(__file__).with_name("site.css"), site / "site.css")


def config(site: Path) -> dict[str, object]:
    """What the builder is told. Pages of a section stand in the order in which its first page names them."""
    nav: list[dict[str, object]] = [{"Home": "index.md"}]
    nav += [{title: _pages_of(site, folder)} for title, folder in SECTIONS.items()]
    colours = [
        {"media": f"(prefers-color-scheme: {name})", "scheme": scheme, "primary": "indigo", "accent": "indigo"}
        | {"toggle": {"icon": icon, "name": f"to {other}"}}
        for name, scheme, icon, other in (
            ("light", "default", "lucide/sun", "dark mode"), ("dark", "slate", "lucide/moon", "light mode"),
        )
    ]  # fmt: skip
    features = ["navigation.tabs", "navigation.top", "navigation.footer", "content.code.copy", "search.highlight", "toc.follow"]
    return {
        "project": {
            "site_name": "wzsumo",
            "site_description": "Learning to drive through work zones from crowdsourced traces, in SUMO",
            "docs_dir": "docs", "site_dir": "site", "use_directory_urls": False, "extra_css": ["site.css"],
            "nav": nav,
            "theme": {"font": False, "features": features, "palette": colours},
            "extra": {"generator": False},
        }
    }  # fmt: skip


def _pages_of(site: Path, folder: str) -> list[str]:
    start = site / folder / "index.md"
    named = re.findall(r"\]\(([\w.]+\.md)", start.read_text(encoding="utf-8")) if start.exists() else []
    there = sorted(path.name for path in (site / folder).glob("*.md"))
    order = dict.fromkeys(["index.md", *named, *there])
    return [f"{folder}/{name}" for name in order if name in there]


if __name__ == "__main__":
    sys.exit(main())
