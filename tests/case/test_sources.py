from typing import NoReturn

from builders import straight_traces
from case.finished_plans import coarse_paper, coarse_site

from wzsumo.case.crowd import Crowd
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Watch
from wzsumo.case.zone import SimulatedZone
from wzsumo.scenario.scenario import Scenario


def no_files() -> NoReturn:
    raise AssertionError("no ego drives here")


def scenario(used: int) -> Scenario:
    paper = coarse_paper()
    crowd = paper.crowd.model_copy(update={"penetration": 1.0, "used": used})
    return paper.model_copy(update={"crowd": crowd, "mixture": paper.mixture.model_copy(update={"k_max": 1})})


def sources(used: int, *, known_crowd: Crowd | None = None) -> Sources:
    over_zone = straight_traces([1.8, 1.9, 5.4, 5.5], length_m=1100.0)
    zone = SimulatedZone(over_zone=over_zone, whole_fleet=lambda: over_zone, sumo_files=no_files, fleet_before=no_files)
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
