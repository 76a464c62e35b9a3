"""Files as they are shipped: the same drive in many dialects comes out the same."""

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from files.fixes.drives import (
    DRIVE,
    assert_is_the_drive,
    bsm,
    iso,
    metres,
    microseconds,
    provider,
    read,
    receiver,
)
from pyproj import Geod

from wzsumo.errors import InputError
from wzsumo.files.traces import fixes_from, read_fixes


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


def test_ordinary_metres_come_back_as_they_are(tmp_path: Path) -> None:
    table = metres(DRIVE).assign(heading_rad=0.5, speed_mps=25.0, length_m=4.5, width_m=1.8)
    fixes = read(tmp_path / "a.csv", table)
    assert fixes.frame is None
    assert (fixes.said, fixes.doubts) == ((), ())
    pd.testing.assert_frame_equal(fixes.table[table.columns], table)


def test_coordinates_of_a_crs_get_their_place(tmp_path: Path) -> None:
    fixes = read(tmp_path / "a.csv", metres(DRIVE, "EPSG:3857"), crs="EPSG:3857")
    assert_is_the_drive(fixes, speed=False, time_from=0.0)
