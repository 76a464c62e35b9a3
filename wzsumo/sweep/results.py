"""The result table of a study, one row per case: its columns, writing and reading."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from wzsumo.errors import InputError, reading
from wzsumo.files.output import parquet_bytes, write_whole
from wzsumo.sweep.evaluation.study_case import StudyCase

RESULTS = "results.parquet"


@dataclass(frozen=True, kw_only=True)
class Column:
    """Type, unit ("" where there is none) and meaning of a column."""

    type: pa.DataType
    unit: str
    meaning: str


def _text(meaning: str) -> Column:
    return Column(type=pa.string(), unit="", meaning=meaning)


def _count(meaning: str) -> Column:
    return Column(type=pa.int64(), unit="1", meaning=meaning)


def _number(unit: str, meaning: str) -> Column:
    return Column(type=pa.float64(), unit=unit, meaning=meaning)


_CHANGE = "with the zone less without it, same seed"
CASE_COLUMNS = {
    "case": _text("name of the case, a hash of everything that decides its result; `wzsumo run DIR --case NAME` runs it alone"),
    "simulation": _text("name of the simulation of the fleet; cases of one simulation are paired"),
    "scenario": _text("name of the base scenario"),
    "method": _text("map method"),
    "seed": _count("seed of the case, which decides its simulation too"),
}
MEASURED_COLUMNS = {
    "status": _text("DONE, REFUSED (the case is impossible, see reason) or FAILED (its task failed twice, see reason)"),
    "reason": _text("why the case was refused or failed, found no path or ended short of the goal; else empty"),
    "outcome": _text("how the drive ended; NO_PATH where no path was found; empty where the study does not drive"),
    "clean": Column(
        type=pa.bool_(),
        unit="",
        meaning="the drive reached its goal within all limits of conduct; empty where the study does not drive",
    ),
    "faults": _text("what keeps the drive from being clean, each with its figure and limit; else empty"),
    "plan_status": _text("how planning ended"),
    "safe_plan": Column(
        type=pa.bool_(),
        unit="",
        meaning="a path was found on which the outline touches no device, no pavement edge and not the closed area",
    ),
    "precision": _number("1", "share of the free cells that is drivable"),
    "recall": _number("1", "share of the drivable cells that is free"),
    "iou": _number("1", "intersection over union of the free and the drivable cells"),
    "n_fragments": _count("connected pieces of the free area"),
    "planned_min_clearance_devices_m": _number(
        "m", "planned path: smallest distance from the ego's outline to a device's outline"
    ),
    "planned_min_clearance_road_edge_m": _number(
        "m", "planned path: smallest distance from the ego's outline to an edge of the pavement"
    ),
    "planned_closed_area_share": _number("1", "planned path: share of its length in the closed area"),
    "driven_min_clearance_devices_m": _number(
        "m", "driven path: smallest distance from the ego's outline to a device's outline"
    ),
    "driven_min_clearance_road_edge_m": _number(
        "m", "driven path: smallest distance from the ego's outline to an edge of the pavement"
    ),
    "driven_closed_area_share": _number("1", "driven path: share of its length in the closed area"),
    "driven_min_ttc_s": _number("s", "drive: smallest time to collision with any vehicle, in stations and offsets"),
    "driven_max_drac_mps2": _number(
        "m/s2", "drive: largest deceleration rate to avoid a crash, of the ego or of the other vehicle"
    ),
    "driven_min_pet_s": _number("s", "drive: smallest post-encroachment time"),
    "driven_max_braking_mps2": _number("m/s2", "drive: hardest braking of the ego"),
    "driven_max_jerk_mps3": _number("m/s3", "drive: largest jerk along the path"),
    "driven_mean_speed_mps": _number("m/s", "drive: mean speed"),
    "driven_n_unprompted_stops": _count("drive: stops in a live lane without a queue or a stop line ahead"),
    "driven_unprompted_stop_s": _number("s", "drive: how long these stops lasted"),
    "driven_over_comfort_s": _number("s", "drive: time of braking harder than 2 m/s2"),
    "driven_braking_unprompted_mps2": _number("m/s2", "drive: hardest braking that no emergency of another vehicle called for"),
    "driven_braking_behind_mps2": _number("m/s2", "drive: hardest braking of the vehicle right behind the ego"),
    "driven_braking_asked_behind_mps2": _number("m/s2", "drive: hardest braking of that vehicle that the ego asked for"),
    "driven_min_time_gap_s": _number("s", "drive: least time gap behind another that had been ahead for 5 s"),
    "driven_min_ttc_ahead_s": _number("s", "drive: least time to collision with another that had been ahead for 5 s"),
    "driven_max_jerk_1s_mps3": _number("m/s3", "drive: largest change of the acceleration over a second"),
    "driven_over_jerk_s": _number("s", "drive: time of a jerk above ISO 15622's limit at the speed"),
    "driven_over_line_share": _number("1", "drive: share of the zone over a line between two open lanes"),
    "driven_mean_off_middle_m": _number("m", "drive: mean distance from the middle of the lane in the zone"),
    "driven_sd_off_middle_m": _number("m", "drive: standard deviation of the distance from the middle of the lane in the zone"),
    "driven_n_lane_changes": _count("drive: lane changes"),
    "driven_n_needed_changes": _count("drive: fewest lane changes that lead to its last lane"),
    "driven_delay_behind_s": _number(
        "s", "drive: total delay of all vehicles behind the ego, against the same traffic without the ego"
    ),
    "plan_speed_mps": _number(
        "m/s", "speed for which the path's curvature is planned: the planned speed, or a lower one where there is no other path"
    ),
    "n_replans": _count("maps that reached the ego while it drove; it planned again on each"),
    "waited_s": _number("s", "time that the ego waited for room on the road"),
    "drive_time_s": _number("s", "time from entering the road to the end of the drive"),
    "max_cross_track_m": _number("m", "largest distance between the driven and the planned path"),
    "path_length_m": _number("m", "length of the planned path"),
    "plan_risk_m": _number("m", "integral along the planned path of the largest p_occupied under the ego's outline"),
    "n_expansions": _count("states that the search expanded"),
    "n_traces": _count("traces that the map is made of"),
    "n_components": _count("components of the chosen mixture"),
    "n_equipped": _count("equipped vehicles that passed the zone"),
    "minutes_to_collect": _number(
        "min", "time between the first vehicle that leaves the zone and the last equipped vehicle whose trace is used"
    ),
    "slam_ate_m": _number("m", "LiDAR drive: root mean square of the position error"),
    "slam_dead_reckoning_ate_m": _number(
        "m", "LiDAR drive: root mean square of the position error by dead reckoning, without the LiDAR"
    ),
    "slam_n_devices_mapped": _count("LiDAR drive: devices on the map"),
    "slam_n_links": _count("LiDAR drive: gaps between devices that the map closes"),
    "fleet_n_passed": _count("vehicles that passed the zone from end to end"),
    "fleet_mean_speed_activity_mps": _number("m/s", "mean speed of the fleet in the activity area"),
    "fleet_locked_s": _number(
        "s", "time from which a vehicle of the fleet stood and never drove on; empty: the traffic did not lock"
    ),
    "fleet_throughput_vph": _number("veh/h", "flow past the middle of the activity area, after the warm-up and up to a lock"),
    "fleet_mean_delay_s": _number("s", "mean delay of the vehicles that arrived, departure delay included"),
    "fleet_max_queue_length_m": _number("m", "longest queue"),
    "fleet_n_hard_braking": _count("vehicles that braked hard"),
    "network_mean_delay_without_s": _number("s", "network without the zone: mean delay by vehicle, departure delay included"),
    "network_delay_h_change": _number("veh h", f"network: delay of all vehicles together, {_CHANGE}"),
    "network_mean_delay_s_change": _number("s", f"network: mean delay by vehicle, departure delay included, {_CHANGE}"),
    "network_mean_departure_delay_s_change": _number("s", f"network: mean departure delay, {_CHANGE}"),
    "network_mean_travel_time_s_change": _number("s", f"network: mean travel time of those that arrived, {_CHANGE}"),
    "network_co2_kg_change": _number("kg", f"network: carbon dioxide, {_CHANGE}"),
    "network_n_arrived_change": _count(f"network: vehicles that arrived, {_CHANGE}"),
    "network_corridor_delay_h_change": _number("veh h", f"road of the zone in a network: time lost on it, {_CHANGE}"),
    "network_corridor_co2_kg_change": _number("kg", f"road of the zone in a network: carbon dioxide on it, {_CHANGE}"),
}
BATCH_SCHEMA = pa.schema(
    [("case", pa.string()), *((name, column.type) for name, column in MEASURED_COLUMNS.items()), ("case_cpu_s", pa.float64())]
)


def write_results(folder: Path, cases: Sequence[StudyCase], rows: Mapping[str, Mapping[str, Any]]) -> Path:
    """The path of results.parquet, written with a row for each case that `rows` has, in the order of the study."""
    known = [case for case in cases if case.id in rows]
    columns: dict[str, pa.Array] = {
        "case": pa.array([case.id for case in known], pa.string()),
        "simulation": pa.array([case.simulation for case in known], pa.string()),
        "scenario": pa.array([case.scenario.name for case in known], pa.string()),
        "method": pa.array([case.method for case in known], pa.string()),
        "seed": pa.array([case.scenario.seed for case in known], pa.int64()),
    }
    factors = cases[0].factors
    columns |= {name: _factor([case.factors[name] for case in known]) for name in factors if name != "seed"}
    for name, column in MEASURED_COLUMNS.items():
        columns[name] = pa.array([rows[case.id].get(name) for case in known], column.type, from_pandas=True)
    described = CASE_COLUMNS | MEASURED_COLUMNS
    fields = [
        pa.field(name, array.type, metadata=_metadata(described.get(name, _factor_column(name))))
        for name, array in columns.items()
    ]
    metadata = {"factors": json.dumps(list(factors))}
    table = pa.Table.from_arrays(list(columns.values()), schema=pa.schema(fields, metadata=metadata))
    write_whole(folder / RESULTS, parquet_bytes(table))
    return folder / RESULTS


def read_results(folder: Path | str) -> pd.DataFrame:
    """The table of a study's result folder, one row per case; `attrs["factors"]` names the columns that the study varies.

    Raises InputError where the folder holds no table, or a damaged one.

    >>> table = read_results("results/how_many_traces")         # doctest: +SKIP
    >>> table.groupby(["method", "crowd.used"])["iou"].mean()   # doctest: +SKIP
    """
    path = Path(folder) / RESULTS
    if not path.is_file():
        raise InputError(f"{folder}: holds no {RESULTS}; name the --out folder of a `wzsumo sweep`")
    remedy = "run the sweep again, which writes it anew from what is finished"
    with reading(path, error=InputError, remedy=remedy, also=(pa.ArrowException,)):
        table = pq.read_table(path, page_checksum_verification=True)
        frame = table.to_pandas()
        frame.attrs["factors"] = json.loads((table.schema.metadata or {}).get(b"factors", b"[]"))
    missing = ({*CASE_COLUMNS, *MEASURED_COLUMNS, *frame.attrs["factors"]} - {"clean"}).difference(frame.columns)
    if missing:
        raise InputError(f"{path}: is no table of a sweep, {', '.join(sorted(map(str, missing))[:3])} missing; {remedy}")
    return frame


def column_of(name: str) -> Column:
    """Unit and meaning of a column of the table."""
    return (CASE_COLUMNS | MEASURED_COLUMNS).get(name, _factor_column(name))


def _factor(values: Iterable[Any]) -> pa.Array:
    values = list(values)
    if any(isinstance(value, list | dict) for value in values):
        return pa.array([json.dumps(value) for value in values])
    if any(isinstance(value, float) for value in values) and all(isinstance(value, int | float) for value in values):
        return pa.array([float(value) for value in values])
    return pa.array(values)


def _factor_column(name: str) -> Column:
    return Column(type=pa.null(), unit=_unit_in(name), meaning=f"factor: key {name} of the scenario")


def _unit_in(key: str) -> str:
    """The unit that a key names at its end, "" where it names none."""
    units = {
        "m": "m",
        "s": "s",
        "ft": "ft",
        "mph": "mph",
        "mps": "m/s",
        "mps2": "m/s2",
        "vph": "veh/h",
        "deg": "deg",
        "rad": "rad",
    }
    return units.get(key.rsplit("_", 1)[-1], "")


def _metadata(column: Column) -> dict[str, str]:
    return {"unit": column.unit, "meaning": column.meaning}
