"""The two tasks of a sweep's worker: simulate a fleet, and evaluate cases on a simulated fleet.

A fleet travels between processes as the bytes of a Parquet file, so that workers on other machines need no shared folder.
"""

import io
import json
import resource
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from wzsumo.case.crowd import collection_figures
from wzsumo.case.evaluation import evaluate, table_row
from wzsumo.case.map_method import MadeMap, Source
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Watch
from wzsumo.case.zone import SimulatedZone, fleet_before_the_change, simulate_zone
from wzsumo.errors import InputError
from wzsumo.files.output import parquet_bytes
from wzsumo.files.work_folder import work_folder
from wzsumo.metrics.network_traffic import network_figures
from wzsumo.planning.plan import load_kernels
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import Site, prepare_site
from wzsumo.simulation.files import SumoFiles
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.sweep.evaluation.study_case import StudyCase

FLEET_FIGURES = (
    "n_passed", "mean_speed_activity_mps", "locked_s", "throughput_vph", "mean_delay_s", "max_queue_length_m",
    "n_hard_braking",
)  # fmt: skip
# Of a network, those with the zone less those without it in the same simulation; none for a road of our own.
NETWORK_CHANGES = (
    "delay_h", "mean_delay_s", "mean_departure_delay_s", "mean_travel_time_s", "co2_kg", "n_arrived", "corridor_delay_h",
    "corridor_co2_kg",
)  # fmt: skip
_FLEET = b"fleet"  # key of the fleet's summary in the metadata of the Parquet file
_REFUSED = b"refused"  # key of the reason why there is no fleet
_ONE_SIMULATION = threading.Lock()  # libsumo allows one per process, and a Dask worker may run several threads


def simulate(scenario: Scenario) -> bytes:
    """A Parquet file of the true traces in the zone, with the fleet's summary in its metadata.

    Where the scenario has no traffic that can be simulated, such as no vehicle at all, it holds the reason alone.
    """
    try:
        return _simulated(scenario)
    except InputError as error:
        return parquet_bytes(pa.table({}).replace_schema_metadata({_REFUSED: str(error).encode()}))


def _simulated(scenario: Scenario) -> bytes:
    layout = scenario.layout()
    with _ONE_SIMULATION, _in_processor_seconds() as spent, work_folder(Path(tempfile.gettempdir())) as folder:
        zone, measures = simulate_zone(scenario, layout, folder=folder, watch=Watch())
    summary = asdict(measures.summary) | asdict(measures.traffic.summary) | {"simulation_cpu_s": spent[0]}
    if measures.network is not None:
        summary |= {"network": network_figures(measures.network)}
    table = pa.Table.from_pandas(zone.over_zone, preserve_index=False)
    metadata = dict(table.schema.metadata or {}) | {_FLEET: json.dumps(summary).encode()}
    return parquet_bytes(table.replace_schema_metadata(metadata))


