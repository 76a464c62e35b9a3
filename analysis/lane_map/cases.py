"""Case: the traces of a kind, the road before as a file, and the truth."""

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import shapely
from layouts import Layout
from shapely.geometry.base import BaseGeometry

from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.scenario.road_before import read_map_before

FOOT_M = 0.3048
ROAD_BEYOND_M = 200.0  # that the road file goes on beyond the traces at both ends


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """Traces (vehicle_id, time_s, x_m, y_m), the road before as the text of a ROAD.toml, and the areas of the truth.

    `drivable` and `scored` are shapely areas in the frame of the traces. `resolution_m` is a cell that the map affords.
    """

    name: str
    traces: pd.DataFrame
    road_toml: str
    drivable: BaseGeometry
    scored: BaseGeometry
    layout: Layout | None = None
    resolution_m: float = 0.254

    def before(self) -> MapBefore:
        """The road before and the announced zone, read as `wzsumo map --road` reads them."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "road.toml"
            path.write_text(self.road_toml)
            return read_map_before(path)

    def write(self, folder: Path) -> None:
        """Write traces.csv, road.toml and truth.geojson."""
        folder.mkdir(parents=True, exist_ok=True)
        self.traces.round(3).to_csv(folder / "traces.csv", index=False)
        (folder / "road.toml").write_text(self.road_toml)
        features = [
            {"type": "Feature", "properties": {"name": name}, "geometry": json.loads(shapely.to_geojson(area))}
            for name, area in (("drivable", self.drivable), ("scored", self.scored))
        ]
        (folder / "truth.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))


def road_file(layout: Layout, *, announced_shift_m: float = 0.0, road_offset_m: float = 0.0) -> str:
    """The text of a ROAD.toml with the road as it was; stations count from ROAD_BEYOND_M ahead of the traces.

    The zone is announced `announced_shift_m` too far on, the road drawn `road_offset_m` to the left of where it is.
    """
    knots = layout.alignment.knots()
    inner = knots[(knots > -ROAD_BEYOND_M) & (knots < layout.length + ROAD_BEYOND_M)]
    s = np.r_[-ROAD_BEYOND_M, inner, layout.length + ROAD_BEYOND_M]
    points = layout.alignment.to_xy(s, np.full(len(s), road_offset_m))
    at = np.r_[0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))]
    start, end = (float(np.interp(station + announced_shift_m, s, at)) / FOOT_M for station in layout.announced)
    drawn = ", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in points)
    return (
        f"[road]\nlane_count = {layout.lanes}\nlane_width_ft = {layout.width / FOOT_M:.3f}\n"
        f"left_shoulder_ft = {layout.left_shoulder_ft}\nright_shoulder_ft = {layout.right_shoulder_ft}\n"
        f"reference_points_m = [{drawn}]\n[announced]\nstart_ft = {start:.1f}\nend_ft = {end:.1f}\n"
    )
