"""Every zone of the library, laid out and exported: do other people's readers read it, and is there a way through?

    python analysis/roads/export_library.py --out FILE.csv [--qc PATH/TO/qc_opendrive]

`lanelet2` routes from every lane at the start of the road to some lane at its end, netconvert reads the OpenDRIVE file, and the
ASAM OpenDRIVE checker (package asam-qc-opendrive, an environment of its own) counts its errors and warnings.
"""

import argparse
import re
import subprocess
import tempfile
from pathlib import Path

import lanelet2
import numpy as np
import pandas as pd

from wzsumo.files.export.lanelet2 import lanelet2_osm
from wzsumo.files.export.opendrive import opendrive_xml
from wzsumo.files.lanes import LanesFile
from wzsumo.geography import local_frame
from wzsumo.mutcd.laid_out_lanes import laid_out_lanes
from wzsumo.scenario.library import ZONES, library_files
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.connection import sumo_binary
from wzsumo.units import mps_from_mph

LAT, LON = 42.28, -83.74  # where the zones, which have no place, are put


def ways_through(content: LanesFile, osm: Path) -> tuple[int, int, int]:
    """(lanelets, lanes at the start, of which some way leads to the end) of a Lanelet2 file."""
    projector = lanelet2.projection.LocalCartesianProjector(lanelet2.io.Origin(LAT, LON))
    found, errors = lanelet2.io.loadRobust(str(osm), projector)
    if errors:
        raise RuntimeError(f"{osm}: {errors[0]}")
    kind = lanelet2.traffic_rules
    graph = lanelet2.routing.RoutingGraph(found, kind.create(kind.Locations.Germany, kind.Participants.Vehicle))
    lanes = content.lanes
    ends = []
    for station in (lanes.stations[0] + 5.0, lanes.stations[-1] - 5.0):
        number = int(np.searchsorted(lanes.stations, station)) - 1
        points = [lanes.to_xy(station, lane.middle[number]) for lane in lanes.lanes if lane.p_open_middle[number] > 0.9]
        ends.append(
            [
                lanelet for x, y in points for lanelet in found.laneletLayer
                if lanelet2.geometry.inside(lanelet, lanelet2.core.BasicPoint2d(x, y))
            ]
        )  # fmt: skip
    led = sum(any(graph.getRoute(start, goal) is not None for goal in ends[1]) for start in ends[0])
    return len(list(found.laneletLayer)), len(ends[0]), led


def netconvert_reads(xodr: Path) -> bool:
    command = [str(sumo_binary("netconvert")), "--opendrive-files", str(xodr), "-o", str(xodr.with_suffix(".net.xml"))]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def qc_issues(xodr: Path, checker: str) -> tuple[int, int]:
    """(errors, warnings) of the ASAM checker."""
    report, config = xodr.with_suffix(".xqar"), xodr.with_suffix(".config.xml")
    bundle = f'<CheckerBundle application="xodrBundle"><Param name="resultFile" value="{report}"/></CheckerBundle>'
    config.write_text(f'<Config><Param name="InputFile" value="{xodr}"/>{bundle}</Config>')
    subprocess.run([checker, "-c", str(config)], capture_output=True, check=True)
    levels = re.findall(r'<Issue [^>]*level="(\d)"', report.read_text())
    return levels.count("1"), levels.count("2")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--qc", help="the program qc_opendrive")
    args = parser.parse_args()
    rows = []
    for name, path in library_files(ZONES).items():
        scenario = load_scenario(path)
        content = LanesFile(lanes=laid_out_lanes(scenario.layout()), frame=local_frame([[LON, LAT]]))
        limit = mps_from_mph(scenario.work_zone.posted_speed_mph)
        with tempfile.TemporaryDirectory() as folder:
            osm, xodr = Path(folder) / "zone.osm", Path(folder) / "zone.xodr"
            osm.write_bytes(lanelet2_osm(content, speed_limit_mps=limit))
            lanelets, starts, led = ways_through(content, osm)
            xodr.write_bytes(opendrive_xml(content, speed_limit_mps=limit, name=name))
            errors, warnings = qc_issues(xodr, args.qc) if args.qc else (-1, -1)
            rows.append(
                {"zone": name, "lanelets": lanelets, "lanes_at_start": starts, "with_a_way_through": led,
                 "netconvert_reads": netconvert_reads(xodr), "qc_errors": errors, "qc_warnings": warnings}
            )  # fmt: skip
    pd.DataFrame(rows).to_csv(args.out, index=False)
    print(pd.DataFrame(rows).to_string(index=False))


if __name__ == "__main__":
    main()
