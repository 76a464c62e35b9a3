"""SUMO's own record of every edge of a network over a simulation: time lost on it, emissions (its edgeData outputs)."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd

from wzsumo.simulation.files import SumoFiles, Surroundings
from wzsumo.simulation.network import write_xml

EDGE_COLUMNS = (
    "edge_id",  # the whole edge, its pieces added up; internal edges, which lie in junctions, too
    "time_loss_s",  # of all vehicles on it, against the drivers' own free speeds
    "driven_m",  # by all vehicles
    "co2_g",
    "nox_g",
    "fuel_g",
)
_RECORDS = ("zone.edges.xml", "zone.emissions.xml")
_ORDER = "wzsumo.edges.add.xml"  # the additional file that asks SUMO for both


def edge_record_options(folder: Path, surroundings: Surroundings) -> tuple[str, ...]:
    """SUMO's options for both records, which it writes to `folder`; the file that asks for them is written there."""
    root = ET.Element("additional")
    for number, (name, kind) in enumerate(zip(_RECORDS, ({}, {"type": "emissions"}), strict=True)):
        ET.SubElement(root, "edgeData", {"id": f"wzsumo.edges.{number}", "file": name, "excludeEmpty": "true"} | kind)
    order = folder / _ORDER
    write_xml(root, order)
    own = [folder / path.name for path in surroundings.additionals if (folder / path.name).exists()]
    return ("--additional-files", ",".join(str(path) for path in (*own, order)))


def read_edge_records(files: SumoFiles) -> pd.DataFrame:
    """EDGE_COLUMNS of the edges on which vehicles were, sorted by id."""
    folder, whole = files.config.parent, files.surroundings.whole_edges if files.surroundings else {}
    rows: dict[str, list[float]] = {}
    keys = (("timeLoss", "driven"), ("CO2_abs", "NOx_abs", "fuel_abs"))
    for name, first, wanted in zip(_RECORDS, (0, 2), keys, strict=True):
        for _, item in ET.iterparse(folder / name):  # noqa: S314 a file that SUMO has just written
            if item.tag != "edge":
                continue
            edge = item.get("id", "")
            row = rows.setdefault(whole.get(edge, edge), [0.0] * 5)
            for place, key in enumerate(wanted, start=first):
                row[place] += _driven(item) if key == "driven" else _number(item, key) * (1e-3 if first else 1.0)
            item.clear()
    table = pd.DataFrame([(edge, *row) for edge, row in rows.items()], columns=list(EDGE_COLUMNS))
    return table.sort_values("edge_id", ignore_index=True)


def without_zone(files: SumoFiles) -> SumoFiles:
    """The files of the same simulation without the zone. Raises ValueError where the network is the road alone."""
    if files.surroundings is None:
        raise ValueError("a road of our own has no configuration without its zone")
    return replace(files, config=files.surroundings.without_zone)


def road_edge_ids(files: SumoFiles) -> set[str]:
    """Ids of the whole edges along the road of the zone."""
    around = files.surroundings
    return {around.whole_edges.get(id_, id_) for id_ in around.along} if around else {edge.id for edge in files.edges}


def _number(item: ET.Element, key: str) -> float:
    return float(np.nan_to_num(float(item.get(key, 0))))


def _driven(item: ET.Element) -> float:
    """Metres that all vehicles drove on an edge: their time there at their mean speed."""
    return _number(item, "sampledSeconds") * _number(item, "speed")
