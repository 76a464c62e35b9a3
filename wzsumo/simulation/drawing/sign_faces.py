"""Pictures of temporary traffic control signs, of our own drawing: shape and colours by the MUTCD, words by the sign's text.

Symbol signs (lane ends, reverse curve, signal ahead, flagger) are drawn as simple symbols, not as the manual's artwork.
"""

from collections.abc import Callable
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

SIZE_PX, FINER = 192, 4  # pictures are drawn finer and scaled down, which smooths their edges
ORANGE, WHITE, BLACK, AMBER, GREY = "#ff8200", "#ffffff", "#000000", "#ffb000", "#444444"  # close to the FHWA's colours
BORDER = 0.03  # widths of border and strokes, as shares of the picture
STROKE = 0.07
WORDS_REACH = 0.72  # width and height of the words on a diamond together, so that their corners stay within its border
FACES_OF_RECTANGLES = {"G20-2": ORANGE, "R4-9": WHITE}  # MUTCD 11th ed., Chapters 6G and 6H: all others here are diamonds

Pencil = ImageDraw.ImageDraw
Point = tuple[float, float]


def write_sign_face(code: str, text: str, path: Path) -> None:
    """Write the picture of a sign as PNG, its ground transparent."""
    picture, pencil = _blank()
    if code in FACES_OF_RECTANGLES:
        _rectangle(pencil, FACES_OF_RECTANGLES[code])
        _words(pencil, text, fits=lambda width, height: max(width / 0.84, height / 0.44))
    else:
        _diamond(pencil)
        symbol = next((draw for start, draw in SYMBOLS.items() if code.startswith(start)), None)
        if symbol:
            symbol(pencil, code.endswith("R"))
        else:
            _words(pencil, text, fits=lambda width, height: (width + height) / WORDS_REACH)
    _save(picture, path)


def write_arrow_board(path: Path, *, to_the_left: bool) -> None:
    """Write the picture of an arrow board that sends traffic to one side."""
    picture, pencil = _blank()
    pencil.rounded_rectangle(_scaled((0.02, 0.26), (0.98, 0.74)), radius=0.03 * SIZE_PX * FINER, fill=BLACK, outline=GREY)
    lamps = [(x, 0.5) for x in (0.3, 0.42, 0.54, 0.66, 0.78)]
    lamps += [(0.3 - 0.12 + 0.12 * n, 0.5 + side * (0.07 + 0.06 * (n - 1))) for n in (1, 2) for side in (-1, 1)]
    for along, y in [*lamps, (0.18, 0.5)]:
        x = along if to_the_left else 1 - along
        pencil.ellipse(_scaled((x - 0.035, y - 0.035), (x + 0.035, y + 0.035)), fill=AMBER)
    _save(picture, path)


def write_device(path: Path, *, is_cone: bool) -> None:
    """Write the picture of a cone, or of a drum, as seen from the road."""
    picture, pencil = _blank()
    top, foot = (0.06, 0.34) if is_cone else (0.3, 0.36)
    for number in range(5):
        low, high = 0.1 + 0.16 * number, 0.1 + 0.16 * (number + 1)
        left, right = (top + (foot - top) * (at - 0.1) / 0.8 for at in (low, high))
        corners = [(0.5 - left, low), (0.5 + left, low), (0.5 + right, high), (0.5 - right, high)]
        pencil.polygon([_point(corner) for corner in corners], fill=WHITE if number % 2 else ORANGE)
    pencil.rectangle(_scaled((0.5 - foot - 0.08, 0.88), (0.5 + foot + 0.08, 0.96)), fill=BLACK)
    _save(picture, path)


def _lane_ends(pencil: Pencil, right: bool) -> None:
    _line(pencil, [(0.38, 0.72), (0.38, 0.28)], mirrored=not right)
    _line(pencil, [(0.64, 0.72), (0.64, 0.58), (0.54, 0.42), (0.54, 0.28)], mirrored=not right)


def _reverse_curve(pencil: Pencil, right: bool) -> None:
    _line(pencil, [(0.42, 0.76), (0.42, 0.6), (0.58, 0.46), (0.58, 0.34)], mirrored=not right)
    _arrow_head(pencil, (0.58 if right else 0.42, 0.22))


