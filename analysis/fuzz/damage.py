"""What good inputs are broken by: odd values, odd numbers, damage to whole files."""

import random
from pathlib import Path
from typing import Any

import tomli_w

HUGE = 10**30
VALUES: tuple[Any, ...] = (
    0, 1, -1, 2, 7, 1e-300, 1e-9, -1e-9, 0.5, 1e6, 1e9, -1e9, 1e300, 2**31 - 1, 2**31, 2**53 + 1, 2**63 - 1, 2**63,
    HUGE, float("nan"),
    float("inf"), float("-inf"), True, False, "", "3", "60 mph", "nan", "left", "right", "\x1b[2J", "\u202e\u2028",
    "x" * 20_000,
    [], [1], [0, 0], [-1], [1.0, float("nan")], ["a"], [[1]], [[0.0, 0.0], [0.0, 0.0]], [HUGE, HUGE], {}, {"a": 1},
    {"first": 1, "count": 10**7},
    {"first": 1, "count": 10**9}, {"first": -1, "count": 2}, list(range(3000)),
)  # fmt: skip
NUMBERS = (
    "0",
    "-1",
    "1e-300",
    "1e300",
    "nan",
    "inf",
    "-inf",
    "",
    "x",
    "9" * 5000,
    "1e5",
    "0x10",
    "²",
    "10",
    "0.5",
    "-0",
    "1_0",
)


def damaged(content: bytes, rng: random.Random) -> bytes:
    """The bytes cut, with bits flipped, with bytes put in, doubled, or with a byte order mark."""
    how = rng.choice(("cut", "flip", "insert", "double", "bom", "zeros", "nest", "latin", "digits"))
    at = rng.randrange(len(content) + 1)
    if how == "flip" and content:
        changed = bytearray(content)
        for _ in range(rng.choice((1, 4, 40))):
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
        return bytes(changed)
    inserted = {
        "insert": rng.randbytes(5), "zeros": b"\0" * 100, "nest": b"\na = " + b"[" * 20_000, "latin": b"\xe9\xff",
        "digits": b"\nb = " + b"9" * 6000,
    }  # fmt: skip
    if how in inserted:
        return content[:at] + inserted[how] + content[at:]
    return {"cut": content[:at], "double": content + content, "bom": b"\xef\xbb\xbf" + content}.get(how, content)


def break_key(content: Any, rng: random.Random) -> None:
    """Replace, remove, rename or add something at a random place of nested tables and lists."""
    at = content
    while True:
        keys = list(at) if isinstance(at, dict) else list(range(len(at)))
        if not keys:
            break
        key = rng.choice(keys)
        if isinstance(at[key], dict | list) and at[key] and rng.random() < 0.85:
            at = at[key]
            continue
        how = rng.random()
        if how < 0.8:
            at[key] = rng.choice(VALUES)
        elif how < 0.9:
            del at[key]
        elif isinstance(at, dict):
            at[rng.choice(("\x1b]0;x\x07", "k" * 3000, str(key).upper(), ""))] = at[key]
        break


def write_toml(content: dict[str, Any], path: Path) -> None:
    path.write_text(tomli_w.dumps(content), encoding="utf-8", errors="surrogatepass")
