"""The table of a study: one row a case. What its columns are, how it is written, how it is read."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from wzsumo.errors import InputError
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


CASE_COLUMNS = {
    "case": _text("name of the case, a hash of all that decides it; `wzsumo run DIR --case NAME` runs it alone"),
    "simulation": _text("name of the simulation of the fleet; cases of one are paired"),
    "scenario": _text("name of the base scenario"),
    "method": _text("how the traces become a map"),
    "seed": _count("seed of the case, which decides its simulation too"),
}
MEASURED_COLUMNS = {
    "status": _text("DONE, REFUSED (the case cannot be, see reason) or FAILED (it was lost twice, see reason)"),
    "reason": _text("why it was refused, failed, found no path or ended short of the goal; else empty"),
    "outcome": _text("how the drive ended; NO_PATH where there was none to drive; empty where nothing was driven"),
    "plan_status": _text("how planning ended"),
    "safe_plan": Column(
        type=pa.bool_(), unit="", meaning="a path was found whose outline touches no device, no edge and not the closed area"
    ),
    "precision": _number("1", "of the cells said to be free, the share that is drivable"),
    "recall": _number("1", "of the drivable cells, the share said to be free"),
    "iou": _number("1", "intersection over union of the two"),
    "n_fragments": _count("pieces of the free area"),
    "planned_min_clearance_devices_m": _number("m", "planned path: outline to the nearest device's"),
    "planned_min_clearance_road_edge_m": _number("m", "planned path: outline to the nearer edge of the pavement"),
    "planned_closed_area_share": _number("1", "planned path: share of its length in the closed area"),
    "driven_min_clearance_devices_m": _number("m", "driven path: outline to the nearest device's"),
    "driven_min_clearance_road_edge_m": _number("m", "driven path: outline to the nearer edge of the pavement"),
    "driven_closed_area_share": _number("1", "driven path: share of its length in the closed area"),
    "driven_min_ttc_s": _number("s", "drive: least time to collision with any vehicle, the road laid straight"),
    "driven_max_drac_mps2": _number("m/s2", "drive: largest deceleration that avoids a crash, the ego's or the other's"),
    "driven_min_pet_s": _number("s", "drive: least post-encroachment time"),
    "driven_max_braking_mps2": _number("m/s2", "drive: hardest braking of the ego"),
    "driven_max_jerk_mps3": _number("m/s3", "drive: largest jerk along the path"),
    "driven_mean_speed_mps": _number("m/s", "drive: mean speed"),
    "driven_delay_behind_s": _number("s", "drive: delay of all vehicles behind the ego together, against the road without it"),
    "plan_speed_mps": _number(
        "m/s", "speed that the plan's curvature is made for: the planned one, or less where no way is else"
    ),
    "n_replans": _count("maps that reached the ego on the way, on each of which it planned anew"),
    "drive_time_s": _number("s", "time from entering to the end of the drive"),
    "max_cross_track_m": _number("m", "largest distance of the driven from the planned path"),
    "path_length_m": _number("m", "length of the planned path"),
    "plan_risk_m": _number("m", "integral along the planned path of the largest p_occupied under the outline"),
    "n_expansions": _count("states that the search tried"),
    "n_traces": _count("traces that the map is made of"),
    "n_components": _count("components of the chosen mixture"),
    "n_equipped": _count("equipped vehicles that passed the zone"),
    "minutes_to_collect": _number(
        "min", "from the first vehicle's leaving the zone to that of as many equipped ones as are used"
    ),
    "slam_ate_m": _number("m", "LiDAR drive: root mean square error of where the car took itself to be"),
    "slam_dead_reckoning_ate_m": _number("m", "the same without the LiDAR"),
    "slam_n_devices_mapped": _count("LiDAR drive: devices that the map has"),
    "slam_n_links": _count("LiDAR drive: gaps between devices that the map closes"),
    "fleet_n_passed": _count("vehicles that passed the zone from end to end"),
    "fleet_mean_speed_activity_mps": _number("m/s", "mean speed of the fleet in the activity area"),
    "fleet_throughput_vph": _number("veh/h", "flow past the middle of the activity area, after the warm-up"),
    "fleet_mean_delay_s": _number("s", "mean delay of the vehicles that came through, departure delay included"),
    "fleet_max_queue_length_m": _number("m", "longest queue"),
    "fleet_n_hard_braking": _count("vehicles that braked hard"),
}
BATCH_SCHEMA = pa.schema(
    [("case", pa.string()), *((name, column.type) for name, column in MEASURED_COLUMNS.items()), ("case_cpu_s", pa.float64())]
)


def write_results(folder: Path, cases: Sequence[StudyCase], rows: Mapping[str, Mapping[str, Any]]) -> Path:
    """The path of results.parquet, with a row for each of the cases that `rows` has, in the order of the study."""
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
    """The table of a study's result folder, one row a case; `attrs["factors"]` names the columns that the study varies.

    Raises InputError where there is none, or where it is damaged.

    >>> table = read_results("results/how_many_traces")         # doctest: +SKIP
    >>> table.groupby(["method", "crowd.used"])["iou"].mean()   # doctest: +SKIP
    """
    path = Path(folder) / RESULTS
    if not path.is_file():
        raise InputError(f"{folder}: holds no {RESULTS}; name the --out folder of a `wzsumo sweep`")
    try:
        table = pq.read_table(path, page_checksum_verification=True)
    except (OSError, pa.ArrowException) as error:
        raise InputError(
            f"{path}: damaged ({error}); run the sweep again, which writes it anew from what is finished"
        ) from None
    frame = table.to_pandas()
    frame.attrs["factors"] = json.loads((table.schema.metadata or {}).get(b"factors", b"[]"))
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
    """The unit that a key ends in."""
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