def _signal_ahead(pencil: Pencil, _right: bool) -> None:
    pencil.rounded_rectangle(_scaled((0.38, 0.22), (0.62, 0.78)), radius=0.04 * SIZE_PX * FINER, fill=BLACK)
    for y, colour in ((0.32, "#d00000"), (0.5, "#ffd000"), (0.68, "#00a000")):
        pencil.ellipse(_scaled((0.43, y - 0.07), (0.57, y + 0.07)), fill=colour)


def _flagger(pencil: Pencil, _right: bool) -> None:
    pencil.ellipse(_scaled((0.44, 0.2), (0.56, 0.32)), fill=BLACK)
    _line(pencil, [(0.5, 0.34), (0.5, 0.6), (0.42, 0.78)])
    _line(pencil, [(0.5, 0.6), (0.58, 0.78)])
    _line(pencil, [(0.5, 0.4), (0.66, 0.5), (0.66, 0.3)])
    pencil.polygon([_point(corner) for corner in ((0.66, 0.26), (0.8, 0.32), (0.66, 0.4))], fill=BLACK)


SYMBOLS: dict[str, Callable[[Pencil, bool], None]] = {
    "W4-2": _lane_ends, "W1-4": _reverse_curve, "W3-3": _signal_ahead, "W20-7": _flagger,
}  # fmt: skip


def _blank() -> tuple[Image.Image, Pencil]:
    picture = Image.new("RGBA", (SIZE_PX * FINER, SIZE_PX * FINER), (0, 0, 0, 0))
    return picture, ImageDraw.Draw(picture)


def _save(picture: Image.Image, path: Path) -> None:
    picture.resize((SIZE_PX, SIZE_PX), Image.Resampling.LANCZOS).save(path, format="PNG")


def _diamond(pencil: Pencil) -> None:
    for reach, colour in ((0.5, BLACK), (0.5 - BORDER, ORANGE), (0.5 - 2 * BORDER, BLACK), (0.5 - 3 * BORDER, ORANGE)):
        corners = [(0.5, 0.5 - reach), (0.5 + reach, 0.5), (0.5, 0.5 + reach), (0.5 - reach, 0.5)]
        pencil.polygon([_point(corner) for corner in corners], fill=colour)


def _rectangle(pencil: Pencil, colour: str) -> None:
    pencil.rectangle(_scaled((0.02, 0.2), (0.98, 0.8)), fill=BLACK)
    pencil.rectangle(_scaled((0.02 + BORDER, 0.2 + BORDER), (0.98 - BORDER, 0.8 - BORDER)), fill=colour)


def _words(pencil: Pencil, text: str, *, fits: Callable[[float, float], float]) -> None:
    """The words in the middle, on the lines that let them be largest; `fits` is 1 for a width and height that just fit."""
    words = text.split()
    best: tuple[float, str] = (0.0, text)
    for n_lines in range(1, min(len(words), 4) + 1):
        lines = _lines(words, n_lines)
        left, top, right, low = pencil.multiline_textbbox((0, 0), lines, font=ImageFont.load_default(100), spacing=20)
        size = 100 * SIZE_PX * FINER / fits(right - left, low - top)
        best = max(best, (size, lines))
    size, lines = best
    font, middle = ImageFont.load_default(size), _point((0.5, 0.5))
    pencil.multiline_text(
        middle, lines, font=font, fill=BLACK, anchor="mm", align="center", spacing=0.2 * size, stroke_width=FINER
    )


def _lines(words: list[str], n_lines: int) -> str:
    """The words on so many lines of about the same length."""
    lines: list[str] = []
    letters, line = sum(map(len, words)) / n_lines, ""
    for word in words:
        if line and len(lines) < n_lines - 1 and len(line) + len(word) / 2 > letters:
            lines.append(line)
            line = ""
        line = f"{line} {word}".strip()
    return "\n".join([*lines, line])


def _line(pencil: Pencil, points: list[Point], *, mirrored: bool = False) -> None:
    placed = [_point((1 - x if mirrored else x, y)) for x, y in points]
    pencil.line(placed, fill=BLACK, width=round(STROKE * SIZE_PX * FINER), joint="curve")


def _arrow_head(pencil: Pencil, tip: Point) -> None:
    x, y = tip
    pencil.polygon([_point(corner) for corner in ((x, y), (x - 0.1, y + 0.15), (x + 0.1, y + 0.15))], fill=BLACK)


def _point(place: Point) -> Point:
    return place[0] * SIZE_PX * FINER, place[1] * SIZE_PX * FINER


def _scaled(corner: Point, opposite: Point) -> tuple[float, float, float, float]:
    return (*_point(corner), *_point(opposite))
