"""A work zone placed in an existing SUMO network: three configurations that differ by the zone alone."""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wzsumo.errors import PlacementError, SpecError
from wzsumo.files.layout import write_layout
from wzsumo.mutcd.layout import lay_out
from wzsumo.placement.configuration import CLOSURE, DEFAULT_TYPE, DRAWING, VIEW, Configuration, ConfigurationFolder
from wzsumo.placement.corridor import Corridor, find_corridor
from wzsumo.placement.demand_files.edge_rules import EDGE_RULES
from wzsumo.placement.demand_files.lane_rules import LANE_RULES
from wzsumo.placement.demand_files.rewriting import Rewriting
from wzsumo.placement.demand_files.vehicle_rules import VEHICLE_RULES
from wzsumo.placement.demand_files.vehicle_sizes import CARS, VehicleSize
from wzsumo.placement.demand_files.vehicles import DEFAULT_TYPE as DEFAULT_VEHICLE_TYPE
from wzsumo.placement.demand_files.vehicles import Demand
from wzsumo.placement.ground.clear_ground import with_clear_ground
from wzsumo.placement.lane_plan import LanePlan, plan_lanes
from wzsumo.placement.lane_states import ClosedLanes
from wzsumo.placement.movements import Route, lost_movements, routes_of, vehicles_on
from wzsumo.placement.net import Net
from wzsumo.placement.net_patch import NetPatch
from wzsumo.placement.place_on_net import edge_at, known_frame
from wzsumo.placement.refusals import SIGNALS, check_cuts, check_net, check_other_direction, check_signals
from wzsumo.placement.study.zone_times import ZoneTimes, rerouters
from wzsumo.placement.xml_file import Change, XmlFile
from wzsumo.placement.zone_file import ZoneToPlace, on_side
from wzsumo.road import Road, RoadSpec
from wzsumo.simulation.demand import LOOK_AHEAD_M
from wzsumo.simulation.drawing.zone_drawing import write_drawing, write_view
from wzsumo.units import feet_from_metres
from wzsumo.work_zone import Side, WorkZone, WorkZoneLayout

CONFIGURATIONS = ("original", "open", "closed")
LAWLESS_CLASS = "ignoring"  # SUMO's class of vehicles that heed no lane's permissions (SUMO docs, Vehicle Classes)
LONG_ROAD_FT = 60_000.0  # straight: a zone is as long on it as anywhere

