"""The version of the code that decides results: an edited method makes new results, an edited page does not."""

import hashlib
from functools import cache
from pathlib import Path

import wzsumo

# What tells or draws what was measured, or carries it out: a change there leaves finished results as they are.
TELLING_FOLDERS = ("commands", "figures", "report", "sweep")
DECIDING_WING = ("sweep", "evaluation")  # of a telling folder: how cases share what they have in common
TELLING_MODULES = ("__init__.py", "__main__.py", "api.py", "cli.py")  # at the root of the package


@cache
def code_version() -> str:
    """Version of the package, and a hash of all modules that decide a result."""
    return f"{wzsumo.__version__}+{digest_of(Path(wzsumo.__file__).parent)}"


def digest_of(package: Path) -> str:
    """Hash of the modules below a package's folder but for what only tells of results."""
    digest = hashlib.blake2b(digest_size=6)
    for path in sorted(package.rglob("*.py")):
        place = path.relative_to(package)
        if place.parts[0] not in TELLING_FOLDERS + TELLING_MODULES or place.parts[:2] == DECIDING_WING:
            digest.update(place.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
