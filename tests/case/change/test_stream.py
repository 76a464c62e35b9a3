"""Which vehicle's trace is of which zone, and when it comes."""

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces

from wzsumo.case.change.stream import changing_stream, known_before
from wzsumo.errors import SpecError
from wzsumo.scenario.scenario import Scenario, load_scenario

CHANGED_S = 400.0
BEFORE_Y, AFTER_Y = 1.8, 5.4


def scenario(*, penetration: float = 1.0, mapped: int = 5) -> Scenario:
    found = load_scenario("scenarios/lane_closes.toml")
    assert found.live is not None
    return found.model_copy(update={
        "crowd": found.crowd.model_copy(update={"penetration": penetration}),
        "gnss": found.gnss.model_copy(update={"error_m": 0.0}),
        "live": found.live.model_copy(update={"mapped_traces": mapped}),
    })  # fmt: skip


def fleet(y: float) -> pd.DataFrame:
    """Sixty vehicles that enter the road every 20 s and take 50 s."""
    table = straight_traces(np.full(60, y), length_m=1000.0)
    number = table["vehicle_id"].str[1:].astype(int)
    return table.assign(time_s=table["time_s"] + 20.0 * number)


def test_vehicle_drives_through_the_zone_as_it_stands_when_it_enters() -> None:
    stream = changing_stream(fleet(BEFORE_Y), fleet(AFTER_Y), scenario())
    assert len(stream.before) == 20  # those that enter at 0, 20, ... 380 s
    assert all((one.points[:, 1] == BEFORE_Y).all() for one in stream.before)
    assert all((one.points[:, 1] == AFTER_Y).all() for one in stream.after)
    assert len(stream.after) == 39  # the last was on the road when the simulation ended
    ends = [one.end_s for one in (*stream.before, *stream.after)]
    assert ends == sorted(ends)
    assert np.diff(ends).max() < 22.0  # no gap at the change
    assert set(stream.reported["vehicle_id"]) == {f"v{n:03d}" for n in range(20, 59)}


def test_traces_before_the_change_come_as_seldom_as_those_of_equipped_vehicles_after_it() -> None:
    stream = changing_stream(fleet(BEFORE_Y), fleet(AFTER_Y), scenario(penetration=0.25))
    starts = np.array([one.times[0] for one in stream.before])
    np.testing.assert_allclose(np.diff(starts), 20.0 / 0.25, atol=4.0)
    assert starts[-1] < CHANGED_S
    assert np.ptp(stream.before[0].times) == pytest.approx(45.0, abs=2.0)  # 900 m at 20 m/s: a drive takes as long as it takes
    assert 4 <= len(stream.after) <= 18


def test_vehicles_on_the_road_when_the_simulation_ends_are_no_traces_of_before() -> None:
    short = fleet(BEFORE_Y)
    stream = changing_stream(short[short["time_s"] < 300.0], fleet(AFTER_Y), scenario())
    assert len(stream.before) == 13  # the last to leave by then entered at 240 s


def test_too_few_traces_for_a_first_map_are_refused() -> None:
    with pytest.raises(SpecError, match=r"live\.mapped_traces=20: 20 vehicles entered the road before the change"):
        changing_stream(fleet(BEFORE_Y), fleet(AFTER_Y), scenario(mapped=20))


def test_known_before_is_the_road_and_where_its_zone_stood_if_there_was_one() -> None:
    assert known_before(scenario()).announced is None
    there = scenario()
    assert there.live is not None
    state = there.live.before.model_copy(update={"stands": True, "start_ft": 2000.0})
    moved = there.model_copy(update={"live": there.live.model_copy(update={"before": state})})
    announced = known_before(moved).announced
    assert announced is not None
    assert announced.start_m == pytest.approx(2000 * 0.3048)
