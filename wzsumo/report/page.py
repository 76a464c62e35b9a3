"""What the reports of a run and of a study share: their template engine, and figures embedded in the page."""

import base64
from collections.abc import Iterable

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from wzsumo.figures.figure_files import ReportFigure


def page_template(name: str) -> Template:
    """A page's template of this package. An undefined value in it is an error; the values filled in are escaped."""
    environment = Environment(
        loader=PackageLoader("wzsumo.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)


def embedded(figures: Iterable[ReportFigure]) -> list[dict[str, str]]:
    """Title, caption and image (PNG in base64) of each figure, as the templates take them."""
    return [
        {"title": each.title, "caption": each.caption, "png": base64.b64encode(each.path.read_bytes()).decode("ascii")}
        for each in figures
    ]