RULES = VEHICLE_RULES | EDGE_RULES | LANE_RULES


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A zone in its place."""

    plan: LanePlan
    closed: ClosedLanes
    doubts: tuple[str, ...]

    @property
    def layout(self) -> WorkZoneLayout:
        """The zone on the corridor's road, in the network's frame."""
        return self.plan.layout

    @property
    def corridor(self) -> Corridor:
        """The corridor."""
        return self.plan.corridor


def place_zone(
    net: Net,
    zone: ZoneToPlace,
    *,
    edge_id: str,
    position: float,
    side: Side | None = None,
    sizes: frozenset[VehicleSize] = CARS,
) -> Placed:
    """The zone with its first device at a position [m] of an edge; negative positions count from the edge's end, as in SUMO.

    The ground that it closes keeps clear of vehicles of these `sizes` on the lanes that stay open.
    Raises PlacementError where the zone cannot stand there, SpecError where the manual does not lay it out so.
    """
    check_net(net)
    edge, position = edge_at(net, edge_id, position)
    roadway = [lane for lane in edge.lanes if lane.is_roadway]
    work_zone, doubts = zone.at_speed(roadway[-1].speed if roadway else 0.0)
    work_zone = on_side(work_zone, side, n_lanes=len(roadway))
    corridor = _corridor(net, edge_id, position, work_zone, zone)
    layout = _lay_out(corridor, work_zone)
    plan = plan_lanes(corridor, layout)
    check_cuts(net, plan.cuts)
    closed = ClosedLanes(plan=plan)
    check_other_direction(net, closed)
    check_signals(plan)
    plan, moved = with_clear_ground(plan, closed, sizes)
    return Placed(plan=plan, closed=ClosedLanes(plan=plan), doubts=(*doubts, *moved))


def write_placement(
    placed: Placed,
    configuration: Configuration,
    folder: Path,
    *,
    names: tuple[str, ...] = CONFIGURATIONS,
    times: ZoneTimes | None = None,
) -> dict[str, Any]:
    """Write the configurations of these names, the layout and the report of changes; returns the report.

    Where the zone has `times`, `closed` is `open` with rerouters that bar its lanes while it stands.
    """
    net = placed.corridor.net
    cuts = {cut.edge.id: cut for cut in placed.plan.cuts}
    files = {path: XmlFile.read(path, role="the demand") for path in configuration.demand}
    demand = Demand.read(list(files.values()))
    _check_edges_are_there(net, demand, configuration)
    doubts = _check_routes(placed, demand)
    rewriting = Rewriting(
        cuts=cuts,
        routes=demand.routes,
        rules=RULES,
        lane_counts={edge.id: len(edge.lanes) for edge in net.edges.values()},
        closed_lanes=placed.closed.closed_lanes,
        doubts=doubts,
    )
    rewritten = {path: rewriting.rewrite(file) for path, file in files.items()}
    default_type = DEFAULT_TYPE if demand.uses_default_type and not demand.defines_default_type else None
    prefix = _unused_prefix(demand.named)
    changes: list[Change] = []
    for name in names:
        target = ConfigurationFolder(folder=folder / name, configuration=configuration)
        original, closed = name == "original", name == "closed"
        patch = NetPatch(net=net, cuts=cuts, closed=placed.closed if closed and times is None else None)
        target.write(configuration.net, net.file.data if original else patch.apply())
        for path, file in files.items():
            target.write(path, file.data if original else rewritten[path])
        target.make_folders([*configuration.outputs, *demand.outputs])
        for path in configuration.others:
            target.write(path, path.read_bytes())
        first, last = [], []
        if default_type and not original:
            (target.folder / default_type).write_text(_default_type_text(), encoding="utf-8")
            first = [default_type]
        if closed:
            write_drawing(placed.layout, target.folder / DRAWING, prefix=prefix)
            last = [DRAWING]
        if closed and times is not None:
            text = rerouters(placed.closed, times, begin=configuration.begin, prefix=prefix)
            (target.folder / CLOSURE).write_text(text, encoding="utf-8")
            last = [CLOSURE, DRAWING]
        write_view(placed.layout, target.folder / VIEW, step_length=configuration.step_length, network=net.bounds)
        target.write_config(first=first, last=last)
        changes = patch.changes
    report = _report(placed, rewriting, changes)
    (folder / "changes.json").write_text(json.dumps(report, indent=1), encoding="utf-8")
    write_layout(placed.layout, folder, frame=known_frame(net))
    return report


def _corridor(net: Net, edge_id: str, position: float, work_zone: WorkZone, zone: ZoneToPlace) -> Corridor:
    n_lanes = sum(lane.is_roadway for lane in net.edges[edge_id].lanes)
    # A zone is as long on any road; on lanes of 12 ft at least as long as on narrower ones.
    road = RoadSpec(lane_count=max(n_lanes, 1), length_ft=LONG_ROAD_FT, **zone.road.model_dump()).build()
    layout = _laid_out(work_zone, road, edge_id)
    length, closed = layout.end - layout.start, work_zone.closed_lanes
    return find_corridor(net, edge_id, position, closed=closed, length=length, shoulders=zone.road.widths)


def _lay_out(corridor: Corridor, work_zone: WorkZone) -> WorkZoneLayout:
    """The layout on the corridor's road, whose lanes are those that lead through the zone."""
    closed = tuple(corridor.slots.index(slot) for slot in work_zone.closed_lanes)
    placed = work_zone.model_copy(update={"start_ft": feet_from_metres(corridor.start), "closed_lanes": closed})
    return _laid_out(placed, corridor.road, corridor.links[0].edge.id)


def _laid_out(work_zone: WorkZone, road: Road, edge_id: str) -> WorkZoneLayout:
    try:
        return lay_out(work_zone, road)
    except SpecError as error:
        raise SpecError(f"on edge {edge_id!r}: {error}") from None


def _unused_prefix(named: set[str]) -> str:
    """What ids of the zone's drawing and rerouters begin with, and none of the network's does: zones stand side by side."""
    prefixes = (f"wzsumo.zone{number or ''}." for number in range(len(named) + 1))
    return next(prefix for prefix in prefixes if not any(id_.startswith(prefix) for id_ in named))


