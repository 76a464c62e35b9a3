"""Where SUMO's programs are, and the one line for a machine that lacks what they need."""

import os
from pathlib import Path

from wzsumo.errors import SumoMissingError

SYSTEM_LIBRARIES = "libgl1 libx11-6 libxext6 libxrender1 libatomic1 libexpat1"  # what libsumo 1.28 links on Debian 12
REMEDY = f"on Debian or Ubuntu: apt-get install {SYSTEM_LIBRARIES}; Python packages: make setup"


def sumo_binary(name: str) -> Path:
    """Path of one of SUMO's programs (netconvert, sumo, sumo-gui). Raises SumoMissingError."""
    try:
        import sumo
    except ImportError as error:
        raise SumoMissingError(f"SUMO is not installed ({error}); {REMEDY}") from None
    program = Path(sumo.SUMO_HOME) / "bin" / name
    if not os.access(program, os.X_OK):
        raise SumoMissingError(f"SUMO's program {name} is not at {program}; {REMEDY}")
    return program
