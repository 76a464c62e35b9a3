"""The order of searches: careful, hasty, finer, and at last for lower speeds, which bend more sharply.

A way that was found in haste may wander within what the heuristic's weight allows: it is looked for again with care.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from wzsumo.frames import FloatArray
from wzsumo.planning.hybrid_astar import EXHAUSTED, FOUND, search
from wzsumo.planning.lattice import lattice_for
from wzsumo.planning.planning_field import PlanningField

# Fineness of the lattice, factor on the heuristic's weight, share of max_expansions used up by then. In a corridor the careful
# search comes through in some hundred expansions with the better path; among cones, where many ways are alike, it wanders.
_AT_PLANNED_SPEED = ((1, 1.0, 0.015), (1, 1.7, 0.4), (2, 1.7, 0.7))
_AGAIN = 0.1  # share of max_expansions, for the careful search after a hasty one that found a way
_SLOWER = math.sqrt(0.5)  # each time: half the lateral acceleration, so twice the curvature


class Found(NamedTuple):
    """What the searches came to."""

    outcome: int  # FOUND, EXHAUSTED or LIMIT_REACHED
    n_expansions: int  # of all searches
    segments: FloatArray  # (n, 2), see `hybrid_astar.search`
    speed_mps: float  # that the last search allowed for


class _Attempt(NamedTuple):
    speed_mps: float
    fineness: int
    haste: float
    share: float


def search_in_turn(field: PlanningField, *, start: FloatArray, goal: FloatArray) -> Found:
    """The first way that one of the searches finds. `start` and `goal` are poses (3,) in metres from the map's corner."""
    terrain, spec = field.terrain, field.spec
    n_expansions, exhausted = 0, None
    for attempt in _attempts(field):
        if exhausted == (attempt.speed_mps, attempt.fineness):
            continue  # another weight would try the same states
        lattice = lattice_for(
            field.body,
            max_curvature=spec.max_curvature(field.vehicle, speed_mps=attempt.speed_mps),
            resolution=terrain.resolution,
            fineness=attempt.fineness,
        )
        limit = max(int(attempt.share * spec.max_expansions) - n_expansions, 1)
        weight = attempt.haste * spec.heuristic_weight
        outcome, n, segments = search(terrain, field.cost_to_go, field.body, lattice, start, goal, weight, limit)
        n_expansions += n
        limit = min(int(_AGAIN * spec.max_expansions), spec.max_expansions - n_expansions)
        if outcome == FOUND and attempt.haste > 1 and limit > 0:
            again, n, better = search(terrain, field.cost_to_go, field.body, lattice, start, goal, spec.heuristic_weight, limit)
            n_expansions, segments = n_expansions + n, better if again == FOUND else segments
        if outcome == FOUND or n_expansions >= spec.max_expansions:
            break
        if outcome == EXHAUSTED:
            exhausted = (attempt.speed_mps, attempt.fineness)
    return Found(outcome, n_expansions, segments, attempt.speed_mps)


def _attempts(field: PlanningField) -> list[_Attempt]:
    attempts = [_Attempt(field.spec.planned_speed_mps, *attempt) for attempt in _AT_PLANNED_SPEED]
    (_, _, haste, used), slower = attempts[-1], list(_slower_speeds(field))
    for number, speed in enumerate(slower, start=1):
        attempts.append(_Attempt(speed, 1, haste, used + (1 - used) * number / len(slower)))
    return [*attempts[:-1], attempts[-1]._replace(share=1.0)]


def _slower_speeds(field: PlanningField) -> Iterator[float]:
    """Speeds below the planned one for which the path may bend more sharply, until the steering sets the limit."""
    spec, vehicle = field.spec, field.vehicle
    speed = spec.planned_speed_mps
    while spec.max_curvature(vehicle, speed_mps=speed) < spec.max_curvature(vehicle, speed_mps=0):
        speed *= _SLOWER
        if speed < spec.slowest_share * spec.planned_speed_mps:
            return
        yield speed
