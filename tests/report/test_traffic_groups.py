"""The four groups of a run's traffic."""

from dataclasses import fields

from wzsumo.metrics.traffic import TrafficSummary
from wzsumo.report.traffic_groups import DELAY_LIMIT, QUEUE_LIMIT, traffic_groups

FIGURES = [field.name for field in fields(TrafficSummary)]


def test_every_figure_of_a_run_stands_in_one_group() -> None:
    groups = traffic_groups(dict.fromkeys(FIGURES, 1.0))
    assert list(groups) == ["Flow", "Delay and queue", "Safety", "Emissions"]
    assert sum(map(len, groups.values())) == len(FIGURES)
    assert traffic_groups({}) == {}


def test_rows_carry_their_unit_and_say_in_words_what_did_not_happen() -> None:
    groups = traffic_groups(
        {
            "throughput_vph": 1370.77,
            "queue_discharge_vph": None,
            "locked_s": None,
            "locked_station_m": None,
            "nox_g_per_vkm": 0.0939,
        }
    )
    assert [row.value for row in groups["Flow"]] == ["1371 veh/h", "no queue stood so long", "none did"]
    assert [row.value for row in groups["Emissions"]] == ["0.094 g per veh km"]


def test_references_are_those_of_the_manual_and_of_the_agencies() -> None:
    traffic = dict.fromkeys(FIGURES, 1.0) | {"hcm_queue_discharge_vph": 1446.0}
    told = {row.name: row.reference for rows in traffic_groups(traffic, demand_vph=850.0).values() for row in rows}
    assert told["Flow past the activity area, after the warm-up"] == "850 asked for in the scenario"
    # HCM 7, Eq. 10-9: the capacity is the queue discharge over 1 - 13.4 %.
    assert told["Highest flow of 15 minutes before a queue stood"].startswith("1670,")
    assert told["Flow out of a queue that has stood for 8 minutes"].startswith("1446,")
    assert told["Carbon dioxide"].startswith("249,")  # 400 g a mile
    assert told["Fuel"].startswith("79,")  # of 400 / 8887 gallons a mile
    assert (DELAY_LIMIT.most, round(QUEUE_LIMIT.most)) == (720, 1207)  # 12 min, 0.75 mile
    assert "1207 m" in QUEUE_LIMIT.words


def test_vehicles_that_were_tracked_are_told_with_the_rest() -> None:
    fleet = {"n_passed": 194, "n_in_closed_area": 0, "merge_position_m": {"q10": -449.0, "q50": None, "q90": 12.4}}
    groups = traffic_groups({"n_vehicles": 209, "n_overlapping": 0}, fleet=fleet)
    assert [row.value for row in groups["Flow"]] == ["209", "194", "10 % by 449 m before; 90 % by 12 m after"]
    assert [row.value for row in groups["Safety"]] == ["0", "0", "-"]
