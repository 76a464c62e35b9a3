"""What a run says before it begins."""

import re

import pytest

from wzsumo.scenario.outlook import deciding_values, foreseen_lacks
from wzsumo.scenario.scenario import Scenario, load_scenario


def changed(name: str, **sections: dict[str, object]) -> Scenario:
    content = load_scenario(name).model_dump(exclude_unset=True)
    return Scenario.model_validate(content | {key: content.get(key, {}) | value for key, value in sections.items()})


def test_values_that_decide_the_result_are_named_and_defaults_marked() -> None:
    said = deciding_values(load_scenario("right_lane"))
    assert "ego: drives 65 mph (29.1 m/s), the posted speed" in said
    assert "road type: freeway (default)" in said
    assert "drivers: hcm" in said
    assert any(line.startswith("traces: 5 used of 30 collected, 40 % of the vehicles equipped; ") for line in said)
    assert "ego: drives 22 mph (10.0 m/s)" in deciding_values(load_scenario("paper"))
    assert not any(line.startswith("drivers") for line in deciding_values(load_scenario("freeway")))  # the network's own


@pytest.mark.parametrize(("penetration", "keys"), [(0.4, []), (0.1, ["collected"]), (0.01, ["collected", "used"])])
def test_traces_that_cannot_be_had_are_foreseen(penetration: float, keys: list[str]) -> None:
    """850 veh/h for 900 s, less the 45 s to the end of the zone: some 200 vehicles pass, by hand."""
    lacks = foreseen_lacks(changed("right_lane", crowd={"penetration": penetration}))
    assert [line.partition("=")[0] for line in lacks] == [f"crowd.{key}" for key in keys]
    if keys:
        (number,) = re.findall(r"some ([0-9.]+) equipped vehicles", lacks[0])
        assert float(number) == pytest.approx(200 * penetration, rel=0.02)
