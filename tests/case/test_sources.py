from typing import NoReturn

import pytest
from builders import straight_traces
from case.finished_plans import coarse_paper, coarse_site

from wzsumo.case.crowd import Crowd
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Watch
from wzsumo.case.zone import SimulatedZone
from wzsumo.errors import SpecError
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.sections import MapArrivalSpec


def no_files() -> NoReturn:
    raise AssertionError("no ego drives here")


def scenario(used: int) -> Scenario:
    paper = coarse_paper()
    crowd = paper.crowd.model_copy(update={"penetration": 1.0, "used": used})
    return paper.model_copy(update={"crowd": crowd, "mixture": paper.mixture.model_copy(update={"k_max": 1})})


def sources(used: int, *, known_crowd: Crowd | None = None) -> Sources:
    over_zone = straight_traces([1.8, 1.9, 5.4, 5.5], length_m=1100.0)
    zone = SimulatedZone(over_zone=over_zone, whole_fleet=lambda: over_zone, sumo_files=no_files)
    return Sources(zone=zone, scenario=scenario(used), site=coarse_site(), watch=Watch(), known_crowd=known_crowd)


def test_crowd_is_learned_from_the_used_traces_once() -> None:
    of_two = sources(2)
    assert of_two.crowd.traces["vehicle_id"].nunique() == 2
    assert of_two.crowd is of_two.crowd
    assert of_two.watch.seconds == {}  # no mixture is fitted before one is asked for
    assert of_two.crowd.mixture is of_two.crowd.mixture
    assert list(of_two.watch.seconds) == ["mixture"]


def test_crowd_that_is_known_is_not_learned_again() -> None:
    known = sources(2).crowd
    again = sources(3, known_crowd=known)
    assert again.crowd is known
    assert again.watch.seconds == {}


def test_maps_on_the_way_are_of_as_many_traces_as_they_say_and_those_of_the_first_are_among_them() -> None:
    of_one = sources(1)
    first, second = of_one.arriving((MapArrivalSpec(after_s=3.0, used=2), MapArrivalSpec(after_s=8.0, used=4)))
    assert (first.after_s, second.after_s) == (3.0, 8.0)
    ids = [set(crowd.traces["vehicle_id"]) for crowd in (of_one.crowd, first.crowd, second.crowd)]
    assert [len(each) for each in ids] == [1, 2, 4]
    assert ids[0] < ids[1] < ids[2]


def test_map_on_the_way_of_more_traces_than_there_are_is_refused() -> None:
    with pytest.raises(SpecError, match=r"crowd\.used=5"):
        sources(1).arriving((MapArrivalSpec(after_s=3.0, used=5),))