def _check_edges_are_there(net: Net, demand: Demand, configuration: Configuration) -> None:
    """Raise PlacementError where routes or trips name edges that the network has not."""
    named = {edge for route in demand.routes.values() for edge in route} | {
        edge for trip in demand.trips for edge in trip.edges
    }
    files = ", ".join(path.name for path in configuration.demand)
    if demand.missing_routes:
        raise PlacementError(
            f"{files}: vehicles drive on route {min(demand.missing_routes)!r}, which is in none of these files; give the file "
            "that has it, too"
        )
    if missing := sorted(named - net.edges.keys()):
        raise PlacementError(
            f"{files}: {len(missing)} of {len(named)} edges that vehicles drive on are not in {net.file.path}, such as "
            f"{missing[0]!r}; give the routes of this network"
        )


def _check_routes(placed: Placed, demand: Demand) -> list[str]:
    """Doubts about movements that nobody makes. Raises PlacementError where vehicles lose their way, or obey no closure."""
    doubts = []
    net = placed.corridor.net
    for vehicle_class in sorted(demand.classes):
        if vehicle_class == LAWLESS_CLASS:
            _refuse_lawless(placed, routes_of(net, demand, vehicle_class))
            continue
        lost = lost_movements(net, placed.closed, vehicle_class)
        if not lost:
            continue
        told = " -> ".join(lost[0].edges)
        if n_vehicles := vehicles_on(routes_of(net, demand, vehicle_class), lost):
            raise PlacementError(
                f"{n_vehicles} vehicles of class {vehicle_class} would lose their way: no open lane leads along edges {told} "
                f"any more ({len(lost)} movements lost); move the zone, shorten it, or close lanes on the other side"
            )
        doubts.append(f"no open lane leads along edges {told} for class {vehicle_class}; no vehicle of the demand goes there")
    return doubts


def _refuse_lawless(placed: Placed, routes: Counter[Route]) -> None:
    closed = {piece.link.edge.id for piece in placed.closed.pieces if piece.barred}
    if n_vehicles := sum(n for route, n in routes.items() if closed & set(route)):
        raise PlacementError(
            f'{n_vehicles} vehicles of class "{LAWLESS_CLASS}" drive along the closed lanes\' edges '
            f"({', '.join(sorted(closed))}), and SUMO lets that class drive on closed lanes; give their vType another vClass, "
            "such as passenger"
        )


def _default_type_text() -> str:
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<additional>\n'
        f'    <vType id="{DEFAULT_VEHICLE_TYPE}" lcStrategicLookahead="{LOOK_AHEAD_M:.0f}"/>\n</additional>\n'
    )


def _cut_approaches(placed: Placed) -> list[str]:
    """Doubts about cut edges that end at a signal."""
    junctions = placed.corridor.net.junctions
    ends = [(cut.edge.id, junctions[cut.edge.to_node]) for cut in placed.plan.cuts if cut.edge.to_node in junctions]
    return [
        f"edge {edge!r}, which is cut, ends at the signal of junction {junction.get('id')!r}: a saturated approach may "
        "discharge some percent more or less; compare open with original"
        for edge, junction in ends
        if junction.get("type") in SIGNALS
    ]


def _report(placed: Placed, rewriting: Rewriting, changes: list[Change]) -> dict[str, Any]:
    layout, plan = placed.layout, placed.plan
    departures = [
        f"{count} vehicles depart on edge {edge!r}, which is cut: they enter on its first piece, which is not quite the same"
        for edge, count in sorted(rewriting.departures.items())
    ]
    return {
        "zone": {
            "edges": [link.edge.id for link in plan.corridor.links],
            "start_m": layout.start,
            "end_m": layout.end,
            "length_m": layout.end - layout.start,
            "areas_m": {area.name: round(area.length, 2) for area in layout.areas},
            "posted_speed_mph": layout.work_zone.posted_speed_mph,
            "closed_lanes": list(layout.work_zone.closed_lanes),
            "road_lanes": layout.road.own_lanes,
            "n_devices": len(layout.devices),
        },
        "cuts": {cut.edge.id: {"pieces": list(cut.ids), "at_m": list(cut.positions)} for cut in plan.cuts},
        "warnings": [*placed.doubts, *departures, *_cut_approaches(placed), *rewriting.doubts],
        "changes": [change.as_row() for change in [*changes, *rewriting.changes]],
    }
