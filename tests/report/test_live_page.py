"""The words of live.html."""

import pytest

from wzsumo.report.live_page import _row

ALARM = {
    "since_s": 60.0, "start_m": 598.4, "start_sd_m": 24.6, "end_m": None, "end_sd_m": None, "n_traces": 1,
}  # fmt: skip


@pytest.mark.parametrize(
    ("rate", "said"), [(1 / 13_400_664, "13,400,664"), (1e-12, "over 1,000,000,000"), (0.0, "over 1,000,000,000")]
)
def test_chance_of_an_alarm_is_told_in_traces_and_a_very_rare_one_as_a_bound(rate: float, said: str) -> None:
    row = _row(ALARM | {"false_alarms_per_trace": rate}, utc=False)
    assert row["once_in"] == said
    assert (row["start"], row["end"], row["since"]) == ("598 ± 25", "", "60 s")
