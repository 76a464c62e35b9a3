"""How good one crowd map is: free area, edges and belief against the truth of a zone, and a path that is planned on it."""

import json
from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd
from generator import SCORED_BEYOND_M, GeneratedZone
from zones import ZONES

from wzsumo.case.guides import nominal_guide
from wzsumo.crowd_mapping.belief import belief, occupied
from wzsumo.crowd_mapping.closing.map_before import MapBefore
from wzsumo.crowd_mapping.lane_model import LaneStructure
from wzsumo.grid import FREE_THRESHOLD, UNKNOWN
from wzsumo.metrics.clearance import clearance_along
from wzsumo.planning.plan import plan_path
from wzsumo.scenario.site import prepare_site

CELL_M = (2.0, 0.1)  # along and across the road: edges matter across
EVEN = 0.5  # cut here instead of at FREE_THRESHOLD a map is as likely too wide as too narrow
BESIDE_M = 2.0  # of the shoulders, counted too
PLAN_CELL_M = 0.254
# Calibration counts p in 20 equal bins between 0.01 and 0.99; cells beyond are trivial and have a bin at either end.
BIN_EDGES = np.r_[0.01, np.linspace(0, 1, 21)[1:-1], 0.99]


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """What is drivable: between `right` and `left` (n,) [m] at stations `s` (n,), on cells `d` (m,) across, in a road's frame.

    `points` (n m, 2) [m] are the cells' middles in the world.
    """

    s: np.ndarray
    d: np.ndarray
    right: np.ndarray
    left: np.ndarray
    points: np.ndarray

    @property
    def drivable(self) -> np.ndarray:
        """Cells (n, m) that are drivable."""
        return (self.d > self.right[:, None]) & (self.d < self.left[:, None])

    def row(self, model: LaneStructure) -> dict[str, object]:
        """Figures of a model's map."""
        p = self.p_occupied(model)
        free, known = p < FREE_THRESHOLD, p != UNKNOWN
        drivable = self.drivable
        hit, either = int((free & drivable).sum()), int((free | drivable).sum())
        rather = known & (p < EVEN)
        occupied_there, sure = ~drivable[known], p[known]
        counts = np.digitize(sure, BIN_EDGES)
        sums = [np.bincount(counts, weights=w, minlength=len(BIN_EDGES) + 1) for w in (None, sure, occupied_there)]
        return {
            "precision": hit / max(int(free.sum()), 1),
            "recall": hit / int(drivable.sum()),
            "iou": hit / either,
            "precision_even": float((rather & drivable).sum() / max(int(rather.sum()), 1)),
            "iou_even": float((rather & drivable).sum() / (rather | drivable).sum()),
            "edge_error_m": self._edge_error(p),
            "brier": float(np.mean((sure - occupied_there) ** 2)),
            "brier_binary": float(np.mean(~free[known] != occupied_there)),
            "reliability": json.dumps([np.round(part, 2).tolist() for part in sums]),
        }

    def p_occupied(self, model: LaneStructure) -> np.ndarray:
        """p(occupied) (n, m) that a model gives to the cells."""
        s, d = model.axis.to_sd(self.points)
        low, high = model.table.stations[[0, -1]]
        inside = (s >= low) & (s <= high)
        p = np.full(len(s), UNKNOWN)
        p[inside] = np.clip(occupied(model, s[inside], d[inside]), 0, 1)
        return p.reshape(len(self.s), len(self.d))

    def _edge_error(self, p: np.ndarray) -> float:
        """Median distance [m] of the outermost places that are rather free than not from the true edges."""
        rather_free = p < UNKNOWN
        there = rather_free.any(axis=1)
        right = self.d[rather_free.argmax(axis=1)] - CELL_M[1] / 2
        left = self.d[len(self.d) - 1 - rather_free[:, ::-1].argmax(axis=1)] + CELL_M[1] / 2
        misses = np.abs(np.concatenate([(right - self.right)[there], (left - self.left)[there]]))
        return float(np.median(misses)) if misses.size else float("nan")


