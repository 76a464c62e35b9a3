"""What the report of a run and that of a study share: their template engine, and figures with captions as files."""

from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

if TYPE_CHECKING:
    pass  # slow to load, and not every report is written with figures


def page_template(name: str) -> Template:
    """A page's template of this package; an undefined value in it is an error, what is filled in is escaped."""
    environment = Environment(
        loader=PackageLoader("wzsumo.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)
