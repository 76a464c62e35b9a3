import numpy as np
import pandas as pd
import pytest

from wzsumo.crowd_mapping.cleaning.usable_traces import usable_traces
from wzsumo.errors import TraceError


def fleet(n: int, *, x_m: float = 0.0, y_m: float = 0.0, name: str = "v", length_m: float = 390.0) -> pd.DataFrame:
    """n vehicles one after the other along +x from x_m on, at 20 m/s and 2 Hz, a few centimetres apart."""
    x = np.arange(0.0, length_m, 10.0)
    parts = [
        pd.DataFrame({"vehicle_id": f"{name}{i}", "time_s": 5.0 * i + x / 20, "x_m": x_m + x, "y_m": y_m + 0.03 * i})
        for i in range(n)
    ]
    return pd.concat(parts, ignore_index=True)


def reasons(*tables: pd.DataFrame) -> dict[str, str]:
    dropped = usable_traces(pd.concat(tables, ignore_index=True), source="file").dropped
    return {str(vehicle): str(reason) for vehicle, reason in zip(dropped["vehicle_id"], dropped["reason"], strict=True)}


@pytest.mark.parametrize(("start_m", "apart"), [(600.0, False), (700.0, True)])
def test_place_ends_where_300_m_hold_no_fix(start_m: float, apart: bool) -> None:
    # Vehicles on 0..380 m are in squares of 100 m that begin at 0..300 m: one that begins at 600 m is near, at 700 m it is not.
    said = reasons(fleet(6), fleet(1, x_m=start_m, name="w"))
    assert ("away from the others" in said.get("w0", "")) == apart


def test_vehicle_that_drives_between_two_places_joins_them() -> None:
    far, link = fleet(1, x_m=900.0, name="w"), fleet(1, name="l", length_m=1300.0)
    assert "w0" in reasons(fleet(6), far)
    assert reasons(fleet(6), far, link) == {}


@pytest.mark.parametrize(("n_here", "n_there", "refused"), [(10, 2, True), (11, 2, False), (3, 1, False)])
def test_second_place_with_a_fifth_of_the_traces_and_two_of_them_is_a_zone_of_its_own(
    n_here: int, n_there: int, refused: bool
) -> None:
    tables = (fleet(n_here), fleet(n_there, x_m=5000.0, name="w"))
    if refused:
        with pytest.raises(TraceError, match=f"2 places up to 5.0 km apart, {n_here} around .* and {n_there} around"):
            reasons(*tables)
    else:
        assert reasons(*tables) == dict.fromkeys((f"w{i}" for i in range(n_there)), "lies 5000 m away from the others")


def test_traces_that_do_not_fit_the_others_are_left_out_with_their_fixes_counted() -> None:
    made = usable_traces(pd.concat([fleet(6), fleet(1, y_m=40.0, name="w")]), source="file")
    assert made.dropped.to_dict("records") == [{"vehicle_id": "w0", "n_fixes": 39, "reason": "lies 40 m beside the others"}]
    assert made.traces["vehicle_id"].nunique() == 6


def test_fault_of_the_traces_names_the_file() -> None:
    with pytest.raises(TraceError, match=r"^file: .*at least 50 m"):
        reasons(fleet(2, length_m=45.0))
