import numpy as np
import pandas as pd
import pytest

from wzsumo.errors import SpecError
from wzsumo.sensing.equipped import choose_equipped, first_traces

FLEET = pd.Index([f"flow.{number}" for number in range(4000)])


@pytest.mark.parametrize("penetration", [0.05, 0.3])
def test_equipped_vehicles_are_the_given_share_of_the_fleet(penetration: float) -> None:
    equipped = choose_equipped(FLEET, penetration=penetration, seed=1)
    # Four standard deviations of a binomial share.
    assert len(equipped) / 4000 == pytest.approx(penetration, abs=4 * np.sqrt(penetration * (1 - penetration) / 4000))


def test_all_or_none_of_the_fleet_is_equipped_at_the_ends() -> None:
    assert len(choose_equipped(FLEET, penetration=1.0, seed=1)) == 4000
    assert choose_equipped(FLEET, penetration=0.0, seed=1) == []


def test_higher_penetration_appends_vehicles_to_those_of_a_lower_one() -> None:
    few, many = (choose_equipped(FLEET, penetration=share, seed=1) for share in (0.05, 0.1))
    assert many[: len(few)] == few


def test_choice_depends_on_the_seed_and_not_on_the_order_of_the_fleet() -> None:
    forwards, backwards = (choose_equipped(fleet, penetration=0.1, seed=1) for fleet in (FLEET, FLEET[::-1]))
    assert forwards == backwards
    assert forwards != choose_equipped(FLEET, penetration=0.1, seed=2)


def test_as_many_traces_as_asked_for_are_taken_or_the_key_is_named() -> None:
    assert first_traces(["a", "b", "c"], 2, key="crowd.used") == ["a", "b"]
    assert first_traces(["a", "b", "c"], 3, key="crowd.used") == ["a", "b", "c"]
    with pytest.raises(SpecError, match=r"crowd\.used=4 .* 3 equipped vehicles"):
        first_traces(["a", "b", "c"], 4, key="crowd.used")