class Judge:
    """The truth of one SUMO zone, and what a path planned on a map of it does."""

    def __init__(self, zone: str) -> None:
        self.scenario = ZONES[zone]
        self.layout = layout = self.scenario.layout()
        road = layout.road
        s, d = _cells(layout.start, layout.end, right=-road.right_shoulder, left=road.left_edge)
        points = road.to_xy(*(side.ravel() for side in np.meshgrid(s, d, indexing="ij")))
        self.truth = Truth(s=s, d=d, right=layout.drivable_right(s), left=layout.drivable_left(s), points=points)
        self.before = MapBefore(road=road, start=layout.start, end=layout.end)

    def never_driven(self, traces: pd.DataFrame) -> bool:
        """Whether no vehicle drove in some lane that stays open, beside the work."""
        area, road = self.layout.area("activity area"), self.layout.road
        s, d = road.to_sd(traces[["x_m", "y_m"]].to_numpy())
        there = (s > area.start) & (s < area.end)
        through = [lane for lane in self.layout.lanes if lane.start <= 0 and lane.end >= road.length - 1e-6]
        return any(not ((d > lane.right(s)) & (d < lane.left(s)) & there).any() for lane in through)

    def planned(self, model: LaneStructure) -> dict[str, object]:
        """What a path planned on the map, joined to the nominal lanes outside the zone, does in truth."""
        scenario = self.scenario
        fine = scenario.model_copy(update={"map": scenario.map.model_copy(update={"resolution_m": PLAN_CELL_M})})
        site = prepare_site(fine)
        learned = belief(model, site.cells)
        grid = learned.with_p_occupied(np.where(site.nominal, 0.0, learned.p_occupied))
        plan = plan_path(
            grid, start=site.start, goal=site.goal, vehicle=fine.vehicle, spec=fine.planner, guide=nominal_guide(site)
        )
        if plan.path is None:
            return {"plan": str(plan.status)}
        return {"plan": str(plan.status)} | asdict(clearance_along(plan.path.poses, vehicle=fine.vehicle, layout=self.layout))


def truth_of_generated(zone: GeneratedZone) -> Truth:
    """The truth of a zone of the generator, from somewhat ahead of its first device to somewhat beyond its last."""
    at = zone.stations
    right, left = (edge(zone.edges(np.linspace(0, zone.length, 200))) for edge in (np.min, np.max))
    s, d = _cells(at["taper"] - SCORED_BEYOND_M, at["end"] + SCORED_BEYOND_M, right=right, left=left)
    points = zone.to_xy(*(side.ravel() for side in np.meshgrid(s, d, indexing="ij")))
    edges = zone.edges(s)
    return Truth(s=s, d=d, right=edges[0], left=edges[1], points=points)


def calibration_errors(reliability: pd.Series) -> tuple[float, float]:
    """Expected calibration error over all known cells of some maps, and over those with 0.01 < p < 0.99.

    Mean distance between what is said and what is so, over bins of p (Guo et al. 2017), each map counting alike.
    """
    sums = np.array([json.loads(one) for one in reliability])
    sums = (sums / sums[:, :1].sum(axis=2, keepdims=True)).sum(axis=0)
    gap = np.abs(sums[1] - sums[2])
    return float(gap.sum() / sums[0].sum()), float(gap[1:-1].sum() / max(sums[0][1:-1].sum(), 1e-12))


def _cells(start: float, end: float, *, right: float, left: float) -> tuple[np.ndarray, np.ndarray]:
    """Middles of cells along and across, BESIDE_M beyond the right and left edge [m] of the road."""
    s = np.arange(start + CELL_M[0] / 2, end, CELL_M[0])
    return s, np.arange(right - BESIDE_M, left + BESIDE_M, CELL_M[1]) + CELL_M[1] / 2
