"""Named errors, what they show of the input, and how signals that end a program are held back.

An `InputError` is one that the user can remedy: exit code 2.
"""

import difflib
import errno
import reprlib
import signal
import struct
import threading
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from types import FrameType
from typing import Any

MAX_SHOWN = 200  # characters of a value that a message repeats
MAX_LINE = 4000  # characters of a whole message
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_MAY_BE_MISSING = (errno.ENOENT, errno.ENOTDIR, errno.EBADF, errno.ELOOP)  # where pathlib says that a file is not there
_SHOWN = reprlib.Repr()
_SHOWN.maxlevel, _SHOWN.maxlist, _SHOWN.maxtuple, _SHOWN.maxdict = 3, 12, 12, 12
_SHOWN.maxstring = _SHOWN.maxother = _SHOWN.maxlong = MAX_SHOWN
# What readers raise at content that is damaged or of another kind: values, types and keys that are not there, a nesting that is
# too deep, a PNG's broken chunk (SyntaxError), a kind of compression that zipfile lacks (NotImplementedError), a broken stream.
DAMAGED: tuple[type[Exception], ...] = (
    OSError, EOFError, ValueError, TypeError, LookupError, AttributeError, OverflowError, RecursionError, MemoryError,
    SyntaxError, NotImplementedError, zlib.error, struct.error,
)  # fmt: skip


class InputError(Exception):
    """Bad input: each message says what was given, the rule and the remedy. The command line prints them and exits with 2."""

    def __str__(self) -> str:
        return "; ".join(map(str, self.args))


class SpecError(InputError):
    """A scenario, study or parameter that is impossible or not supported."""


class TraceError(InputError):
    """A trace table that cannot be used: a column missing, a value not finite, too few traces."""


class MapError(InputError):
    """A map, or a pose on it, that cannot be used: image and metadata disagree, a pose lies outside."""


class CloudError(InputError):
    """A point cloud that cannot be used: wrong shape, a value not finite, too few points, an unknown format."""


class NoGroundError(CloudError):
    """A point cloud in which no ground was found, so that objects on it cannot be found either."""


class PlacementError(InputError):
    """A place in a network at which the zone cannot be set up, or a file of that network that cannot be used."""


class FeedError(InputError):
    """A WZDx feed that cannot be used: another version, no event of this road, broken geometry."""


class OutputError(InputError):
    """A file or folder to which results cannot be written."""


class WorkersLostError(InputError):
    """The workers of a cluster can no longer be reached; what is finished is kept."""


class SumoMissingError(InputError):
    """SUMO cannot be loaded on this machine."""


class DisplayError(InputError):
    """A window was asked for where none can be opened, or it was closed before the end."""


class SimulationError(Exception):
    """SUMO behaved in a way that the toolkit does not handle: a fault of the toolkit, exit code 1."""


def shown(value: object) -> str:
    """The value as a message repeats it: its repr, cut where it is long.

    >>> shown("taper")
    "'taper'"
    """
    if type(value).__module__ == "numpy" and hasattr(value, "item"):
        value = value.item()
    try:
        text = _SHOWN.repr(value)
    except ValueError:  # a whole number of more digits than Python writes out
        text = f"a number of {value.bit_length()} bits" if isinstance(value, int) else type(value).__name__
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."


def count_of(n: float, noun: str) -> str:
    """A whole number of things in words.

    >>> count_of(1, "seed"), count_of(2, "seed")
    ('1 seed', '2 seeds')
    """
    return f"{n:.0f} {noun}{'' if n == 1 else 's'}"


def one_line(text: str, *, limit: int = MAX_LINE) -> str:
    r"""The text on one line: runs of white space become one space, what cannot be printed (control characters) is escaped.

    >>> print(one_line("lane \x1b[31m of 3"))
    lane \x1b[31m of 3
    """
    words = " ".join(text[: 4 * limit].split())
    words = "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode("ascii") for c in words)
    return words if len(words) <= limit else f"{words[: limit - 3]}..."


