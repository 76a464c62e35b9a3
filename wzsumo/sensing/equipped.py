"""Which vehicles report their traces. They are chosen after the simulation, so one simulation serves every penetration rate."""

import hashlib

import pandas as pd

from wzsumo.errors import SpecError


def choose_equipped(vehicle_ids: pd.Index, *, penetration: float, seed: int) -> list[str]:
    """Ids of the equipped vehicles, a share `penetration` of them on average, in an order that the seed decides.

    Choices are nested: the vehicles equipped at 5 % are also equipped at 10 %, and a higher penetration only appends ids.
    """
    ranked = sorted((_unit_hash(seed, id_), id_) for id_ in map(str, vehicle_ids))
    return [id_ for rank, id_ in ranked if rank < penetration]


def first_traces(equipped: list[str], count: int, *, key: str) -> list[str]:
    """The first `count` equipped vehicles. Raises SpecError where there are fewer; `key` is the scenario key that asked."""
    if count > len(equipped):
        raise SpecError(
            f"{key}={count} asks for more traces than the fleet gives: {len(equipped)} equipped vehicles passed the zone; "
            "raise crowd.penetration or simulation.demand.duration_s, or ask for fewer"
        )
    return equipped[:count]


def _unit_hash(seed: int, vehicle_id: str) -> float:
    """A number in [0, 1), uniform over vehicle ids and the same on every machine."""
    digest = hashlib.blake2b(f"{seed}:{vehicle_id}".encode(), digest_size=8).digest()
    return int.from_bytes(digest, "big") / 2**64
