"""Map methods of other installed packages, by their entry points of the group `wzsumo.map_methods`.

Every process finds them by itself: the command line, the workers of a sweep, workers on other machines.
"""

import hashlib
from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path

from wzsumo.case.map_method import MapMethod
from wzsumo.errors import DAMAGED, SpecError, one_line

GROUP = "wzsumo.map_methods"
_FAILS: tuple[type[Exception], ...] = (*DAMAGED, ImportError, NameError)  # a module that cannot be loaded


def packaged_methods() -> Iterator[tuple[MapMethod, str]]:
    """Each method of an entry point, and its origin: package, version and a hash of the module that has it.

    Raises SpecError where an entry point cannot be loaded, or names no MapMethod of the entry point's own name.
    """
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else "a package"
        remedy = f"mend or uninstall {package}"
        try:
            method = entry.load()
            digest = _digest_of_module(entry)
        except _FAILS as failed:
            why = one_line(f"{type(failed).__name__}: {failed}", limit=200)
            raise SpecError(f"map method {entry.name}: {entry.value} cannot be loaded ({why}); {remedy}") from None
        if not isinstance(method, MapMethod) or method.name != entry.name:
            raise SpecError(f"map method {entry.name}: {entry.value} must be a MapMethod of this name; {remedy}")
        yield method, f"{package}+{digest}"


def _digest_of_module(entry: EntryPoint) -> str:
    """Hash of the code of an entry point's module: an edited method decides other results."""
    spec = find_spec(entry.module)
    source = Path(spec.origin).read_bytes() if spec and spec.origin else b""
    return hashlib.blake2b(source, digest_size=6).hexdigest()
