"""Files as they are shipped: the same drive in many dialects comes out the same, and what cannot be is refused."""

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pyproj import Geod, Transformer

from wzsumo.errors import InputError
from wzsumo.files.fixes.fixes import Fixes
from wzsumo.files.traces import fixes_from, read_fixes

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


@pytest.mark.parametrize("dialect", [provider, bsm, receiver, microseconds])
def test_dialects_of_one_drive_give_the_same_fixes(tmp_path: Path, dialect: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    assert_is_the_drive(read(tmp_path / "a.csv", dialect(DRIVE)))


def test_separators_compression_folders_and_parquet_give_the_same_fixes(tmp_path: Path) -> None:
    table = provider(DRIVE)
    table.to_csv(tmp_path / "semicolon.csv", index=False, sep=";", decimal=",")
    (tmp_path / "tab.TSV.gz").write_bytes(gzip.compress(table.to_csv(index=False, sep="\t").encode()))
    parts = tmp_path / "parts"
    (parts / "day=1").mkdir(parents=True)
    table.iloc[:25].to_parquet(parts / "day=1" / "part-0.parquet")
    table.iloc[25:].to_parquet(parts / "day=1" / "part-1.parquet")
    (parts / "_SUCCESS").write_text("")
    for path in (tmp_path / "semicolon.csv", tmp_path / "tab.TSV.gz", parts):
        assert_is_the_drive(read_fixes([path]))


def test_points_in_one_column_of_text_or_of_geoarrow_are_read(tmp_path: Path) -> None:
    import geopandas
    import shapely

    plain = provider(DRIVE).drop(columns=["latitude", "longitude"])
    points = np.array([shapely.Point(lon, lat) for lon, lat in DRIVE[["lon", "lat"]].to_numpy()])
    texts: dict[str, Any] = {
        "geom": shapely.to_wkt(points, rounding_precision=-1),
        "wkt": [f"SRID=4326;{point.wkt}" for point in points],
        "the_geom": shapely.to_wkb(points, hex=True),
    }
    for name, text in texts.items():
        assert_is_the_drive(read(tmp_path / f"{name}.csv", plain.assign(**{name: text})))
    table = geopandas.GeoDataFrame(plain, geometry=points, crs="EPSG:4326")
    table.to_parquet(tmp_path / "a.parquet", geometry_encoding="geoarrow")
    assert_is_the_drive(read_fixes([tmp_path / "a.parquet"]))
    table.to_crs("EPSG:32617").to_parquet(tmp_path / "b.parquet")
    frame = read_fixes([tmp_path / "b.parquet"]).frame
    assert frame is not None
    assert frame.crs == "EPSG:32617"  # not its definition of a page
    lost = read(tmp_path / "c.csv", plain.assign(wkt=["POINT EMPTY", "", *texts["geom"][2:]]))
    assert np.isfinite(lost.table["x_m"]).tolist()[:3] == [False, False, True]


def test_text_in_utf_16_is_read_and_other_encodings_are_told(tmp_path: Path) -> None:
    table = provider(DRIVE).assign(street="Stra\u00dfe")
    table.to_csv(tmp_path / "a.csv", index=False, encoding="utf-16")
    assert_is_the_drive(read_fixes([tmp_path / "a.csv"]))
    table.to_csv(tmp_path / "b.csv", index=False, encoding="latin-1")
    with pytest.raises(InputError, match="neither UTF-8 nor UTF-16; save it as UTF-8"):
        read_fixes([tmp_path / "b.csv"])


def test_date_beside_a_time_of_day_is_used(tmp_path: Path) -> None:
    stamps = pd.to_datetime(iso(DRIVE))
    table = provider(DRIVE).drop(columns="capturedTimestamp")
    table = table.assign(Date=stamps.dt.strftime("%m/%d/%Y"), Time=stamps.dt.strftime("%H:%M:%S"))
    assert_is_the_drive(read(tmp_path / "a.csv", table))


def test_dates_of_no_known_form_are_refused_with_the_remedy(tmp_path: Path) -> None:
    table = provider(DRIVE).assign(capturedTimestamp="the first of June")
    with pytest.raises(InputError, match="'the first of June': neither seconds nor a date of a known form; give ISO 8601"):
        read(tmp_path / "a.csv", table)


@pytest.mark.parametrize(("decimals", "step"), [(5, "1.1 m"), (4, "11 m"), (6, None), (None, "0.85 m")])
def test_coordinates_that_were_rounded_coarsely_are_told(tmp_path: Path, decimals: int | None, step: str | None) -> None:
    table = provider(DRIVE)
    places = table[["latitude", "longitude"]]
    rounded = places.astype("float32").astype(float) if decimals is None else places.round(decimals)
    fixes = read(tmp_path / "a.csv", table.assign(**rounded).drop(columns="speed"))
    told = [word for word in fixes.doubts if "are rounded to steps of" in word]
    assert [word.split("steps of ")[1].split(":")[0] for word in told] == ([step] if step else [])


def test_compass_headings_become_radians_and_wrong_ones_are_left_out_and_said(tmp_path: Path) -> None:
    fixes = read(tmp_path / "a.csv", provider(DRIVE))
    assert fixes.table["heading_rad"].to_numpy() == pytest.approx(np.deg2rad(30.0), abs=1e-3)
    wrong = read(tmp_path / "b.csv", provider(DRIVE).assign(heading=300.0))
    assert "heading_rad" not in wrong.table
    assert any("heading is off the way that is driven by a median of 120 degrees" in word for word in wrong.doubts)


def test_hdop_and_accuracy_become_standard_deviations(tmp_path: Path) -> None:
    hdop = read(tmp_path / "a.csv", provider(DRIVE).assign(HDOP=0.8)).table["position_sd_m"]
    radius = read(tmp_path / "b.csv", provider(DRIVE).assign(accuracy=4.5)).table["position_sd_m"]
    assert hdop.to_numpy() == pytest.approx(0.8 * 4 / np.sqrt(2))
    assert radius.to_numpy() == pytest.approx(4.5 / np.sqrt(-2 * np.log(0.32)), rel=0.01)


def test_sumo_fcd_in_xml_and_as_a_table_gives_centres_of_vehicles(tmp_path: Path) -> None:
    vehicle = '<vehicle id="a" x="{x}" y="5.0" angle="90.0" speed="20" type="car" lane="E_0"/>'
    steps = [f'<timestep time="{t}.00">{vehicle.format(x=100 + 20 * t)}</timestep>' for t in range(20)]
    (tmp_path / "fcd.xml").write_text(f"<fcd-export>{''.join(steps)}</fcd-export>")
    (tmp_path / "fcd.xml.gz").write_bytes(gzip.compress((tmp_path / "fcd.xml").read_bytes()))
    table = pd.DataFrame(
        {"timestep_time": np.arange(20.0), "vehicle_id": "a", "vehicle_x": 100 + 20.0 * np.arange(20), "vehicle_y": 5.0,
         "vehicle_angle": 90.0, "vehicle_speed": 20.0, "vehicle_length": 12.0}
    )  # fmt: skip
    table.to_csv(tmp_path / "fcd.csv", sep=";", index=False)
    for name, back in (("fcd.xml", 2.5), ("fcd.xml.gz", 2.5), ("fcd.csv", 6.0)):
        fixes = read_fixes([tmp_path / name]).table
        assert fixes["x_m"].to_numpy() == pytest.approx(100 - back + 20.0 * np.arange(20))
        assert fixes["heading_rad"].to_numpy() == pytest.approx(0.0)
        assert fixes["vehicle_id"].unique().tolist() == ["a"]


def test_sumo_angles_of_a_grid_are_turned_to_the_way_that_is_driven(tmp_path: Path) -> None:
    grid_angle = 60.0 + 1.86  # of UTM zone 17 at its western side, where grid north lies 1.86 degrees west of true north
    table = pd.DataFrame(
        {"timestep_time": DRIVE["second"], "vehicle_id": DRIVE["id"], "vehicle_x": DRIVE["lon"], "vehicle_y": DRIVE["lat"],
         "vehicle_angle": grid_angle, "vehicle_speed": 25.0}
    )  # fmt: skip
    fixes = read(tmp_path / "fcd.csv", table)
    assert fixes.table["heading_rad"].to_numpy() == pytest.approx(np.deg2rad(30.0), abs=2e-4)
    assert any("angles are of its network's grid: turned by 1.86 degrees" in word for word in fixes.said)
    assert fixes.frame is not None
    lon, lat = fixes.frame.to_lonlat(fixes.table[["x_m", "y_m"]]).T
    back = Geod(ellps="WGS84").inv(lon, lat, DRIVE["lon"].to_numpy(), DRIVE["lat"].to_numpy())
    assert back[2] == pytest.approx(2.5, abs=0.01)
    assert back[0] == pytest.approx(60.0, abs=0.1)  # straight behind the bumper


def test_sumo_steps_without_vehicles_are_no_fixes_and_missing_angles_are_told(tmp_path: Path) -> None:
    steps = np.arange(20.0)
    table = pd.DataFrame(
        {"timestep_time": steps, "vehicle_id": "a", "vehicle_x": 100 + 20 * steps, "vehicle_y": 5.0, "vehicle_speed": 20.0}
    )
    empty = pd.DataFrame({"timestep_time": [20.0, 21.0]})
    fixes = read(tmp_path / "fcd.csv", pd.concat([table, empty]))
    assert len(fixes.table) == 20
    assert fixes.table["x_m"].to_numpy() == pytest.approx(100 + 20 * steps)
    assert any("without angles SUMO's points stay at the front bumper" in word for word in fixes.doubts)


def test_gpx_tracks_are_drives(tmp_path: Path) -> None:
    points = "".join(
        f'<trkpt lat="{row.lat}" lon="{row.lon}"><ele>250</ele><time>{time}</time><hdop>1.2</hdop></trkpt>'
        for row, time in zip(DRIVE[:40].itertuples(), iso(DRIVE[:40]), strict=True)
    )
    (tmp_path / "ride.gpx").write_text(
        f'<gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>{points}</trkseg><trkseg>{points}</trkseg></trk></gpx>'
    )
    fixes = read_fixes([tmp_path / "ride.gpx"])
    assert fixes.table["vehicle_id"].unique().tolist() == ["ride#1", "ride#2"]
    assert any("elevation is not used" in word for word in fixes.said)
    assert fixes.frame is not None
    assert np.abs(fixes.frame.to_lonlat(fixes.table[["x_m", "y_m"]])[:40] - DRIVE[["lon", "lat"]][:40].to_numpy()).max() < 1e-7


def test_file_without_ids_is_one_drive_if_its_clock_never_runs_back(tmp_path: Path) -> None:
    table = provider(DRIVE[:40]).drop(columns="journeyId")
    fixes = read(tmp_path / "monday.csv", table)
    assert fixes.table["vehicle_id"].unique().tolist() == ["monday"]
    with pytest.raises(InputError, match="no column for vehicle_id"):
        read(tmp_path / "all.csv", provider(DRIVE).drop(columns="journeyId"))


def test_tables_from_python_are_taken_whatever_their_library(tmp_path: Path) -> None:
    import geopandas
    import pyarrow as pa

    table = provider(DRIVE)
    plain = table.drop(columns=["latitude", "longitude"])
    geo = geopandas.GeoDataFrame(plain, geometry=geopandas.points_from_xy(DRIVE["lon"], DRIVE["lat"]), crs="EPSG:4326")
    features = json.loads(geo.to_json())
    utm = geo.to_crs("EPSG:32617")
    geo.to_parquet(tmp_path / "geo.parquet")
    for given in (table, pa.Table.from_pandas(table), geo, features):
        assert_is_the_drive(fixes_from(given))
    assert_is_the_drive(read_fixes([tmp_path / "geo.parquet"]))
    in_utm = fixes_from(utm)
    assert in_utm.frame is not None
    assert in_utm.frame.crs == "EPSG:32617"
    assert np.abs(in_utm.frame.to_lonlat(in_utm.table[["x_m", "y_m"]]) - DRIVE[["lon", "lat"]].to_numpy()).max() < 1e-7


def metres(table: pd.DataFrame, crs: str | None = None, factor: float = 1.0) -> pd.DataFrame:
    """The drive in plane coordinates, of a CRS or of a frame without a place."""
    to = Transformer.from_crs("EPSG:4326", crs or "EPSG:32617", always_xy=True)
    x, y = to.transform(table["lon"], table["lat"])
    x, y = (x, y) if crs else (x - 270_000, y - 4_680_000)
    return pd.DataFrame({"vehicle_id": table["id"], "time_s": table["second"], "x_m": factor * x, "y_m": factor * y})


def test_ordinary_metres_come_back_as_they_are(tmp_path: Path) -> None:
    table = metres(DRIVE).assign(heading_rad=0.5, speed_mps=25.0, length_m=4.5, width_m=1.8)
    fixes = read(tmp_path / "a.csv", table)
    assert fixes.frame is None
    assert (fixes.said, fixes.doubts) == ((), ())
    pd.testing.assert_frame_equal(fixes.table[table.columns], table)


def test_coordinates_of_a_crs_get_their_place(tmp_path: Path) -> None:
    fixes = read(tmp_path / "a.csv", metres(DRIVE, "EPSG:3857"), crs="EPSG:3857")
    assert_is_the_drive(fixes, speed=False, time_from=0.0)


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
