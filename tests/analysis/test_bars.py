"""What analysis/lane_map/bars.py makes of rows."""

import pandas as pd
import pytest
from bars import falls, medians, reached


def rows_of(precisions: dict[int, tuple[float, float, float]], *, kind: str = "i80") -> pd.DataFrame:
    """Rows of three seeds for each number of traces, with an IoU 0.02 below the precision."""
    base = {"kind": kind, "receivers": "0", "variant": "exact", "mode": "joined", "error": None}
    return pd.DataFrame(
        base | {"n": n, "seed": seed, "precision": p, "iou": p - 0.02}
        for n, values in precisions.items()
        for seed, p in enumerate(values)
    )


def test_bar_counts_the_groups_whose_medians_reach_it() -> None:
    table = medians(rows_of({10: (0.99, 0.98, 0.2), 30: (0.96, 0.99, 0.95)}))
    (row,) = reached(table).to_dict("records")
    assert (row["bar"], row["groups"], row["reached"]) == ("I-80 joined", 2, 1)
    assert row["precision_least"] == pytest.approx(0.96)
    assert row["least_precision_in"] == "i80 0 30 exact joined"


def test_failed_maps_count_as_nothing_found() -> None:
    rows = rows_of({10: (0.99, 0.99, 0.99)})
    rows.loc[:1, "error"] = "fault: IndexError"
    assert medians(rows)["precision"].tolist() == [0.0]


def test_only_falls_with_more_traces_are_named() -> None:
    table = medians(rows_of({5: (0.90,) * 3, 10: (0.95,) * 3, 30: (0.945,) * 3, 100: (0.93,) * 3}))
    assert list(falls(table)) == [
        "i80 0 exact joined: precision falls from 0.945 to 0.930 at n = 100",
        "i80 0 exact joined: iou falls from 0.925 to 0.910 at n = 100",
    ]
