"""Values of the lane model made by hand, in one line each: a straight course along y = 0, stations every 10 m up to 1 km."""

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.crowd_mapping.closing.lane_ends import LaneEnds
from wzsumo.crowd_mapping.closing.lane_use import LaneUse
from wzsumo.crowd_mapping.course.common_path import CommonPath, TraceErrors
from wzsumo.crowd_mapping.course.station_table import StationTable
from wzsumo.crowd_mapping.hypotheses.change_likelihood import LaneEvidence
from wzsumo.crowd_mapping.hypotheses.lane_hypotheses import LaneHypothesis
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern
from wzsumo.crowd_mapping.lane_model import LaneStructure, LaneStructureSpec
from wzsumo.frames import FloatArray
from wzsumo.road import RoadSpec

STATIONS = np.arange(0.0, 1000.0, 10.0)
WIDTH_M = 3.6


def lane_evidence(
    lanes: npt.ArrayLike, levels: npt.ArrayLike, *, spread: float = 0.2, weights: FloatArray | None = None
) -> LaneEvidence:
    """Evidence of traces that drove in lanes (n, stations), counted from anywhere, with levels (n,) [m] of the first ones."""
    lanes = np.asarray(lanes)
    return LaneEvidence(
        levels=np.asarray(levels, dtype=float),
        lanes=lanes - lanes[:, :1],
        weights=np.ones(len(lanes)) if weights is None else weights,
        spacing=10.0,
        width=(WIDTH_M, 0.12),
        usual_spread=spread,
    )


def common_path(
    lanes: npt.ArrayLike,
    levels: npt.ArrayLike,
    *,
    course: FloatArray | None = None,
    drift_m: float = 0.03,
    noise_m: float = 0.12,
    bias_m: float = 0.0,
) -> CommonPath:
    """The common path of traces in lanes (n, stations), from each one's first, with levels (n,) [m]."""
    lanes = np.asarray(lanes, dtype=float)
    return CommonPath(
        course=np.zeros(lanes.shape[1]) if course is None else course,
        lanes=lanes,
        levels=np.asarray(levels, dtype=float),
        errors=TraceErrors(drift_m=drift_m, noise_m=noise_m, bias_m=bias_m),
        bias_effect=None,
        cost=0.0,
    )


def station_table(offsets: npt.ArrayLike) -> StationTable:
    """The table of traces with offsets (n, stations) [m]."""
    offsets = np.asarray(offsets, dtype=float)
    ids = tuple(map(str, range(len(offsets))))
    return StationTable(stations=STATIONS[: offsets.shape[1]], offsets=offsets, vehicle_ids=ids, dropped=pd.DataFrame())


def lane_levels(
    lanes: npt.ArrayLike,
    *,
    n_lanes: int,
    closed: tuple[int, ...] = (),
    interior: tuple[int, ...] = (),
    closed_from: int = 0,
    open_from: int = 0,
    right: float = 0.0,
    width: float = WIDTH_M,
    covariance: FloatArray | None = None,
    spread: float = 0.2,
) -> LaneLevels:
    """Levels of n lanes that go through, for traces that surely drove in lanes (n, stations), as counted from the right."""
    lanes = np.asarray(lanes, dtype=float)
    covariance = 0.01 * np.eye(2) if covariance is None else covariance
    hypothesis = LaneHypothesis(
        pattern=LanePattern(n_lanes, interior), right=right, width=width, covariance=covariance, spread=spread,
        closed_from=closed_from, open_from=open_from, first=np.ones((len(lanes), 1)), log_evidence=0.0,
    )  # fmt: skip
    return LaneLevels(
        n_lanes=n_lanes, closed=closed, interior=interior, closed_from=closed_from, open_from=open_from, right=right,
        width=width, covariance=covariance, outer_width=width, outer_width_sd=0.1, spread=spread, lanes=lanes,
        hypothesis=hypothesis,
    )  # fmt: skip


def lane_structure(levels: LaneLevels, *, ends: LaneEnds | None = None, noise_m: float = 0.0) -> LaneStructure:
    """The model of traces that drove exactly on the middles of their lanes, on a road along x, with lanes that are all open."""
    offsets = levels.right + levels.width * levels.lanes
    return LaneStructure(
        spec=LaneStructureSpec(),
        axis=RoadSpec(lane_count=1, left_shoulder_ft=0, right_shoulder_ft=0, length_ft=3300).build(),
        before=None,
        table=station_table(offsets),
        weights=np.ones(len(offsets)),
        speed_mps=25.0,
        path=common_path(levels.lanes - levels.lanes[:, :1], offsets[:, 0], noise_m=noise_m),
        levels=levels,
        shifts=(),
        ends=ends or LaneEnds(closing={}, opening={}),
        use=LaneUse(
            stations=STATIONS, open_chance=np.ones((levels.n_lanes, len(STATIONS))), swept=np.zeros((len(STATIONS), 1))
        ),
        chance=1.0,
        alternatives=(),
    )
