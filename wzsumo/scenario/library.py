"""The library: scenarios and studies that come with the toolkit, found by their names.

The files lie in scenarios/ of the repository. wzsumo/library is a link to that folder, so that they are in the wheel, too.
"""

from itertools import takewhile
from pathlib import Path

from wzsumo.errors import SpecError, did_you_mean

LIBRARY = (Path(__file__).parents[1] / "library").resolve()
ZONES, NETWORKS, STUDIES = ".", "networks", "studies"  # folders of the library


def library_files(*folders: str) -> dict[str, Path]:
    """The files in these folders of the library, by their names without suffix."""
    return {path.stem: path for folder in folders for path in sorted((LIBRARY / folder).glob("*.toml"))}


def library_file(name: str) -> Path:
    """The file of a scenario or study of the library. Raises SpecError where there is none of that name."""
    known = library_files(ZONES, NETWORKS, STUDIES)
    if name not in known:
        raise SpecError(f"{name}: {_unknown(name, known)}")
    return known[name]


def scenario_file(word: Path | str) -> Path:
    """The scenario file that a word names: a file where there is one, else the scenario of the library."""
    return _named(Path(word), library_files(ZONES, NETWORKS), kind="scenario", others=library_files(STUDIES))


def study_file(word: Path | str) -> Path:
    """The study file that a word names: a file where there is one, else the study of the library."""
    return _named(Path(word), library_files(STUDIES), kind="study", others=library_files(ZONES, NETWORKS))


def purpose(path: Path) -> str:
    """What a file of the library says that it is: the first sentence of its first comment."""
    lines = takewhile(lambda line: line.startswith("# "), path.read_text(encoding="utf-8").splitlines())
    return " ".join(line.removeprefix("# ") for line in lines).partition(". ")[0].rstrip(".")


def _named(path: Path, known: dict[str, Path], *, kind: str, others: dict[str, Path]) -> Path:
    """The path where there is such a file, else the file of the library. A folder gives way to a name of the library.

    A name of `others` is taken, too: what reads the file says which command it is for.
    """
    name = str(path)
    if name in known | others and not _is_file(path):
        return (known | others)[name]
    if path.suffix or path.name != name or _exists(path):  # what reads it says what is wrong with it
        return path
    raise SpecError(f"{name}: no such file; {_unknown(name, known, kind=kind)}")


def _unknown(name: str, known: dict[str, Path], *, kind: str = "scenario or study") -> str:
    return f"no {kind} of the library{did_you_mean(name, known)}; it has {', '.join(known)}"


def _is_file(path: Path) -> bool:
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):  # ValueError: a NUL in the name
        return False


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return True
