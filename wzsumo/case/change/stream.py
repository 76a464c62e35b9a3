"""The traces of a zone that changes, as equipped vehicles report them one after the other when they leave the road.

A vehicle drives through the zone as it stands when the vehicle enters the road. Two simulations with the same vehicles show the
zone before the change and after it; each vehicle's trace is taken from the one or the other.
"""

from dataclasses import dataclass, replace

import pandas as pd

from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.errors import SpecError
from wzsumo.live.stream.arrivals import Arrival, arrivals_of
from wzsumo.scenario.live_section import LiveSection
from wzsumo.scenario.road_before import map_before, map_before_of
from wzsumo.scenario.scenario import Scenario
from wzsumo.sensing.equipped import choose_equipped
from wzsumo.sensing.gnss import report

ENTRY_M = 100.0  # from the road's start, over which drivers take their place in the lane after SUMO inserted them in its middle


@dataclass(frozen=True, kw_only=True, eq=False)
class ChangingStream:
    """Traces by the time at which they end, of vehicles that entered before the change and of those that entered after it."""

    before: list[Arrival]
    after: list[Arrival]
    reported: pd.DataFrame  # the table of those that entered after


def changing_stream(fleet_before: pd.DataFrame, fleet_after: pd.DataFrame, scenario: Scenario) -> ChangingStream:
    """The reported traces of two fleets of the same vehicles, which drove through the zone before and after its change.

    Raises SpecError where too few entered before it for a first map.
    """
    live = section_of(scenario)
    entered = [fleet.groupby("vehicle_id")["time_s"].min() for fleet in (fleet_before, fleet_after)]
    left = [_left(fleet) for fleet in (fleet_before, fleet_after)]
    early = entered[0].index[entered[0] < live.changed_at_s].intersection(left[0])
    late = entered[1].index[entered[1] >= live.changed_at_s].intersection(left[1])
    equipped = choose_equipped(late, penetration=scenario.crowd.penetration, seed=scenario.seed)
    if len(early) <= live.mapped_traces:
        raise SpecError(
            f"live.mapped_traces={live.mapped_traces}: {len(early)} vehicles entered the road before the change, and the map "
            "needs more, on which it settles; let the change come later or raise simulation.demand.flow_vph"
        )
    before = arrivals_of(_reported(fleet_before, list(early), scenario), source="traces before the change")
    before = [_stretched(one, live, scenario.crowd.penetration) for one in before]
    reported = _reported(fleet_after, equipped, scenario)
    after = arrivals_of(reported, source="traces after the change") if equipped else []
    return ChangingStream(before=before, after=after, reported=reported)


def section_of(scenario: Scenario) -> LiveSection:
    """The section [live]. Raises SpecError where the scenario has none."""
    if scenario.live is None:
        raise SpecError("a live map needs a section [live] in the scenario: when the zone changes, from what to what")
    return scenario.live


def known_before(scenario: Scenario) -> MapBefore:
    """What is known of the road before the change: its lanes, and where its zone stood."""
    live, layout = section_of(scenario), scenario.before_the_change().layout()
    return map_before_of(layout) if live.before.stands else map_before(layout.road, None)


def _left(fleet: pd.DataFrame) -> pd.Index:
    """The vehicles that left the road before the simulation ended."""
    last = fleet.groupby("vehicle_id")["time_s"].max()
    return last.index[last < float(fleet["time_s"].max()) - 1.0]


def _reported(fleet: pd.DataFrame, vehicles: list[str], scenario: Scenario) -> pd.DataFrame:
    station, _ = scenario.layout().road.to_sd(fleet[["x_m", "y_m"]])
    of_them = fleet[fleet["vehicle_id"].isin(vehicles).to_numpy() & (station > ENTRY_M)]
    return report(of_them, spec=scenario.gnss, seed=scenario.seed) if vehicles else of_them


def _stretched(arrival: Arrival, live: LiveSection, penetration: float) -> Arrival:
    """The trace as early as if only a share `penetration` of the vehicles before the change reported."""
    earlier = (live.changed_at_s - arrival.times[0]) * (1 / penetration - 1)
    return replace(arrival, times=arrival.times - earlier)
