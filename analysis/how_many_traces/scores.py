"""How good one crowd map is: its free area, edges and probabilities against the truth of a zone, and a path planned on it."""

import json
from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd
from generator import GeneratedZone
from zones import ZONES

from wzsumo.case.map_method import MadeMap, lines_of_lanes
from wzsumo.case.methods import METHODS
from wzsumo.case.plans import plan_for
from wzsumo.crowd_mapping.lanes.raster import occupancy_grid, p_occupied
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import FREE_THRESHOLD, UNKNOWN
from wzsumo.lane_map import LaneMap
from wzsumo.metrics.clearance import clearance_along
from wzsumo.scenario.road_before import map_before_of
from wzsumo.scenario.site import prepare_site

CELL_M = (2.0, 0.1)  # along and across the road; fine across, for the edges
EVEN_THRESHOLD = 0.5  # a map that is cut here instead of at FREE_THRESHOLD is as likely too wide as too narrow
BESIDE_PAVEMENT_M = 2.0  # scored as well, on either side
PLAN_CELL_M = 0.254
# Calibration counts p in 20 equal bins between 0.01 and 0.99. Cells beyond are trivial and have a bin at either end.
BIN_EDGES = np.r_[0.01, np.linspace(0, 1, 21)[1:-1], 0.99]


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """The drivable area of a zone on cells at stations `s` (n,) and offsets `d` (m,) of a road.

    It lies between the offsets `right` and `left` (n,) [m]. `points` (n m, 2) [m] are the cells' middles in the world.
    """

    s: FloatArray
    d: FloatArray
    right: FloatArray
    left: FloatArray
    points: FloatArray

    @property
    def drivable(self) -> BoolArray:
        """Which cells (n, m) are drivable."""
        return (self.d > self.right[:, None]) & (self.d < self.left[:, None])

    def row(self, lanes: LaneMap) -> dict[str, object]:
        """The figures of a lane map; `reliability` holds cells, sum of p and occupied cells by bin of p, as JSON."""
        p = self.p_occupied(lanes)
        free, known = p < FREE_THRESHOLD, p != UNKNOWN
        drivable = self.drivable
        intersection, union = int((free & drivable).sum()), int((free | drivable).sum())
        rather_free = known & (p < EVEN_THRESHOLD)
        truly_occupied, p_known = ~drivable[known], p[known]
        bins = np.digitize(p_known, BIN_EDGES)
        sums = [np.bincount(bins, weights=w, minlength=len(BIN_EDGES) + 1) for w in (None, p_known, truly_occupied)]
        return {
            "precision": intersection / max(int(free.sum()), 1),
            "recall": intersection / int(drivable.sum()),
            "iou": intersection / union,
            "precision_even": float((rather_free & drivable).sum() / max(int(rather_free.sum()), 1)),
            "iou_even": float((rather_free & drivable).sum() / (rather_free | drivable).sum()),
            "edge_error_m": self._edge_error(p),
            "brier": float(np.mean((p_known - truly_occupied) ** 2)),
            "brier_binary": float(np.mean(~free[known] != truly_occupied)),
            "reliability": json.dumps([np.round(part, 2).tolist() for part in sums]),
        }

    def p_occupied(self, lanes: LaneMap) -> FloatArray:
        """p(occupied) (n, m) that a lane map gives to the cells."""
        return p_occupied(lanes, *lanes.axis.to_sd(self.points)).reshape(len(self.s), len(self.d))

    def _edge_error(self, p: FloatArray) -> float:
        """Median distance [m] of the map's edges, the outermost cells with p below UNKNOWN, from the true edges."""
        rather_free = p < UNKNOWN
        has_edges = rather_free.any(axis=1)
        right = self.d[rather_free.argmax(axis=1)] - CELL_M[1] / 2
        left = self.d[len(self.d) - 1 - rather_free[:, ::-1].argmax(axis=1)] + CELL_M[1] / 2
        misses = np.abs(np.concatenate([(right - self.right)[has_edges], (left - self.left)[has_edges]]))
        return float(np.median(misses)) if misses.size else float("nan")


