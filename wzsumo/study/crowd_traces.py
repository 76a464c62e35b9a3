"""From the fleet to what the crowd reports: the traces over the zone, and those of the equipped vehicles with their errors."""

from typing import Literal

import pandas as pd

from wzsumo.metrics.fleet import passages
from wzsumo.sensing.equipped import choose_equipped, first_traces
from wzsumo.sensing.gnss import report
from wzsumo.study.scenario import Scenario
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
