"""code_version names the code that decides results. Editing a map method changes it; editing a report does not."""

import hashlib
from functools import cache
from pathlib import Path

import wzsumo
from wzsumo.case.methods import ORIGINS

# These start the work or present its results. A change there leaves finished results valid.
PRESENTING_FOLDERS = ("commands", "figures", "report", "sweep")
DECIDING_SUBFOLDER = ("sweep", "evaluation")  # decides which maps and evaluations cases share, and so their results
PRESENTING_MODULES = ("__init__.py", "__main__.py", "api.py", "cli.py")  # at the root of the package


@cache
def code_version() -> str:
    """Version of the package and a hash of all modules that decide results."""
    return f"{wzsumo.__version__}+{digest_of(Path(wzsumo.__file__).parent)}"


def code_of_workers() -> str:
    """Version of the code that a worker must have: ours, and that of the packages with map methods."""
    return " ".join([code_version(), *sorted(filter(None, ORIGINS.values()))])


def digest_of(package: Path) -> str:
    """Hash of the modules in a package's folder that decide results."""
    digest = hashlib.blake2b(digest_size=6)
    for path in sorted(package.rglob("*.py")):
        place = path.relative_to(package)
        if place.parts[0] not in PRESENTING_FOLDERS + PRESENTING_MODULES or place.parts[:2] == DECIDING_SUBFOLDER:
            digest.update(place.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
