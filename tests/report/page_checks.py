"""Accessibility of a page: checks of its HTML for screen readers, contrast and narrow screens, without a browser."""

import re
from collections import Counter
from html.parser import HTMLParser

VOID = {"meta", "img", "br", "wbr", "input", "link", "path", "rect", "circle", "polygon", "polyline", "line"}
NAMED_BY_TEXT = {"a", "button", "h1", "h2", "h3", "th", "option", "title", "li", "caption", "figcaption"}


class PageChecks(HTMLParser):
    """Collects what is wrong with a page in `mistakes`."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.mistakes: list[str] = []
        self._levels: list[int] = []
        self._ids: Counter[str] = Counter()
        self._targets: set[str] = set()
        self._open: list[tuple[str, dict[str, str | None], list[str]]] = []
        self._seen: set[str] = set()
        self.feed(page)
        self._finish()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        self._seen.add(tag)
        self._check(tag, attributes)
        if tag not in VOID:
            self._open.append((tag, attributes, []))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._check(tag, dict(attrs))

    def handle_data(self, data: str) -> None:
        for _, _, texts in self._open:
            texts.append(data.strip())

    def handle_endtag(self, tag: str) -> None:
        while self._open:
            name, attributes, texts = self._open.pop()
            if name in NAMED_BY_TEXT and not "".join(texts) and not attributes.get("aria-label"):
                self.mistakes.append(f"<{name} {attributes}> says nothing")
            if name == tag:
                return
        self.mistakes.append(f"</{tag}> closes nothing")

    def _check(self, tag: str, attributes: dict[str, str | None]) -> None:
        if attributes.get("id"):
            self._ids[str(attributes["id"])] += 1
        if re.fullmatch(r"h[1-6]", tag):
            self._levels.append(int(tag[1]))
        wrong = {
            "no lang": tag == "html" and not attributes.get("lang"),
            "no alt": tag == "img" and not attributes.get("alt"),
            "no scope": tag == "th" and attributes.get("scope") not in {"col", "row", "colgroup", "rowgroup"},
            "no name": tag in {"svg", "canvas"}
            and attributes.get("aria-hidden") != "true"
            and not attributes.get("aria-label"),
            "scrolls without a name or the keyboard": attributes.get("class") in {"wide", "tall"}
            and not (attributes.get("tabindex") == "0" and attributes.get("role") == "region" and attributes.get("aria-label")),
            "no label": tag in {"input", "select"}
            and not attributes.get("aria-label")
            and not any(name == "label" for name, _, _ in self._open),
        }
        self.mistakes += [f"<{tag} {attributes}>: {what}" for what, is_wrong in wrong.items() if is_wrong]
        if tag == "a" and (attributes.get("href") or "").startswith("#"):
            self._targets.add(str(attributes["href"])[1:])

    def _finish(self) -> None:
        if self._levels.count(1) != 1:
            self.mistakes.append(f"{self._levels.count(1)} headings of level 1")
        steps = zip(self._levels, self._levels[1:], strict=False)
        self.mistakes += [f"a heading of level {b} follows one of level {a}" for a, b in steps if b > a + 1]
        self.mistakes += [f"id {name} stands {n} times" for name, n in self._ids.items() if n > 1]
        self.mistakes += [f"#{name} is nowhere" for name in self._targets - self._ids.keys()]
        self.mistakes += [f"no <{tag}>" for tag in ("main", "title", "html") if tag not in self._seen]


def colours_of(css: str) -> dict[str, dict[str, str]]:
    """The colours of a style sheet by scheme ("light", "dark") and name, of its variables."""
    light, dark = re.findall(r":root \{(.*?)\}", css, flags=re.S)[:2]
    named = [dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6})", part)) for part in (light, dark)]
    return {"light": named[0], "dark": named[1]}


def contrast(one: str, other: str) -> float:
    """Contrast ratio of two colours; WCAG 2.2, "contrast ratio" and "relative luminance"."""
    high, low = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: str) -> float:
    digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
    channels = [int(digits[at : at + 2], 16) / 255 for at in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
