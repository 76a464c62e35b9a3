"""Which vehicles report: chosen after the simulation of everyone, so that many penetration rates cost one simulation."""

import hashlib

import pandas as pd

from wzsumo.errors import SpecError


def choose_equipped(vehicle_ids: pd.Index, *, penetration: float, seed: int) -> list[str]:
    """Ids of the equipped vehicles, in an order that is theirs for this seed.

    Nested: those of 5 % are among those of 10 %, and the first 5 among the first 30.
    """
    ranked = sorted((_unit_hash(seed, id_), id_) for id_ in map(str, vehicle_ids))
    return [id_ for share, id_ in ranked if share < penetration]


def first_traces(equipped: list[str], count: int, *, key: str) -> list[str]:
    """The first `count` equipped vehicles. Raises SpecError where the fleet gives fewer; `key` names the spec's key."""
    if count > len(equipped):
        raise SpecError(
            f"{key}={count} asks for more traces than the fleet gives: {len(equipped)} equipped vehicles passed the zone; "
            "raise crowd.penetration or simulation.demand.duration_s, or ask for fewer"
        )
    return equipped[:count]


def _unit_hash(seed: int, vehicle_id: str) -> float:
    digest = hashlib.blake2b(f"{seed}:{vehicle_id}".encode(), digest_size=8).digest()
    return int.from_bytes(digest, "big") / 2**64
