"""Equations as MathML, which browsers draw without a script."""

import re

from latex2mathml.converter import convert

DISPLAYED = re.compile(r"\$\$(.+?)\$\$", flags=re.DOTALL)
INLINE = re.compile(r"(?<![\\$\w])\$(?!\s)([^$\n]+?)(?<!\s)\$(?![\w$])")
# What Markdown would take for emphasis, a column of a table or code.
ENTITIES = str.maketrans({"*": "&#42;", "_": "&#95;", "|": "&#124;", "`": "&#96;", "\n": " "})


def with_mathml(text: str) -> str:
    """Markdown in which $...$ and $$...$$ are MathML."""
    text = DISPLAYED.sub(lambda found: f'\n<div class="equation">{_mathml(found.group(1), display="block")}</div>\n', text)
    return INLINE.sub(lambda found: f'<span class="equation">{_mathml(found.group(1), display="inline")}</span>', text)


def _mathml(latex: str, *, display: str) -> str:
    return convert(" ".join(latex.split()), display=display).translate(ENTITIES)
