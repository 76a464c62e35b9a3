import pytest

from wzsumo.errors import TraceError
from wzsumo.files.fixes.dialects import columns_of

HEADERS = {
    "data provider": ("journeyId,capturedTimestamp,latitude,longitude", "journeyId capturedTimestamp latitude longitude"),
    "phone": ("TRIP_ID;TimeStamp;LNG;LAT;accuracy", "TRIP_ID TimeStamp LAT LNG"),
    "CV pilot BSM": (
        "metadata_recordGeneratedAt,coreData_id,coreData_secMark,coreData_position_lat,coreData_position_long,coreData_speed",
        "coreData_id metadata_recordGeneratedAt coreData_position_lat coreData_position_long",
    ),
    "Safety Pilot": ("DevID,EpochT,Gentime,Latitude,Longitude,Elevation,Speed,Heading", "DevID Gentime Latitude Longitude"),
    "work zone tool": (
        "GPS Date & Time,# of Sats,HDOP,Latitude,Longitude,Altitude(m),Speed(m/s),Heading(Deg),Marker,Value",
        "- GPS-Date-&-Time Latitude Longitude",
    ),
}  # fmt: skip


@pytest.mark.parametrize("dialect", HEADERS)
def test_columns_of_each_dialect_are_found(dialect: str) -> None:
    header, expected = HEADERS[dialect]
    found = columns_of(header.replace(";", ",").split(","), chosen={}, source="file")
    names = [found[key].name.replace(" ", "-") if key in found else "-" for key in ("vehicle_id", "time", "lat", "lon")]
    assert names == expected.split()


def test_units_are_read_off_names() -> None:
    names = ["Speed(m/s)", "Heading(Deg)", "time_ms", "x_ft", "Altitude(m)", "width_cm"]
    found = columns_of(names, chosen={}, source="file")
    units = {key: column.unit for key, column in found.items()}
    assert units == {"speed": "m/s", "heading": "deg", "time": "ms", "x": "ft", "elevation": "m", "width": "cm"}


def test_own_names_win_over_others() -> None:
    found = columns_of(["journeyId", "vehicle_id", "timestamp", "time_s", "x", "x_m"], chosen={}, source="file")
    assert [found[key].name for key in ("vehicle_id", "time", "x")] == ["vehicle_id", "time_s", "x_m"]
    assert found["x"].own


def test_chosen_columns_win_and_bring_their_unit() -> None:
    found = columns_of(["a", "stamp", "lat"], chosen={"vehicle_id": "a", "time_ms": "stamp", "lon": "lat"}, source="file")
    assert (found["vehicle_id"].name, found["time"].name, found["time"].unit) == ("a", "stamp", "ms")
    assert (found["lon"].name, "lat" in found) == ("lat", False)


def test_column_is_found_by_the_last_words_of_its_name_where_one_alone_ends_so() -> None:
    names = ["anonymous_vehicle_id", "eventTimestamp", "start_lat", "startLongitude", "segment_id"]
    found = columns_of(names, chosen={}, source="file")
    assert [found[key].name for key in ("vehicle_id", "time", "lat", "lon")] == names[:4]
    assert all(found[key].by_end for key in ("vehicle_id", "time", "lat", "lon"))
    assert columns_of(["trip_id", "event_time_ms", "x", "y"], chosen={}, source="file")["time"].unit == "ms"
    assert "vehicle_id" not in columns_of(["segment_id", "time", "lat", "lon"], chosen={}, source="file")  # no vehicle's
    assert "lat" not in columns_of(["id", "time", "x", "y", "start_lat"], chosen={}, source="file")  # there is a place
    exact = columns_of(["id", "timestamp", "received_timestamp", "lat", "lon"], chosen={}, source="file")
    assert (exact["time"].name, exact["time"].by_end) == ("timestamp", False)


def test_two_columns_that_end_alike_are_asked_for() -> None:
    names = ["id", "time", "start_lat", "start_lon", "end_lat", "end_lon"]
    with pytest.raises(TraceError, match="2 columns may hold lat; say which: --columns lat=start_lat or --columns lat=end_lat"):
        columns_of(names, chosen={}, source="file")
    found = columns_of(names, chosen={"lat": "end_lat", "lon": "end_lon"}, source="file")
    assert (found["lat"].name, found["lon"].name) == ("end_lat", "end_lon")


@pytest.mark.parametrize(
    ("chosen", "said"),
    [({"vehicle_id": "veh"}, "no such column; the file has a, b"), ({"colour": "a"}, "colour is no column of a trace table")],
)
def test_choice_that_cannot_be_is_refused(chosen: dict[str, str], said: str) -> None:
    with pytest.raises(TraceError, match=said):
        columns_of(["a", "b"], chosen=chosen, source="file")
