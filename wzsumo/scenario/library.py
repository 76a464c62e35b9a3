"""The library of scenarios that comes with the toolkit."""

import sys
from pathlib import Path

from wzsumo.errors import SpecError

# In a checkout the library lies beside the package; the wheel puts it under the environment's share/.
PLACES = (Path(__file__).parents[2] / "scenarios", Path(sys.prefix) / "share" / "wzsumo" / "scenarios")


def library_zones() -> dict[str, Path]:
    """The files of the library by the names of their scenarios. Raises SpecError where the library is not installed."""
    for folder in PLACES:
        if found := sorted(folder.glob("*.toml")):
            return {path.stem: path for path in found}
    raise SpecError(f"the library of scenarios is not at {' or '.join(map(str, PLACES))}; install the toolkit again")


def library_zone(name: str) -> Path:
    """The file of a scenario of the library. Raises SpecError where there is none of that name."""
    zones = library_zones()
    if name not in zones:
        raise SpecError(f"{name}: no scenario of the library; it has {', '.join(zones)}")
    return zones[name]