def did_you_mean(given: str, known: Iterable[str], *, cutoff: float = 0.75) -> str:
    """A question that names the nearest of the known words, to follow what was given; "" where none is as like as `cutoff`.

    >>> did_you_mean("rigth_lane", ["left_lane", "right_lane"])
    ' (did you mean right_lane?)'
    """
    near = difflib.get_close_matches(given[:MAX_SHOWN], list(known), n=2, cutoff=cutoff)
    return f" (did you mean {' or '.join(near)}?)" if near else ""


def check_name(path: Path, *, named_by: str = "") -> None:
    """Raise InputError where nothing can be found out about a path, not even whether it is there: its name is too long, say.

    `named_by` is the key of a file that names it.
    """
    try:
        path.stat()
    except FileNotFoundError:
        return
    except (OSError, ValueError) as failed:  # ValueError: a NUL in the name
        if getattr(failed, "errno", None) not in _MAY_BE_MISSING:
            name = ": ".join(filter(None, (named_by, shown(str(path)))))
            raise InputError(f"{name}: {_reason(failed)}; name another file or folder") from None


def is_file(path: Path) -> bool:
    """Whether an input that names a file names one that is there; a name that no file can have names none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def check_file(path: Path, *, error: type[InputError], remedy: str, max_bytes: float = float("inf")) -> None:
    """Raise `error` where the path names no regular file, or one larger than `max_bytes`.

    Folders, devices and pipes are refused: reading a pipe waits for whoever writes to it.
    """
    try:
        size = path.stat().st_size
    except (OSError, ValueError) as failed:  # ValueError: a NUL in the name
        reason = "no such file" if isinstance(failed, FileNotFoundError) else _reason(failed)
        raise error(f"{path}: {reason}; {remedy}") from None
    if not path.is_file():
        raise error(f"{path}: is {'a folder' if path.is_dir() else 'no regular file'}; {remedy}")
    if size > max_bytes:
        raise error(f"{path}: holds {size / 1e6:.0f} MB, at most {max_bytes / 1e6:g} MB are read; {remedy}")


@contextmanager
def reading(path: Path, *, error: type[InputError], remedy: str, also: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Raise `error`, which names the file, where the block cannot read it; `also` are what its reader raises beside DAMAGED."""
    try:
        yield
    except (*DAMAGED, *also) as failed:
        raise error(f"{path}: cannot be read ({_reason(failed)}); {remedy}") from None


@contextmanager
def uninterrupted() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Hold back what signals that end a program do until the end of the block.

    The block gets a function: in `with interruptible():` signals act as before, those that were held back at once. So what
    was made before it is known to whoever cleans up after it, and cleaning up is not cut short.
    """
    if threading.current_thread() is not threading.main_thread():  # signals act in the main thread alone
        yield nullcontext
        return
    came: list[int] = []
    before: dict[int, Any] = {}

    def note(number: int, _frame: FrameType | None) -> None:
        came.append(number)

    def hold() -> None:
        before.update({number: signal.getsignal(number) for number in ENDING_SIGNALS})
        for number in ENDING_SIGNALS:
            signal.signal(number, note)

    def release() -> None:
        with ExitStack() as handlers:  # all of them, though one that came meanwhile is raised on the way
            for number, handler in before.items():
                handlers.callback(signal.signal, number, handler)
        first = came[:1]
        came.clear()
        for number in first:
            signal.raise_signal(number)

    @contextmanager
    def interruptible() -> Iterator[None]:
        release()
        try:
            yield
        finally:
            hold()

    try:
        hold()
        yield interruptible
    finally:
        release()


def _reason(failed: BaseException) -> str:
    """What an exception says, on one short line: a file's name or offset is left to the message around it."""
    if isinstance(failed, RecursionError):
        return "nested too deeply"
    if isinstance(failed, MemoryError):
        return "it needs more memory than there is"
    if isinstance(failed, KeyError):
        return f"{shown(failed.args[0] if failed.args else '')} is missing"
    text = (failed.strerror if isinstance(failed, OSError) else None) or str(failed) or type(failed).__name__
    return one_line(text, limit=MAX_SHOWN)
