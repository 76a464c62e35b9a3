"""The command `capacity`: capacity of a zone by the Highway Capacity Manual."""

import argparse
from dataclasses import asdict
from typing import Any

from wzsumo.commands.terminal.arguments import add_scenario
from wzsumo.errors import SpecError
from wzsumo.scenario.scenario import load_scenario

add_arguments = add_scenario


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Capacity, queue discharge and free-flow speed of a scenario's zone by the HCM, and the scenario's flow."""
    scenario = load_scenario(args.scenario)
    try:
        capacity = scenario.capacity()
    except SpecError as error:
        raise SpecError(f"{args.scenario}: {error}") from None
    return asdict(capacity) | {"demand_flow_vph": scenario.simulation.demand.flow_vph}
