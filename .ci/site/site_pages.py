"""The pages of the project as pages of the site: links, equations and lists as the site's Markdown wants them."""

import hashlib
import os
import re
import shutil
from pathlib import Path

from site_math import with_mathml

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
MOVED = {
    "README.md": "index.md", "CONTRIBUTING.md": "project/contributing.md", "CHANGELOG.md": "project/changelog.md",
    "docs/architecture.md": "project/architecture.md",
}  # fmt: skip
LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s]+)(\))")
BLOCK_OF_CODE = re.compile(
    r"(^```.*?^```|(?:(?<=\n\n)|\A)(?: {4}[^\n]*\n)(?:(?: {4}[^\n]*)?\n)*)", flags=re.MULTILINE | re.DOTALL
)
CODE = re.compile(r"(`[^`]+`)")
DIAGRAM = re.compile(r"^```mermaid\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
WIDE_PX = 1000  # a wider diagram scrolls instead of shrinking
DIAGRAMS = Path(__file__).with_name("diagrams")


def copy_pages(site: Path) -> list[str]:
    """The names of the site's pages, after writing them and what they link to into the folder `site`."""
    sources = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]
    for source in sources:
        page = site / place_of(source)
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(site_page(source, site), encoding="utf-8")
    return [place_of(source) for source in sources]


def place_of(source: Path) -> str:
    """Where a file of the project lies on the site."""
    name = source.relative_to(ROOT).as_posix()
    if name in MOVED:
        return MOVED[name]
    if DOCS not in source.parents:
        return f"files/{name}"
    name = source.relative_to(DOCS).as_posix()
    return f"{name.removesuffix('README.md')}index.md" if name.endswith("README.md") else name


def site_page(source: Path, site: Path) -> str:
    """A page's text for the site; the files that it links to are copied there."""

    def moved(found: re.Match[str]) -> str:
        before, target, after = found.groups()
        if re.match(r"[a-z]+:|#", target):
            return found.group()
        name, hash_, anchor = target.partition("#")
        file = (source.parent / name).resolve()
        if file.is_dir():  # a site has no listings
            return before.strip("![](")
        if file.suffix != ".md":
            _copy(file, site)
        return f"{before}{os.path.relpath(place_of(file), Path(place_of(source)).parent)}{hash_}{anchor}{after}"

    text = re.sub(r"^<!-- [^\n]*? -->\n|<!-- .*? -->", "", source.read_text(encoding="utf-8"), flags=re.MULTILINE)
    text = DIAGRAM.sub(lambda found: _diagram(found.group(1), Path(place_of(source)), site), text)
    parts = BLOCK_OF_CODE.split(text)  # code stands at the odd places
    parts[::2] = [_with_equations(_spaced(LINK.sub(moved, part))) for part in parts[::2]]
    return "".join(parts)


def _diagram(mermaid: str, page: Path, site: Path) -> str:
    """A picture of a diagram, drawn beforehand: browsers would load the drawing program from the network."""
    name = f"{hashlib.sha256(mermaid.encode()).hexdigest()[:10]}.svg"
    if not (DIAGRAMS / name).exists():
        raise ValueError(
            f"{page}: a diagram has changed; draw it: npx @mermaid-js/mermaid-cli -i DIAGRAM -b white -o {DIAGRAMS / name}"
        )
    (site / "diagrams").mkdir(exist_ok=True)
    shutil.copyfile(DIAGRAMS / name, site / "diagrams" / name)
    width = float(re.findall(r'viewBox="\S+ \S+ (\S+) ', (DIAGRAMS / name).read_text(encoding="utf-8"))[0])
    kind = "wide" if width > WIDE_PX else "narrow"
    about = "Diagram: " + ", ".join(dict.fromkeys(re.findall(r"[\[{]+\"?/?([\w ,/.()-]{4,}?)/?\"?[\]}]", mermaid)))
    return (
        f'<div class="{kind}"><img alt="{about}" src="{os.path.relpath(site / "diagrams" / name, site / page.parent)}"></div>'
    )


def _with_equations(text: str) -> str:
    parts = CODE.split(text)
    parts[::2] = [with_mathml(part) for part in parts[::2]]
    return "".join(parts)


def _copy(file: Path, site: Path) -> None:
    target = site / place_of(file)
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(file, target)


def _spaced(text: str) -> str:
    """Lists and tables with an empty line before them, which GitHub does not need."""
    return re.sub(r"^(?![-*|>#\s]|\d+\. )(.+)\n(?=(?:- |\d+\. |\|))", r"\1\n\n", text, flags=re.MULTILINE)
