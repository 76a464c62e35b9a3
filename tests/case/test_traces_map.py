from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces

from wzsumo.case.map_method import MadeMap, MapTask, TracesMethod
from wzsumo.case.traces_map import map_of_traces, read_road
from wzsumo.case.watch import quiet_progress
from wzsumo.errors import InputError
from wzsumo.grid import OccupancyGrid

TASKS: list[MapTask] = []


def make(_traces: pd.DataFrame, task: MapTask) -> MadeMap:
    TASKS.append(task)
    return MadeMap(task.cells, {"said": "yes"})


def made(traces: pd.DataFrame, *, resolution_m: float = 0.5, **given: Any) -> tuple[OccupancyGrid, dict[str, Any]]:
    return map_of_traces(
        traces, TracesMethod(name="asks", title="", make=make), source="t.csv", seed=5, resolution_m=resolution_m, before=None,
        progress=quiet_progress, **given,
    )[:2]  # fmt: skip


def test_cells_reach_10_m_beyond_the_traces_on_all_sides() -> None:
    grid, _ = made(straight_traces([0.0, 4.0], length_m=100.0))
    height, width = grid.shape
    assert (width * 0.5, height * 0.5) == pytest.approx((120.0, 24.0), abs=0.5)
    assert list(grid.contains([(-9.9, -9.9), (109.9, 13.9), (-10.6, 0.0), (0.0, -10.6)])) == [True, True, False, False]


def test_vehicles_are_as_wide_as_most_of_them_say_and_else_as_the_toolkits_car() -> None:
    traces = straight_traces([0.0, 1.0, 2.0])
    _, figures = made(traces)
    assert figures == {"vehicle_width_m": 1.86, "said": "yes"}
    widths = traces["vehicle_id"].map({"v000": 1.7, "v001": 2.0, "v002": 2.6})
    _, figures = made(traces.assign(width_m=widths))
    assert figures["vehicle_width_m"] == 2.0
    assert (TASKS[-1].half_width_m, TASKS[-1].seed) == (1.0, 5)


@pytest.mark.parametrize(("length_m", "refused"), [(9_980, False), (10_030, True)])
def test_traces_that_need_more_than_100_million_cells_are_refused_with_a_resolution_that_does(
    monkeypatch: pytest.MonkeyPatch, length_m: float, refused: bool
) -> None:
    """With 10 m on all sides the area is (length + 20) m by 1,000 m, at 0.316 m some 100 million cells."""
    monkeypatch.setattr("wzsumo.case.traces_map.blank_grid", lambda *_, **__: None)
    traces = pd.DataFrame({"vehicle_id": "a", "time_s": [0.0, 1.0], "x_m": [0.0, float(length_m)], "y_m": [0.0, 980.0]})
    refusal = pytest.raises(InputError, match=r"t\.csv: .* more than 100 million cells; .* give a resolution of 0\.32 m")
    with refusal if refused else nullcontext():
        made(traces, resolution_m=float(np.sqrt(0.1 * (1 + 1e-6))))


ROAD_FILE = """
[road]
lane_count = 2
left_shoulder_ft = 10
right_shoulder_ft = 10
length_ft = 5000
[announced]
start_ft = 1000
end_ft = 3000
"""


def test_road_before_is_that_of_its_file_and_none_without_one(tmp_path: Path) -> None:
    traces = straight_traces([1.8, 5.4], length_m=1000.0)
    path = tmp_path / "road.toml"
    path.write_text(ROAD_FILE)
    before = read_road(path, traces, source="t.csv")
    assert before is not None
    assert (before.start, before.end) == pytest.approx((304.8, 914.4))
    assert before.road.length == pytest.approx(1524.0)
    assert read_road(None, traces, source="t.csv") is None


def test_traces_beside_their_road_are_refused_by_the_names_of_both_files(tmp_path: Path) -> None:
    path = tmp_path / "road.toml"
    path.write_text(ROAD_FILE)
    with pytest.raises(InputError, match=r"t\.csv: 0 of \d+ fixes lie on the road of .*road\.toml"):
        read_road(path, straight_traces([100.0, 104.0], length_m=1000.0), source="t.csv")
