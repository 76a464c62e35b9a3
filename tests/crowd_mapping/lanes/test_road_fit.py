"""Fits to a known road: which of two explanations that lie a lane apart, and how sure each lane is."""

import numpy as np
import pandas as pd
import pytest
from kinds import KINDS

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.crowd_mapping.cleaning.usable_traces import usable_traces
from wzsumo.crowd_mapping.lanes.lane_mapping import map_lanes
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.road import RoadSpec

LANE_M = 3.6576


def moved(level_m: float, *, n: int = 10, by_m: float = 14.0) -> pd.DataFrame:
    """Vehicles in one lane, which all lead to the other carriageway between 550 and 1,050 m, each with an error that lasts."""
    random = np.random.default_rng(4)
    parts = []
    for i in range(n):
        x = np.arange(5.0 * random.random(), 1600.0, 25.0)
        aside = by_m * np.clip((x - 500) / 90, 0, 1) * np.clip((1100 - x) / 90, 0, 1)
        y = level_m + aside + 0.4 * random.standard_normal() + 0.15 * random.standard_normal(len(x))
        parts.append(pd.DataFrame({"vehicle_id": f"v{i:02d}", "time_s": 9.0 * i + x / 25.0, "x_m": x, "y_m": y}))
    return pd.concat(parts, ignore_index=True)


def road() -> MapBefore:
    """Two lanes along x, the middle of the right one at y = 0; their zone is announced from x = 300 to 1,300 m."""
    known = RoadSpec(
        lane_count=2, left_shoulder_ft=10, right_shoulder_ft=10,
        reference_points_m=((-200.0, LANE_M / 2), (1800.0, LANE_M / 2)),
    ).build()  # fmt: skip
    return MapBefore(road=known, announced=AnnouncedZone(start_m=500.0, end_m=1500.0, start_sd_m=60.0, end_sd_m=60.0))


@pytest.mark.parametrize("seed", [102, 104, 106])
def test_traffic_in_one_lane_that_crosses_over_is_in_this_lane_of_the_road(seed: int) -> None:
    """Of few traces none may drive in the lane that closes. A road drawn a lane off explains them too, and is less likely."""
    case = KINDS["crossover"].case(n=10, seed=seed, receivers="0.5")
    made = map_lanes(usable_traces(case.traces, source="traces").traces, before=case.before())
    assert abs(made.figures["common_shift_m"]) < 1.0


def test_lane_that_the_other_explanation_has_not_is_in_doubt_and_warnings_say_so() -> None:
    """All positions lie 1.8 m to the right of the left lane, as far from it as from the right one."""
    made = map_lanes(moved(LANE_M / 2), before=road())
    (said,) = [word for word in made.figures["warnings"] if "may not be there" in word]
    assert "other lanes explain the traces too" in said
    used = int(np.argmax([one.n_traces for one in made.lanes.lanes]))
    unused = made.lanes.lanes[1 - used]
    before = made.lanes.stations < 400
    assert unused.p_open_middle[before].max() < 0.9
