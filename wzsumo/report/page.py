"""What the pages of a run and of a study share: the template engine, and figures embedded in the page."""

import base64
from collections.abc import Iterable

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from wzsumo.figures.figure_files import ReportFigure


def page_template(name: str) -> Template:
    """The template of a page. Values are escaped, and a value that is missing raises an error."""
    environment = Environment(
        loader=PackageLoader("wzsumo.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)


def embedded(figures: Iterable[ReportFigure]) -> list[dict[str, str]]:
    """Title, caption and image (PNG in base64) of each figure, for the templates."""
    return [
        {"title": each.title, "caption": each.caption, "png": base64.b64encode(each.path.read_bytes()).decode("ascii")}
        for each in figures
    ]
