import pytest

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.errors import SpecError


def test_zone_whose_ends_nobody_measured_is_known_to_a_tenth_of_a_mile() -> None:
    zone = AnnouncedZone(start_m=300.0, end_m=900.0)
    assert zone.start_sd_m == zone.end_sd_m == pytest.approx(161, abs=15)
    assert zone.closed_lanes is None


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"start_m": 900.0, "end_m": 300.0}, "in this order"),
        ({"start_sd_m": 0.0}, "must be above 0"),
        ({"end_sd_m": float("nan")}, "must be above 0"),
        ({"closed_lanes": (-1,)}, "0 (rightmost) or more"),
        ({"closed_lanes": (1, 1)}, "each once"),
    ],
)
def test_zone_that_contradicts_itself_is_refused_with_its_source(given: dict[str, object], said: str) -> None:
    with pytest.raises(SpecError) as refused:
        AnnouncedZone(**({"start_m": 0.0, "end_m": 1.0, "source": "feed.geojson#7"} | given))  # type: ignore[arg-type]  # wrong on purpose
    assert said in str(refused.value)
    assert str(refused.value).startswith("feed.geojson#7: ")