class SumoZone:
    """One SUMO zone by its name in `zones.ZONES`: its truth, the road before it, and paths planned on maps of it."""

    def __init__(self, zone: str) -> None:
        self.scenario = ZONES[zone]
        self.layout = layout = self.scenario.layout()
        road = layout.road
        s, d = _cells(layout.start, layout.end, right=-road.right_shoulder, left=road.left_edge)
        points = road.to_xy(*(side.ravel() for side in np.meshgrid(s, d, indexing="ij")))
        self.truth = Truth(s=s, d=d, right=layout.drivable_right(s), left=layout.drivable_left(s), points=points)
        self.before = map_before_of(layout)

    def never_driven(self, traces: pd.DataFrame) -> bool:
        """Whether there is a lane that stays open and that none of the traces drove in beside the work."""
        area, road = self.layout.area("activity area"), self.layout.road
        s, d = road.to_sd(traces[["x_m", "y_m"]].to_numpy())
        beside_work = (s > area.start) & (s < area.end)
        through = [lane for lane in self.layout.lanes if lane.start <= 0 and lane.end >= road.length - 1e-6]
        return any(not ((d > lane.right(s)) & (d < lane.left(s)) & beside_work).any() for lane in through)

    def planned(self, lanes: LaneMap) -> dict[str, object]:
        """Status and true clearances of a path planned on a lane map, which is joined to the nominal lanes outside."""
        scenario = self.scenario
        fine = scenario.model_copy(update={"map": scenario.map.model_copy(update={"resolution_m": PLAN_CELL_M})})
        site = prepare_site(fine)
        learned = occupancy_grid(lanes, site.cells)
        grid = learned.with_p_occupied(np.where(site.nominal, 0.0, learned.p_occupied))
        made = MadeMap(grid, {}, lanes, lines=lines_of_lanes(lanes))
        plan = plan_for(METHODS["lanes"], made, scenario=fine, site=site)
        if plan.path is None:
            return {"plan": str(plan.status)}
        return {"plan": str(plan.status)} | asdict(clearance_along(plan.path.poses, vehicle=fine.vehicle, layout=self.layout))


def truth_of_generated(zone: GeneratedZone) -> Truth:
    """The truth of a zone of the generator, from its first device to its last."""
    at = zone.stations
    right, left = (float(edge(zone.edges(np.linspace(0, zone.length, 200)))) for edge in (np.min, np.max))
    s, d = _cells(at["taper"], at["end"], right=right, left=left)
    points = zone.to_xy(*(side.ravel() for side in np.meshgrid(s, d, indexing="ij")))
    edges = zone.edges(s)
    return Truth(s=s, d=d, right=edges[0], left=edges[1], points=points)


def calibration_errors(reliability: pd.Series) -> tuple[float, float]:
    """Expected calibration error over all known cells of some maps, and over those with 0.01 < p < 0.99.

    `reliability` holds one `Truth.row` text a map. The error is the mean distance, over bins of p, between p and the share of
    occupied cells (Guo et al. 2017); each map counts alike.
    """
    sums = np.array([json.loads(one) for one in reliability])
    sums = (sums / sums[:, :1].sum(axis=2, keepdims=True)).sum(axis=0)
    gap = np.abs(sums[1] - sums[2])
    return float(gap.sum() / sums[0].sum()), float(gap[1:-1].sum() / max(sums[0][1:-1].sum(), 1e-12))


def _cells(start: float, end: float, *, right: float, left: float) -> tuple[FloatArray, FloatArray]:
    """Middles (n,), (m,) [m] of cells along and across a road with edges at `right` and `left` [m]."""
    s = np.arange(start + CELL_M[0] / 2, end, CELL_M[0])
    return s, np.arange(right - BESIDE_PAVEMENT_M, left + BESIDE_PAVEMENT_M, CELL_M[1]) + CELL_M[1] / 2
