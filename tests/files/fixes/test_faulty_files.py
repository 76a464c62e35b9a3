"""What cannot be in a file is refused with its remedy, or left out and told."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from files.fixes.drives import DRIVE, assert_is_the_drive, drive, metres, provider, read, receiver

from wzsumo.errors import InputError
from wzsumo.files.traces import read_fixes

SWAP = {"latitude": "longitude", "longitude": "latitude"}
REFUSED = {
    "feet": (metres(DRIVE, factor=1 / 0.3048), ["82 m/s", "in feet at 25 m/s", "x_ft=x_m y_ft=y_m"]),
    "feet by reported speeds": (
        metres(drive(speed_mps=10.0), factor=1 / 0.3048).assign(speed_mps=10.0), ["3.28 times as fast", "feet"]
    ),
    "feet in a CRS of metres": (
        metres(DRIVE, "EPSG:32617", factor=1 / 0.3048), ["in feet at 25 m/s", "see whether --crs EPSG:32617 is theirs"]
    ),
    "Web Mercator": (metres(DRIVE, "EPSG:3857"), ["Web Mercator", "--crs EPSG:3857"]),
    "milliseconds from 0": (
        metres(DRIVE).assign(time_s=lambda t: 1000 * t["time_s"]), ["0.025 m/s", "milliseconds", "time_ms=NAME"]
    ),
    "degrees": (metres(DRIVE).assign(x_m=DRIVE["lon"], y_m=DRIVE["lat"]), ["longitude and latitude", "lon=x_m lat=y_m"]),
    "exchanged": (provider(DRIVE).rename(columns=SWAP), ["seem exchanged", "-83.7"]),
    "exchanged, by speeds": (
        provider(drive(azimuth_deg=90.0)).assign(latitude=11.0 + DRIVE["lon"] + 83.74, longitude=48.0 + DRIVE["lat"] - 42.28)
        .rename(columns={"speed": "speed_kmh"}).assign(speed_kmh=90.0 * 0.98),
        ["seem exchanged", "times as fast as they report"],
    ),
    "semicircles or e7": (receiver(DRIVE).drop(columns="speed(mph)"), ["no degrees", "lat_e7=LAT", "lat_semicircles=LAT"]),
    "semicircles or e7, exchanged": (
        receiver(DRIVE).drop(columns="speed(mph)").rename(columns={"LAT": "LON", "LON": "LAT"}),
        ["no degrees", "lat_e7=LON lon_e7=LAT", "lat_semicircles=LON lon_semicircles=LAT"],
    ),
    "no widths": (metres(DRIVE).assign(width_m=0.0), ["width_m of row 0 is 0", "80 of 80 rows"]),
    "widths in centimetres": (metres(DRIVE).assign(width_m=180.0), ["median of width_m is 180", "width_cm=width_m"]),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSED)
def test_what_cannot_be_is_refused_with_the_remedy(tmp_path: Path, fault: str) -> None:
    table, said = REFUSED[fault]
    with pytest.raises(InputError) as refused:
        read(tmp_path / "a.csv", table, crs="EPSG:32617" if "CRS" in fault else None)
    message = str(refused.value)
    assert message.startswith(str(tmp_path / "a.csv"))
    assert "\n" not in message
    assert [word for word in said if word not in message] == [], message


def test_remedies_that_messages_name_help(tmp_path: Path) -> None:
    feet = read(tmp_path / "a.csv", metres(DRIVE, factor=1 / 0.3048), columns={"x_ft": "x_m", "y_ft": "y_m"}).table
    assert feet[["x_m", "y_m"]].to_numpy() == pytest.approx(metres(DRIVE)[["x_m", "y_m"]].to_numpy())
    late = metres(DRIVE).assign(time_s=lambda t: 1000 * t["time_s"])
    assert read(tmp_path / "b.csv", late, columns={"time_ms": "time_s"}).table["time_s"].max() == pytest.approx(44.0)
    swapped = provider(DRIVE).rename(columns=SWAP)
    assert_is_the_drive(read(tmp_path / "c.csv", swapped, columns={"lat": "longitude", "lon": "latitude"}))


def test_separator_at_the_end_of_each_row_moves_no_column(tmp_path: Path) -> None:
    lines = metres(DRIVE).assign(vehicle_id="007").to_csv(index=False).splitlines()
    (tmp_path / "a.csv").write_text("\n".join([lines[0], *(f"{line}," for line in lines[1:])]))
    found = read_fixes([tmp_path / "a.csv"]).table
    assert set(found["vehicle_id"]) == {"007"}
    assert found["x_m"].to_numpy() == pytest.approx(metres(DRIVE)["x_m"].to_numpy())


def test_rows_of_more_values_than_names_are_refused(tmp_path: Path) -> None:
    rows = [f"v1,{n},{20 * n},25,3,60" for n in range(30)]  # x_m and y_m with decimal commas
    (tmp_path / "a.csv").write_text("\n".join(["vehicle_id,time_s,x_m,y_m", *rows]))
    with pytest.raises(InputError, match=r"a\.csv.*its rows hold more values than the header has names"):
        read_fixes([tmp_path / "a.csv"])


@pytest.mark.parametrize(
    ("ids", "doubted"), [((" 1", "1 "), True), (("1", "1 "), True), ((" 1", " 2"), False), ((" 7", "12"), False)]
)
def test_ids_that_differ_in_spaces_alone_are_doubted(tmp_path: Path, ids: tuple[str, str], doubted: bool) -> None:
    drives = [metres(DRIVE).assign(vehicle_id=each) for each in ids]
    drives[1]["time_s"] += 900
    found = read(tmp_path / "a.csv", pd.concat(drives))
    assert any("differ from others in spaces alone" in doubt for doubt in found.doubts) == doubted
    assert found.table["vehicle_id"].nunique() == (1 if doubted else 2)


def test_files_of_different_kinds_or_crs_are_refused_together(tmp_path: Path) -> None:
    import geopandas

    provider(DRIVE).to_csv(tmp_path / "a.csv", index=False)
    metres(DRIVE).to_csv(tmp_path / "b.csv", index=False)
    points = geopandas.points_from_xy(DRIVE["lon"], DRIVE["lat"])
    geo = geopandas.GeoDataFrame(provider(DRIVE)[["journeyId", "capturedTimestamp"]], geometry=points, crs="EPSG:4326")
    geo.to_parquet(tmp_path / "c.parquet")
    geo.to_crs("EPSG:32617").to_parquet(tmp_path / "d.parquet")
    for pair, said in ((("b.csv", "a.csv"), "files of one kind"), (("c.parquet", "d.parquet"), "share one")):
        with pytest.raises(InputError, match=said):
            read_fixes([tmp_path / name for name in pair])


def test_points_of_the_bumper_are_moved_back_along_the_heading(tmp_path: Path) -> None:
    north = pd.DataFrame(
        {"timestep_time": np.arange(20.0), "vehicle_id": "a", "vehicle_x": 7.0, "vehicle_y": 20.0 * np.arange(20),
         "vehicle_angle": 0.0}
    )  # fmt: skip
    fixes = read(tmp_path / "fcd.csv", north).table
    assert fixes["x_m"].to_numpy() == pytest.approx(7.0)
    assert fixes["y_m"].to_numpy() == pytest.approx(20.0 * np.arange(20) - 2.5)


def test_a_value_that_is_no_number_stays_to_be_named(tmp_path: Path) -> None:
    table = metres(DRIVE).astype({"x_m": object})
    table.loc[3, "x_m"] = "here"
    assert read(tmp_path / "a.csv", table).table["x_m"].iloc[3] == "here"
    with pytest.raises(InputError, match="longitude of row 0 is 'east'"):
        read(tmp_path / "b.csv", provider(DRIVE).assign(longitude="east"))
    with pytest.raises(InputError, match=r"x_m.* in m and ft: give both"):
        read(tmp_path / "c.csv", metres(DRIVE), columns={"y_ft": "y_m"})


@pytest.mark.parametrize("value", ["unknown", "1,9 m", "inf", "1e6"])
def test_sizes_that_are_none_are_left_out_and_counted(tmp_path: Path, value: str) -> None:
    fixes = read(tmp_path / "a.csv", metres(DRIVE).assign(width_m=["1.9"] * 79 + [value]))
    assert fixes.table["width_m"].iloc[-2:].to_list() == [1.9, pytest.approx(np.nan, nan_ok=True)]
    assert "width_m is no width of 0.3 to 5 m in 1 of 80 rows, and is not used there" in fixes.doubts
    everywhere = read(tmp_path / "b.csv", metres(DRIVE).assign(width_m="unknown"))
    assert any("in 80 of 80 rows" in word for word in everywhere.doubts)


def test_small_vehicles_and_empty_sizes_are_no_fault(tmp_path: Path) -> None:
    fixes = read(tmp_path / "a.csv", metres(DRIVE).assign(width_m=[0.8, np.nan] * 40)).table
    assert fixes["width_m"].iloc[:2].to_list() == [0.8, pytest.approx(np.nan, nan_ok=True)]
