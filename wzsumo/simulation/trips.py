"""SUMO's own record of every vehicle: wait for departure, time loss, emissions (its tripinfo output)."""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd

from wzsumo.simulation.files import SumoFiles

# Emissions are those of SUMO's default classes (HBEFA 4: petrol car Euro 4, average heavy vehicle), not of this road's fleet.
TRIP_OPTIONS = (
    "--tripinfo-output.write-unfinished",
    "--tripinfo-output.write-undeparted",
    "--device.emissions.probability",
    "1",
)
TRIP_COLUMNS = (
    "vehicle_id",
    "departure_delay_s",  # wait for a gap to enter the road; until the simulation's end for vehicles that still wait
    "entered",  # bool
    "arrived",  # bool, at the road's end
    "travel_time_s",  # on the road, NaN unless arrived
    "time_loss_s",  # of the travel time, against the driver's own free speed; NaN unless arrived
    "lost_so_far_s",  # the same of all vehicles up to the simulation's end; 0 unless entered
    "distance_m",  # driven so far
    "co2_g",
    "nox_g",
    "fuel_g",
)


def trips_file(files: SumoFiles) -> Path:
    """The file to which `simulate_fleet` lets SUMO write its tripinfo."""
    return files.config.parent / "zone.tripinfo.xml"


def read_trips(path: Path) -> pd.DataFrame:
    """`TRIP_COLUMNS`, one row a vehicle that was due to depart, sorted by id."""
    rows = []
    for _, trip in ET.iterparse(path):  # noqa: S314 a file that SUMO has just written
        if trip.tag != "tripinfo":
            continue
        entered, arrived = float(trip.get("depart", -1)) >= 0, float(trip.get("arrival", -1)) >= 0
        emissions = trip.find("emissions")
        grams = [
            float(emissions.get(key, 0)) / 1000 if emissions is not None else 0.0 for key in ("CO2_abs", "NOx_abs", "fuel_abs")
        ]
        rows.append((
            trip.get("id"), float(trip.get("departDelay", 0)), entered, arrived,
            float(trip.get("duration", np.nan)) if arrived else np.nan,
            float(trip.get("timeLoss", np.nan)) if arrived else np.nan,
            float(trip.get("timeLoss", 0)) if entered else 0.0,
            float(trip.get("routeLength", 0)) if entered else 0.0,
            *grams,
        ))  # fmt: skip
        trip.clear()
    return pd.DataFrame(rows, columns=list(TRIP_COLUMNS)).sort_values("vehicle_id", ignore_index=True)
