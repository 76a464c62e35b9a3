"""The verbs of `import wzsumo`: what the command line does, for programs and notebooks."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

from wzsumo.case import case
from wzsumo.case.files import write_case
from wzsumo.case.methods import DEFAULT_METHOD, chosen_methods
from wzsumo.case.traces_map import crowd_method, map_of_traces, read_road
from wzsumo.case.watch import Progress, Watch, quiet_progress
from wzsumo.crowd_mapping.cleaning.usable_traces import usable_traces
from wzsumo.errors import InputError
from wzsumo.figures.layout_figure import draw_zone
from wzsumo.files.layout import layout_geojson
from wzsumo.files.output import remove_stamps, save_figure, staged_folder
from wzsumo.files.result_folder import ResultFolder
from wzsumo.files.traces import fixes_from
from wzsumo.frames import pose_of_degrees
from wzsumo.grid import OccupancyGrid
from wzsumo.placement.configuration import Configuration
from wzsumo.placement.net import Net
from wzsumo.placement.place_on_net import edge_near
from wzsumo.placement.placement import place_zone, write_placement
from wzsumo.placement.study.zone_times import zone_times
from wzsumo.planning.plan import Plan, plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.report.report import PAGE, write_report
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.zone_to_place import read_zone_to_place
from wzsumo.simulation.connection import refuse_without_display
from wzsumo.tables import refuse_endless_traces
from wzsumo.vehicle import VehicleGeometry


def run_case(
    scenario: Scenario,
    out: Path | str,
    *,
    methods: Iterable[str] | None = None,
    progress: Progress = quiet_progress,
    in_window: bool = False,
) -> dict[str, Any]:
    """Figures of one case, the content of result.json, after writing it, maps, paths, drives and report.html into `out`.

    `methods` are names of map methods. Without names the methods of the crowd are run, or all methods where the scenario has
    a section `slam`. `in_window` shows each drive live in sumo-gui. Nothing is written where the case cannot be run.

    >>> import wzsumo
    >>> scenario = wzsumo.load_scenario("paper", seed=21)
    >>> result = wzsumo.run_case(scenario, "results/mine", methods=["swept"])  # doctest: +SKIP
    >>> result["methods"]["swept"]["iou"]                                      # doctest: +SKIP
    """
    chosen = chosen_methods(methods, scenario)
    if in_window:
        refuse_without_display()
    with staged_folder(Path(out), files=("result.json", "layout.geojson", "traces.parquet", PAGE)) as stage:
        sumo_folder = stage / "sumo"
        sumo_folder.mkdir()
        watch = Watch(progress=progress, in_window=in_window)
        result = write_case(case.run_case(scenario, methods=chosen, sumo_folder=sumo_folder, watch=watch), stage)
        remove_stamps(sumo_folder)
        write_report(stage)
    return result


def build_map(
    traces: Any,
    *,
    method: str = DEFAULT_METHOD,
    seed: int = 1,
    resolution_m: float = 0.127,
    road: Path | str | None = None,
) -> OccupancyGrid:
    """The map of a trace table: vehicle_id, time_s, x_m, y_m, one row per fix, in metres of a local frame.

    The table is pandas, geopandas, Arrow, or has `__geo_interface__`; columns may have the names of data providers and tools.
    `road` names a file that describes the road before the zone, in the frame of the traces: a scenario, or a TOML file with
    the sections [road] and [announced]. The defaults are those of `wzsumo map`. Free cells have a p_occupied below 0.196.
    Ground that no vehicle drove on is unknown, not free. Raises InputError where the table is no trace table or its traces are
    not on the road, and where the resolution is not above 0 and at most 10 m.

    >>> import pandas as pd, wzsumo
    >>> x = [float(x) for x in range(0, 200, 2)]
    >>> tracks = [pd.DataFrame({"vehicle_id": f"v{n}", "time_s": x, "x_m": x, "y_m": 0.2 * n}) for n in range(4)]
    >>> grid = wzsumo.build_map(pd.concat(tracks), resolution_m=0.25)
    >>> bool(grid.free[grid.cell_of([[100.0, 0.3]])][0])
    True
    """
    if not 0 < resolution_m <= 10:
        raise InputError(f"resolution_m={resolution_m} must be above 0 and at most 10 m, the edge of a cell")
    road_file = None if road is None else Path(road)
    chosen = crowd_method(method, road=road_file)
    fixes = fixes_from(traces)
    refuse_endless_traces(fixes.table, source="traces")
    usable = usable_traces(fixes.table, source="traces").traces
    before = read_road(road_file, usable, source="traces", frame=fixes.frame, utc=fixes.utc)
    return map_of_traces(
        usable, chosen, source="traces", seed=seed, resolution_m=resolution_m, before=before, progress=quiet_progress
    ).grid


def place(
    net: Path | str,
    *,
    zone: Path | str,
    out: Path | str,
    at: tuple[str, float] | None = None,
    at_latlon: tuple[float, float] | None = None,
    lane_side: Literal["left", "right"] | None = None,
    sumocfg: Path | str | None = None,
    routes: Sequence[Path | str] = (),
    additionals: Sequence[Path | str] = (),
    closed_from_s: float = 0.0,
    closed_for_s: float | None = None,
) -> dict[str, Any]:
    """The report of changes after setting a zone up in an existing SUMO network, as `wzsumo place` does.

    `at` is an edge and a position [m] on it, `at_latlon` a place in degrees; one of them is given. `out` then holds the
    configurations `original`, `open` and `closed`. With `closed_from_s` or `closed_for_s`, from the simulation's beginning, the
    zone is set up and taken away while traffic runs. Raises InputError where the zone cannot stand there.
    """
    if (at is None) == (at_latlon is None):
        raise InputError("give the place of the zone either as at=(edge, position) or as at_latlon=(latitude, longitude)")
    if sumocfg and (routes or additionals):
        raise InputError("sumocfg names its routes and additionals itself; leave routes and additionals out")
    to_place, network = read_zone_to_place(Path(zone)), Net.read(Path(net))
    if sumocfg:
        configuration = Configuration.read(Path(sumocfg), net=Path(net))
    else:
        configuration = Configuration.of_files(Path(net), map(Path, routes), map(Path, additionals))
    edge, position = at or edge_near(network, *(at_latlon or (0.0, 0.0)))
    placed = place_zone(network, to_place, edge_id=edge, position=position, side=lane_side, sizes=configuration.vehicle_sizes)
    times = zone_times(closed_from_s, closed_for_s)
    if times:
        times.check(placed.closed)
    with staged_folder(Path(out), files=("changes.json", "layout.geojson", "layout.png")) as stage:
        report = write_placement(placed, configuration, stage, times=times)
        drawing = ResultFolder(folder=stage, result={}, layout=layout_geojson(placed.layout))
        save_figure(draw_zone(drawing), stage / "layout.png")
    return report


def plan(
    grid: OccupancyGrid,
    *,
    start_xy_deg: Sequence[float],
    goal_xy_deg: Sequence[float],
    vehicle: VehicleGeometry | None = None,
    spec: PlannerSpec | None = None,
) -> Plan:
    """The plan on a map between two poses of the REAR AXLE, as `wzsumo plan` takes them.

    A pose is (x [m], y [m], heading [degrees, counter-clockwise from +x]). The path that is found has its headings in radians,
    as all arrays have. Where no path is found `plan.path` is None and `plan.reason` says why.

    >>> import wzsumo
    >>> grid = wzsumo.blank_grid((0, -5, 120, 5), resolution=0.25, p_occupied=0.0)
    >>> found = wzsumo.plan(grid, start_xy_deg=(10, 0, 0), goal_xy_deg=(100, 1, 0))
    >>> str(found.status), round(float(found.path.arc_length[-1]))
    ('FOUND', 90)
    """
    return plan_path(
        grid,
        start=pose_of_degrees(start_xy_deg),
        goal=pose_of_degrees(goal_xy_deg),
        vehicle=vehicle or VehicleGeometry(),
        spec=spec or PlannerSpec(),
    )
