"""From the fleet to what the crowd reports: the traces over the zone, and those of the equipped vehicles with their errors."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from wzsumo.crowd_mapping.mixture.augmentation import with_copies
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec, samples_inside
from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.crowd_mapping.mixture.selection import MixtureSweep, sweep_mixtures
from wzsumo.frames import FloatArray
from wzsumo.metrics.fleet import passages
from wzsumo.road import Road
from wzsumo.scenario.scenario import Scenario
from wzsumo.sensing.equipped import choose_equipped, first_traces
from wzsumo.sensing.gnss import report
from wzsumo.work_zone import WorkZoneLayout

TRACE_MARGIN_M = 50.0  # traces reach this far beyond the zone, so that what is learned joins the nominal map


def traces_over_zone(fleet: pd.DataFrame, layout: WorkZoneLayout) -> pd.DataFrame:
    """True traces over the zone and TRACE_MARGIN_M beyond it, of the vehicles that passed it from end to end."""
    station, _ = layout.road.to_sd(fleet[["x_m", "y_m"]])
    in_zone = (station >= layout.start - TRACE_MARGIN_M) & (station <= layout.end + TRACE_MARGIN_M)
    return fleet[in_zone & fleet["vehicle_id"].isin(passages(fleet, layout)).to_numpy()].reset_index(drop=True)


def reported_traces(over_zone: pd.DataFrame, scenario: Scenario, *, which: Literal["collected", "used"]) -> pd.DataFrame:
    """The traces that are collected, or those among them that make the map, as their vehicles report them.

    `over_zone` is what `traces_over_zone` gives. Raises SpecError where fewer equipped vehicles passed than are asked for.
    """
    crowd = scenario.crowd
    ids = pd.Index(over_zone["vehicle_id"].unique())
    equipped = choose_equipped(ids, penetration=crowd.penetration, seed=scenario.seed)
    chosen = first_traces(equipped, getattr(crowd, which), key=f"crowd.{which}")
    return report(over_zone[over_zone["vehicle_id"].isin(chosen)], spec=scenario.gnss, seed=scenario.seed)


@dataclass(frozen=True, kw_only=True, eq=False)
class Crowd:
    """What the crowd's traces gave: the traces, the mixtures tried, the one chosen, the samples drawn from it.

    The mixtures are of stations and offsets [m] on `road`, the samples (n, 2) are x, y [m].
    """

    traces: pd.DataFrame
    road: Road
    sweep: MixtureSweep
    mixture: Mixture
    samples: FloatArray


def learn_from(
    traces: pd.DataFrame, *, road: Road, spec: MixtureSpec, seed: int, progress: Callable[[int, int], None] | None = None
) -> Crowd:
    """The mixture of the traces' points on `road`, chosen by AIC or BIC over K = 1..k_max, and samples from its 95 % region."""
    table = with_copies(traces, copies=spec.copies, driver_sd_m=spec.driver_sd_m, seed=seed) if spec.copies else traces
    points = np.column_stack(road.to_sd(table[["x_m", "y_m"]]))
    sweep = sweep_mixtures(points, k_max=spec.k_max, reg_covar_m2=spec.least_sd_m**2, progress=progress)
    mixture = sweep.best("aic" if spec.criterion == "aic" else "bic")
    samples = road.to_xy(*samples_inside(mixture, spec=spec, seed=seed).T)
    return Crowd(traces=traces, road=road, sweep=sweep, mixture=mixture, samples=samples)
