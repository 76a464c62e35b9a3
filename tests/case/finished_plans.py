"""Plans and runs along the paper's road without planner or SUMO, in one line each."""

from functools import cache

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.ego import EgoRun, Outcome
from wzsumo.path import ReferencePath
from wzsumo.planning.plan import Plan, PlanStatus
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.site import Site, prepare_site
from wzsumo.tables import EGO_LOG_COLUMNS

SAFE_Y = 3.66  # m: between the two open lanes, which leaves a car more than a metre to the devices, to the edge even more


def coarse_paper() -> Scenario:
    """The paper's scenario on cells of 0.5 m."""
    paper = load_scenario("scenarios/paper.toml")
    return paper.model_copy(update={"map": paper.map.model_copy(update={"resolution_m": 0.5})})


@cache
def coarse_site() -> Site:
    """The site of `coarse_paper`."""
    return prepare_site(coarse_paper())


def straight_path(y: float, *, first_m: float = 750.0, last_m: float = 850.0) -> ReferencePath:
    """A pose a metre along +x, by default where devices at y = 7.3 m close the left lane of the paper's zone."""
    x = np.arange(first_m, last_m + 0.5)
    return ReferencePath(poses=np.column_stack([x, np.full_like(x, y), np.zeros_like(x)]))


def plan_of(path: ReferencePath | None, *, status: PlanStatus | None = None, reason: str = "no free corridor") -> Plan:
    """A plan with that path, by which planning took 7 ms."""
    return Plan(
        status=status or (PlanStatus.FOUND if path else PlanStatus.NO_PATH), reason="" if path else reason, path=path,
        min_clearance_m=1.0, max_p_occupied=0.1, risk_m=2.0, speed_mps=15.0, n_expansions=11, timings_ms={"total": 7.0},
    )  # fmt: skip


def run_along(path: ReferencePath, *, outcome: Outcome = Outcome.REACHED_GOAL, cross_track_m: npt.ArrayLike = 0.0) -> EgoRun:
    """A drive at 10 m/s on an empty road."""
    poses = path.poses
    columns: dict[str, npt.ArrayLike] = dict.fromkeys(EGO_LOG_COLUMNS, 0.0) | {
        "time_s": 200.0 + path.arc_length / 10, "x_m": poses[:, 0], "y_m": poses[:, 1], "speed_mps": 10.0,
        "cross_track_m": cross_track_m, "s_m": path.arc_length,
    }  # fmt: skip
    empty = pd.DataFrame({name: pd.Series(dtype=float) for name in ("vehicle_id", "time_s", "x_m", "y_m")})
    reason = "" if outcome is Outcome.REACHED_GOAL else "it ended early"
    return EgoRun(log=pd.DataFrame(columns), traffic=empty, followers=empty, replans=(), outcome=outcome, reason=reason)
