"""The order of searches: careful, hasty, finer, and at last for lower speeds, at which the path may bend more sharply.

The weight on the heuristic bounds how much dearer than the cheapest a path may be. A path of a hasty search, with a greater
weight, may wander within that bound; so the careful search is tried again after it.
"""

import math
from typing import NamedTuple

from wzsumo.frames import FloatArray
from wzsumo.planning.hybrid_astar import EXHAUSTED, FOUND, search
from wzsumo.planning.lattice import lattice_for
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.planning_field import PlanningField
from wzsumo.vehicle import VehicleGeometry

# Fineness of the lattice, factor on the heuristic's weight, share of max_expansions used up at most by the end of the search.
# In a corridor the careful search needs some hundred expansions and finds the better path; among cones, where many paths cost
# about the same, it needs many more. Set on the maps of analysis/benchmarks/planning.py.
_SEARCHES_AT_PLANNED_SPEED = ((1, 1.0, 0.015), (1, 1.7, 0.4), (2, 1.7, 0.7))
_CARE_AFTER_HASTE_SHARE = 0.1  # of max_expansions, for the careful search after a hasty one that found a path; chosen by us
_SPEED_FACTOR = math.sqrt(0.5)  # from one lower speed to the next: half of the square of the speed, so twice the curvature


class SearchResult(NamedTuple):
    """What all searches together came to."""

    outcome: int  # FOUND, EXHAUSTED or LIMIT_REACHED
    n_expansions: int  # of all searches
    segments: FloatArray  # (n, 2), see `hybrid_astar.search`
    speed_mps: float  # for which the last search planned


class _Attempt(NamedTuple):
    speed_mps: float
    fineness: int  # of the lattice
    haste: float  # factor on the heuristic's weight
    expansion_share: float  # of max_expansions, used up at most by the end of the attempt


def search_in_turn(field: PlanningField, *, start: FloatArray, goal: FloatArray) -> SearchResult:
    """The path of the first search that finds one. `start` and `goal` are poses (3,) in metres from the map's corner."""
    terrain, spec = field.terrain, field.spec
    n_expansions, exhausted = 0, None
    for attempt in _attempts(field):
        if exhausted == (attempt.speed_mps, attempt.fineness):
            continue  # a greater weight would try the same states
        lattice = lattice_for(
            field.body,
            max_curvature=spec.max_curvature(field.vehicle, speed_mps=attempt.speed_mps),
            resolution=terrain.resolution,
            fineness=attempt.fineness,
        )
        limit = max(int(attempt.expansion_share * spec.max_expansions) - n_expansions, 1)
        weight = attempt.haste * spec.heuristic_weight
        outcome, n, segments = search(terrain, field.cost_to_go, field.body, lattice, start, goal, weight, limit)
        n_expansions += n
        limit = min(int(_CARE_AFTER_HASTE_SHARE * spec.max_expansions), spec.max_expansions - n_expansions)
        if outcome == FOUND and attempt.haste > 1 and limit > 0:
            again, n, better = search(terrain, field.cost_to_go, field.body, lattice, start, goal, spec.heuristic_weight, limit)
            n_expansions, segments = n_expansions + n, better if again == FOUND else segments
        if outcome == FOUND or n_expansions >= spec.max_expansions:
            break
        if outcome == EXHAUSTED:
            exhausted = (attempt.speed_mps, attempt.fineness)
    return SearchResult(outcome, n_expansions, segments, attempt.speed_mps)


def _attempts(field: PlanningField) -> list[_Attempt]:
    """The attempts in their order; those for lower speeds share what is left of the expansions evenly."""
    planned, *slower = speeds_to_try(field.spec, field.vehicle)
    attempts = [_Attempt(planned, *attempt) for attempt in _SEARCHES_AT_PLANNED_SPEED]
    (_, _, haste, used) = attempts[-1]
    for number, speed in enumerate(slower, start=1):
        attempts.append(_Attempt(speed, 1, haste, used + (1 - used) * number / len(slower)))
    return [*attempts[:-1], attempts[-1]._replace(expansion_share=1.0)]


def speeds_to_try(spec: PlannerSpec, vehicle: VehicleGeometry) -> tuple[float, ...]:
    """The planned speed [m/s] and ever lower ones, down to where the steering, and not the speed, limits the curvature."""
    speeds, least = [spec.planned_speed_mps], spec.slowest_share * spec.planned_speed_mps
    while spec.max_curvature(vehicle, speed_mps=speeds[-1]) < spec.max_curvature(vehicle, speed_mps=0):
        if speeds[-1] * _SPEED_FACTOR < least:
            break
        speeds.append(speeds[-1] * _SPEED_FACTOR)
    return tuple(speeds)
