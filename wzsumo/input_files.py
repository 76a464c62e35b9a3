"""Bytes and JSON of files that other people wrote, within bounds: a small file must not fill the memory."""

import gzip
import json
import zlib
from pathlib import Path
from typing import Any

# A file that unpacks to more than this many times its size, above the second bound, is no data: traces and networks of text
# unpack to 5 to 30 times theirs.
MAX_UNPACKED_RATIO, UNPACKED_FREELY = 200, 64 * 2**20
MAX_DIGITS = 20  # of a whole number: ids and nanoseconds since 1970 have 19
MAX_SHOWN = 60  # letters
_CHUNK = 4 * 2**20


def read_bytes(path: Path) -> bytes:
    """The content of a file, unpacked where its name ends in .gz. Raises OSError, or ValueError where it cannot be unpacked."""
    if path.suffix.lower() != ".gz":
        return path.read_bytes()
    most = max(UNPACKED_FREELY, MAX_UNPACKED_RATIO * path.stat().st_size)
    parts, size = [], 0
    try:
        with gzip.open(path) as file:
            while part := file.read(_CHUNK):
                parts.append(part)
                size += len(part)
                if size > most:
                    raise ValueError(f"it unpacks to more than {MAX_UNPACKED_RATIO} times its size")
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise ValueError(f"it is no whole gzip file: {error}") from None
    return b"".join(parts)


def read_json(path: Path) -> Any:
    """The content of a JSON file. Raises OSError, or ValueError where it is none, or nests too deeply."""
    text = path.read_text(encoding="utf-8-sig")
    try:
        return json.loads(text, parse_int=_whole_number)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def shown(value: object) -> str:
    """A value of a file as a message repeats it: one line, and not the whole of a long one."""
    text = repr(value)
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]} ..."


def _whole_number(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"it holds a whole number of {len(digits)} digits")
    return int(digits)
