"""What all pages share: the template engine, their style, the scripts that a page may run, and figures embedded in the page.

Nothing that a file or a folder says is ever part of a script. Data reaches a script as an attribute or as a block of JSON. The
page's Content-Security-Policy lets the browser run the scripts of the package alone, by their hashes, and load nothing.
"""

import base64
import hashlib
import json
from collections.abc import Iterable
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from wzsumo.figures.figure_files import ReportFigure


def page_template(name: str) -> Template:
    """The template of a page. Values are escaped, and a value that is missing raises an error."""
    environment = Environment(
        loader=PackageLoader("wzsumo.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"script": script, "style": style, "policy": policy}
    return environment.get_template(name)


def script(name: str) -> Markup:
    """The content of a script of the package, to stand in a page as it is."""
    return Markup(_own(name))  # noqa: S704 - ours, of no input


def style(name: str) -> Markup:
    """The content of a style sheet of the package, to stand in a page as it is."""
    return Markup(_own(name))  # noqa: S704 - ours, of no input


def _own(name: str) -> str:
    return files("wzsumo.report").joinpath("templates", name).read_text(encoding="utf-8")


def policy(*scripts: str) -> str:
    """The Content-Security-Policy of a page that runs these scripts of this folder."""
    hashes = [base64.b64encode(hashlib.sha256(script(name).encode()).digest()).decode("ascii") for name in scripts]
    runs = " ".join(f"'sha256-{each}'" for each in hashes) or "'none'"
    return (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {runs}; base-uri 'none'; form-action 'none'"
    )


def json_block(data: Any) -> Markup:
    """The data as JSON that may stand in a script element: no text in it can end the element."""
    text = json.dumps(data, separators=(",", ":"))
    return Markup(text.replace("<", r"\u003c").replace(">", r"\u003e").replace("&", r"\u0026"))  # noqa: S704 - escaped here


def embedded(figures: Iterable[ReportFigure]) -> list[dict[str, str]]:
    """Stem, title, caption, section and images (PNG in base64) of each figure, for the templates."""
    return [
        {
            "stem": each.path.stem, "title": each.title, "caption": each.caption, "section": each.section,
            "png": base64.b64encode(each.path.read_bytes()).decode("ascii"),
            "narrow": base64.b64encode(each.narrow).decode("ascii") if each.narrow else "",
        }
        for each in figures
    ]  # fmt: skip
