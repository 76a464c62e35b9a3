"""One drive as many files have it: two vehicles that drive straight on, and what is read of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pyproj import Geod, Transformer

from wzsumo.files.fixes.fixes import Fixes
from wzsumo.files.traces import read_fixes

LON, LAT = -83.74, 42.28
START = pd.Timestamp("2026-06-01T14:00:00Z")


def drive(n: int = 40, speed_mps: float = 25.0, azimuth_deg: float = 60.0) -> pd.DataFrame:
    """Two vehicles that drive straight on at one speed, a fix a second, with geodesic positions."""
    tables = []
    for number in range(2):
        second = np.arange(n) + 5.0 * number
        lon, lat, _ = Geod(ellps="WGS84").fwd(
            np.full(n, LON), np.full(n, LAT), np.full(n, azimuth_deg), speed_mps * np.arange(n) + number
        )
        tables.append(pd.DataFrame({"id": f"v{number}", "second": second, "lon": lon, "lat": lat, "v": speed_mps}))
    return pd.concat(tables, ignore_index=True)


def iso(table: pd.DataFrame) -> "pd.Series[str]":
    return (START + pd.to_timedelta(table["second"], unit="s")).dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ")


DRIVE = drive()


def read(path: Path, table: pd.DataFrame, **how: Any) -> Fixes:
    table.to_csv(path, index=False)
    return read_fixes([path], **how)


def assert_is_the_drive(fixes: Fixes, *, speed: bool = True, time_from: float = START.timestamp()) -> None:
    assert fixes.frame is not None
    back = fixes.frame.to_lonlat(fixes.table[["x_m", "y_m"]])
    assert np.abs(back - DRIVE[["lon", "lat"]].to_numpy()).max() < 1e-7  # 1 cm
    assert fixes.table["time_s"].to_numpy(float) - time_from == pytest.approx(DRIVE["second"].to_numpy(), abs=1e-3)
    step = np.hypot(*np.diff(fixes.table[["x_m", "y_m"]].to_numpy(float)[:40], axis=0).T)
    assert step == pytest.approx(25.0, abs=0.02)  # degrees of 1e-7 are 1 cm
    if speed:
        assert fixes.table["speed_mps"].to_numpy(float) == pytest.approx(25.0, rel=0.01)


def provider(table: pd.DataFrame) -> pd.DataFrame:
    return pd.DataFrame(
        {"journeyId": table["id"], "capturedTimestamp": iso(table), "latitude": table["lat"], "longitude": table["lon"],
         "speed": 3.6 * table["v"], "heading": 60.0}
    )  # fmt: skip


def bsm(table: pd.DataFrame) -> pd.DataFrame:
    return pd.DataFrame(
        {"coreData_id": table["id"], "metadata_recordGeneratedAt": iso(table),
         "coreData_position_lat": (1e7 * table["lat"]).round().astype("int64"),
         "coreData_position_long": (1e7 * table["lon"]).round().astype("int64"), "coreData_speed_mps": table["v"]}
    )  # fmt: skip


def receiver(table: pd.DataFrame) -> pd.DataFrame:
    semicircles = 2**31 / 180
    return pd.DataFrame(
        {"DeviceID": table["id"], "Timestamp_ms": ((START.timestamp() + table["second"]) * 1000).astype("int64"),
         "LAT": (semicircles * table["lat"]).round(), "LON": (semicircles * table["lon"]).round(),
         "speed(mph)": table["v"] / 0.44704}
    )  # fmt: skip


def microseconds(table: pd.DataFrame) -> pd.DataFrame:
    time = ((START.timestamp() + table["second"]) * 1e6).astype("int64")
    return pd.DataFrame({"trip_id": table["id"], "ts": time, "lat": table["lat"], "lng": table["lon"], "speed": table["v"]})


def metres(table: pd.DataFrame, crs: str | None = None, factor: float = 1.0) -> pd.DataFrame:
    """The drive in plane coordinates, of a CRS or of a frame without a place."""
    to = Transformer.from_crs("EPSG:4326", crs or "EPSG:32617", always_xy=True)
    x, y = to.transform(table["lon"], table["lat"])
    x, y = (x, y) if crs else (x - 270_000, y - 4_680_000)
    return pd.DataFrame({"vehicle_id": table["id"], "time_s": table["second"], "x_m": factor * x, "y_m": factor * y})
