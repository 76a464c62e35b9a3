import pytest
from builders import paper_work_zone

from wzsumo.errors import SpecError
from wzsumo.spec import parse_spec
from wzsumo.work_zone import WorkZone


def parse_refusal(**changes: object) -> str:
    content = paper_work_zone().model_dump(mode="json", exclude_none=True) | changes
    with pytest.raises(SpecError) as refused:
        parse_spec(WorkZone, content, source="zone.toml")
    return str(refused.value)


@pytest.mark.parametrize("key", ["work_length_ft", "start_ft", "buffer_ft", "shift_ft"])
def test_negative_length_is_refused_with_file_key_and_value(key: str) -> None:
    assert parse_refusal(**{key: -5.0}).startswith(f"zone.toml: {key}=-5.0: ")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_length_that_is_not_finite_is_refused(value: float) -> None:
    assert "work_length_ft" in parse_refusal(work_length_ft=value)


def test_unknown_key_is_refused_with_the_known_ones() -> None:
    message = parse_refusal(post_speed_mph=60)
    assert "post_speed_mph: unknown key (given 60)" in message
    assert "posted_speed_mph" in message.split("known here:")[1]


def test_missing_key_is_refused_by_name() -> None:
    with pytest.raises(SpecError, match=r"zone\.toml: work_length_ft: missing"):
        parse_spec(WorkZone, {"posted_speed_mph": 60, "start_ft": 0}, source="zone.toml")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"taper_tangent_ft": -100.0}, ["taper_tangent_ft=-100.0", "overlap by 100 ft", "0 or more"]),
        ({"device": "barrier"}, ["device='barrier'", "must not form the tapers", "work_space_device"]),
        ({"device_gaps_ft": [[700, 300]]}, ["device_gaps_ft", "[700, 300]", "from < to"]),
        ({"shifted_lane_width_ft": 9.5}, ["shifted_lane_width_ft=9.5", "10"]),
        ({"downstream_taper_ft": 20.0}, ["downstream_taper_ft=20.0", "50"]),
    ],
)
def test_zone_spec_that_is_impossible_is_refused_with_key_and_rule(changes: dict[str, object], says: list[str]) -> None:
    content = paper_work_zone().model_dump(mode="json", exclude_none=True) | changes
    with pytest.raises(SpecError) as refused:
        parse_spec(WorkZone, content, source="zone.toml")
    assert all(part in str(refused.value) for part in ["zone.toml", *says]), str(refused.value)
