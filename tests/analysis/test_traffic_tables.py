"""What analysis/traffic makes of runs: a run that locked is counted and not averaged."""

import pandas as pd
from calibrate_traffic import discharge_table
from library_traffic import table_of

QUEUE = " ".join(["26"] * 45)  # passenger cars a minute past one open lane: 1560 an hour


def discharge_run(seed: int, *, counts: str, locked_min: float | None) -> dict[str, object]:
    """A run of 2 to 1 urban in which a queue stands from the first minute on."""
    speeds = " ".join(["5"] * len(counts.split()))
    return {
        "zone_class": "2_to_1_urban", "trucks": 0.0, "seed": seed, "locked_min": locked_min, "emergency_stops": 0,
        "counts": counts, "speeds_mps": speeds,
    }  # fmt: skip


def test_discharge_of_a_run_that_locked_is_left_out_and_counted() -> None:
    slow = " ".join(["10"] * 45)
    runs = [discharge_run(1, counts=QUEUE, locked_min=None), discharge_run(2, counts=slow, locked_min=45)]
    table = discharge_table(pd.DataFrame(runs))
    assert "| 2 to 1 urban | 0% | 1 | 1591 | 1560 | -1.9% |" in table
    assert "Runs that locked, left out: 1 of 2." in table


def test_flow_and_delay_of_a_zones_run_that_locked_are_left_out_and_its_contacts_are_counted() -> None:
    run = {
        "zone": "right_lane", "times": 3.0, "seed": 1, "asked": 100, "entered": 90, "waiting": 10, "in_closed_area": 0,
        "overlapping": 1, "locked_s": None, "ttc_below_1.5_s": 2, "pet_below_1_s": 3, "throughput_vph": 1400,
        "mean_delay_s": 50.0, "q10": -300.0, "q50": -200.0, "q90": -100.0,
    }  # fmt: skip
    locked = run | {"seed": 2, "locked_s": 300.0, "throughput_vph": 200, "mean_delay_s": 500.0, "q50": 0.0}
    last = table_of(pd.DataFrame([run, locked])).splitlines()[-1]
    expected = "| `right_lane` | 3 | 2 | 200, 180, 20 | 0 | 2 | 1 | 4 | 6 | 1,400 | 50.0 | -300, -200, -100 |"
    assert last == expected
