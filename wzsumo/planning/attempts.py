"""The order of searches: a careful one first, a hasty one where it does not come through, a finer one where neither does."""

from wzsumo.frames import FloatArray
from wzsumo.planning.hybrid_astar import EXHAUSTED, FOUND, search
from wzsumo.planning.lattice import lattice_for
from wzsumo.planning.planning_field import PlanningField

# Fineness of the lattice, factor on the heuristic's weight, share of max_expansions used up by then. In a corridor the careful
# search comes through in some hundred expansions with the better path; among cones, where many ways are alike, it wanders.
_ATTEMPTS = ((1, 1.0, 0.015), (1, 1.7, 0.5), (2, 1.7, 1.0))


def search_in_turn(
    field: PlanningField, *, start: FloatArray, goal: FloatArray, max_curvature: float
) -> tuple[int, int, FloatArray | None]:
    """(FOUND, EXHAUSTED or LIMIT_REACHED; expansions of all searches; segments (n, 2) or None), as `hybrid_astar.search`.

    `start` and `goal` are poses (3,) in metres from the map's corner.
    """
    terrain, spec = field.terrain, field.spec
    n_expansions, exhausted = 0, 0
    for fineness, haste, share in _ATTEMPTS:
        if exhausted == fineness:
            continue  # another weight would try the same states
        lattice = lattice_for(field.body, max_curvature=max_curvature, resolution=terrain.resolution, fineness=fineness)
        limit = max(int(share * spec.max_expansions) - n_expansions, 1)
        weight = haste * spec.heuristic_weight
        outcome, n, segments = search(terrain, field.cost_to_go, field.body, lattice, start, goal, weight, limit)
        n_expansions += n
        if outcome == FOUND:
            return outcome, n_expansions, segments
        if outcome == EXHAUSTED:
            exhausted = fineness
        if n_expansions >= spec.max_expansions:
            break
    return outcome, n_expansions, None
