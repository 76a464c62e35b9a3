"""Four drives of a real receiver through a real work zone (tests/data/prairie_center), as their tool wrote them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from wzsumo.files.traces import read_fixes

DRIVES = Path(__file__).parents[2] / "data" / "prairie_center"


def test_drives_are_read_with_their_times_speeds_and_accuracy() -> None:
    fixes = read_fixes([DRIVES])
    table = fixes.table
    assert fixes.frame is not None
    assert table["vehicle_id"].value_counts().to_dict() == {"drive_1": 980, "drive_2": 1003, "drive_3": 961, "drive_4": 976}
    assert pd.to_datetime(table["time_s"].min(), unit="s").isoformat(timespec="seconds") == "2020-06-11T18:10:32"
    for _, drive in table.groupby("vehicle_id"):
        xy, t = drive[["x_m", "y_m"]].to_numpy(), drive["time_s"].to_numpy()
        assert np.diff(t) == pytest.approx(0.1, abs=1.01)  # 10 Hz, with gaps of up to a second
        driven = np.hypot(*np.diff(xy, axis=0).T).sum()
        said = np.trapezoid(drive["speed_mps"], t)
        assert driven == pytest.approx(said, rel=0.02)  # the receiver's own speed
        way = np.unwrap(np.arctan2(*(xy[50:] - xy[:-50]).T[::-1]))
        assert np.median(np.abs(np.angle(np.exp(1j * (way - drive["heading_rad"].to_numpy()[25:-25]))))) < 0.05
    assert table["position_sd_m"].between(1.5, 5.0).all()


def test_drivers_marked_the_closed_lane_at_the_same_places() -> None:
    fixes = read_fixes([DRIVES])
    assert fixes.frame is not None
    for marker, spread_m in (("LC", 12.0), ("LO", 8.0)):
        drives = pd.concat([pd.read_csv(path) for path in sorted(DRIVES.glob("*.csv.gz"))])
        rows = drives[drives["Marker"] == marker]
        xy = fixes.frame.from_lonlat(rows[["Longitude", "Latitude"]].to_numpy())
        assert len(xy) == 4
        assert np.hypot(*(xy - xy.mean(axis=0)).T).max() < spread_m