def evaluate_cases(simulated: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
    """One row per case, all on the fleet that `simulate` returned. Cases of one map source should follow one another.

    An impossible case, such as one that asks for more traces than the fleet has, gets the status REFUSED and the reason.
    """
    if reason := pq.read_schema(io.BytesIO(simulated)).metadata.get(_REFUSED):
        return [{"case": case.id, "status": "REFUSED", "reason": reason.decode()} for case in cases]
    over_zone, fleet = read_simulated(simulated)
    shared = _SharedWork(over_zone)
    load_kernels()  # before the clock of the first case starts
    rows = []
    for case in cases:
        with _in_processor_seconds() as spent:
            try:
                row = shared.row_of(case) | {"status": "DONE"}
            except InputError as error:
                row = {"status": "REFUSED", "reason": str(error)}
        known = {"case": case.id} | {f"fleet_{name}": fleet[name] for name in FLEET_FIGURES} | network_columns(fleet)
        rows.append(known | row | {"case_cpu_s": spent[0]})
    return rows


def network_columns(fleet: Mapping[str, Any]) -> dict[str, float]:
    """What the zone changes in a network, by columns of the table; none for a road of our own."""
    figures = fleet.get("network")
    if not figures:
        return {}
    columns = {f"network_{name}_change": figures["change"][name] for name in NETWORK_CHANGES}
    return columns | {"network_mean_delay_without_s": figures["without_zone"]["mean_delay_s"]}


def read_simulated(simulated: bytes) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The traces over the zone and the fleet's summary. Raises OSError where a byte of the file is not as it was written."""
    table = pq.read_table(io.BytesIO(simulated), page_checksum_verification=True)
    return table.to_pandas(), json.loads(table.schema.metadata[_FLEET])


class _SharedWork:
    """The site, map sources, maps and rows of the last case, which the next case uses where it has the same."""

    def __init__(self, over_zone: pd.DataFrame) -> None:
        self._over_zone = over_zone
        self._site: tuple[str, Site] | None = None
        self._sources: tuple[str, str, Sources] | None = None  # by the names of map source and site
        self._maps: dict[str, MadeMap] = {}  # made of these sources, by method
        self._rows: dict[str, dict[str, Any]] = {}  # of these sources, by evaluation

    def row_of(self, case: StudyCase) -> dict[str, Any]:
        """The measured columns of a case."""
        takes_traces = case.map_method.source is Source.CROWD
        collected = collection_figures(self._over_zone, case.scenario) if takes_traces else {}
        sources = self._sources_of(case)
        if case.evaluation not in self._rows:
            self._rows[case.evaluation] = self._evaluated(case, sources)
        return collected | self._rows[case.evaluation]

    def _evaluated(self, case: StudyCase, sources: Sources) -> dict[str, Any]:
        scenario, site, method = case.scenario, self._site_of(case), case.map_method
        known = self._maps.get(case.method)
        result = evaluate(method, sources, scenario=scenario, site=site, made=known, drives=case.drive, watch=Watch())
        self._maps[case.method] = result.made
        return table_row(result, lidar=sources.lidar if method.source is Source.LIDAR else None, drives=case.drive)

    def _site_of(self, case: StudyCase) -> Site:
        if self._site is None or self._site[0] != case.site:
            self._site = (case.site, prepare_site(case.scenario))
        return self._site[1]

    def _sources_of(self, case: StudyCase) -> Sources:
        """The map sources of a case. A crowd that the last case used too is not learned from again."""
        if self._sources is None or self._sources[:2] != (case.source, case.site):
            same_crowd = (
                self._sources is not None and self._sources[0] == case.source and case.map_method.source is Source.CROWD
            )
            crowd = self._sources[2].crowd if self._sources is not None and same_crowd else None
            site = self._site_of(case)
            zone = _zone_of(case.scenario, over_zone=self._over_zone)
            sources = Sources(zone=zone, scenario=case.scenario, site=site, watch=Watch(), known_crowd=crowd)
            self._sources, self._maps, self._rows = (case.source, case.site, sources), {}, {}
        return self._sources[2]


def _zone_of(scenario: Scenario, *, over_zone: pd.DataFrame) -> SimulatedZone:
    """The simulated zone of a case. It simulates again where a step needs more than the traces in the zone."""

    @contextmanager
    def sumo_files() -> Iterator[SumoFiles]:
        with _ONE_SIMULATION, work_folder(Path(tempfile.gettempdir())) as folder:
            yield scenario.write_sumo_files(folder)

    def whole_fleet() -> pd.DataFrame:
        with sumo_files() as files:
            return simulate_fleet(files, on_second=lambda _time: None)

    def fleet_before() -> pd.DataFrame:
        with _ONE_SIMULATION, work_folder(Path(tempfile.gettempdir())) as folder:
            return fleet_before_the_change(scenario, folder)

    return SimulatedZone(over_zone=over_zone, whole_fleet=whole_fleet, sumo_files=sumo_files, fleet_before=fleet_before)


@contextmanager
def _in_processor_seconds() -> Iterator[list[float]]:
    """A list that holds, after the block, the processor time [s] of the block and of the programs that it ran."""
    spent: list[float] = []
    began = _processor_s()
    yield spent
    spent.append(round(_processor_s() - began, 4))


def _processor_s() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.thread_time() + children.ru_utime + children.ru_stime
