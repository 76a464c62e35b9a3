"""What SUMO does with an ego that moveToXY places: one test for each way in which it goes wrong if it is done naively."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import bent_road, paper_layout, paper_work_zone

from wzsumo.ego import EgoState
from wzsumo.frames import FloatArray, advance
from wzsumo.metrics.conflicts import boxes_overlap
from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.edges import Edge
from wzsumo.simulation.ego_bodies import bodies_in_lanes
from wzsumo.simulation.files import SimulationSpec, SumoFiles, write_sumo_files
from wzsumo.simulation.session import EGO_ID, LaneBody, Session, running
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

LAYOUT = paper_layout(start_ft=3800, work_length_ft=100, closed_lanes=(), shift_ft=0, shifted_lane_width_ft=None)
CAR = VehicleGeometry()
LANE = 12 * 0.3048
FINE = ("--step-length", "0.05", "--default.action-step-length", "0.1")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> SumoFiles:
    spec = SimulationSpec(demand=DemandSpec(flow_vph=1800, duration_s=200, truck_share=0.1))
    return write_sumo_files(LAYOUT, tmp_path_factory.mktemp("session"), spec=spec, seed=3)


def ids_of(files: SumoFiles) -> list[str]:
    return [edge.id for edge in files.edges]


def drive(
    session: Session,
    files: SumoFiles,
    *,
    y: float,
    x: float = 250.0,
    speed: float = 10.0,
    duration_s: float = 5.0,
    step_s: float = 0.05,
    in_all_lanes: bool = True,
) -> Iterator[tuple[EgoState, Traffic]]:
    """Yield (state, traffic) after each step of an ego that goes straight ahead at y."""
    lane = int(np.clip(y // LANE, 0, 2))
    session.request_ego(CAR, edges=ids_of(files), lane=lane, position=x + CAR.axle_to_bumper_m, speed=speed)
    while not session.has_ego():
        session.step()
    session.take_over_ego()
    traffic = session.traffic()
    for step in range(1, int(duration_s / step_s) + 1):
        state = EgoState(x=x + speed * step_s * step, y=y, heading=0.0, speed=speed)
        ego_bodies = bodies_in_lanes(state, CAR, traffic, road=LAYOUT.road, edges=files.edges)
        session.place_ego(ego_bodies if in_all_lanes else ego_bodies[:1], speed=speed)
        session.step()
        traffic = session.traffic()
        yield state, traffic


def sumo_bumper(session: Session) -> FloatArray:
    return np.array(session._sumo.vehicle.getPosition(EGO_ID))


@pytest.mark.parametrize(("y", "body_y"), [(1.5 * LANE, 1.5 * LANE), (1.5 * LANE + 0.15, 1.5 * LANE + 0.15), (-1.6, 0.3)])
def test_body_is_exactly_where_it_was_put_and_not_snapped_to_the_middle_of_its_lane(
    files: SumoFiles, y: float, body_y: float
) -> None:
    with running(files.config, options=FINE) as session:
        for state, _ in drive(session, files, y=y, duration_s=1.0):
            assert sumo_bumper(session) == pytest.approx([state.x + CAR.axle_to_bumper_m, body_y], abs=1e-3)


def test_speed_that_sumo_sees_has_no_spikes(files: SumoFiles) -> None:
    with running(files.config, options=FINE) as session:
        for _ in drive(session, files, y=1.5 * LANE, duration_s=3.0):
            assert session._sumo.vehicle.getSpeed(EGO_ID) == pytest.approx(10.0, abs=1e-6)


def test_ego_crosses_every_junction_of_the_zone(tmp_path: Path) -> None:
    # The paper's zone on the same road: its lanes 0 and 1 keep their places up to the shift, 646 m along the road.
    spec = SimulationSpec(demand=DemandSpec(flow_vph=200, duration_s=60))
    closing = write_sumo_files(paper_layout(), tmp_path, spec=spec, seed=3)
    roads: list[str] = []
    with running(closing.config, options=FINE) as session:
        for _ in drive(session, closing, y=0.5 * LANE, x=250.0, speed=25.0, duration_s=12.0):
            road = session._sumo.vehicle.getRoadID(EGO_ID)
            assert sumo_bumper(session)[1] == pytest.approx(0.5 * LANE, abs=1e-3)
            if road not in roads:
                roads.append(road)
    reached = [edge.id for edge in closing.edges if edge.end > 260 and edge.start < 550]
    assert len(reached) == 4
    assert roads == reached


@pytest.mark.parametrize("radius_ft", [984.3, -984.3], ids=["left", "right"])
def test_ego_on_the_outer_side_of_a_kink_between_two_edges_is_counted_to_the_lane_that_it_is_in(
    tmp_path: Path, radius_ft: float
) -> None:
    layout = lay_out(paper_work_zone(), bent_road(radius_ft))
    spec = SimulationSpec(demand=DemandSpec(flow_vph=200, duration_s=60))
    bent = write_sumo_files(layout, tmp_path, spec=spec, seed=3)
    with running(bent.config, options=FINE) as session:
        session.request_ego(CAR, edges=ids_of(bent), lane=0, position=20.0, speed=10.0)
        while not session.has_ego():
            session.step()
        session.take_over_ego()
        kinks = list(outer_sides_of_kinks(session._sumo.lane, bent.edges, aside_m=0.7))
        assert len(kinks) >= 3
        for (before, after), front in kinks:
            for behind_m in (0.5, 0.0):
                edge, index = before.rsplit("_", maxsplit=1)
                body = LaneBody(lane=0, edge=edge, lane_on_edge=int(index), front=advance(front, -behind_m), width=1.0)
                session.place_ego((body,), speed=10.0)
                session.step()
            assert session._sumo.vehicle.getLaneID(EGO_ID) in (before, after)


def outer_sides_of_kinks(
    lane_api: Any, edges: tuple[Edge, ...], *, aside_m: float
) -> Iterator[tuple[tuple[str, str], FloatArray]]:
    """The lanes that meet at each kink between two edges, and a pose in the wedge on its outer side that no lane runs past."""
    for edge in edges[:-1]:
        for lane in [f"{edge.id}_{index}" for index in range(len(edge.lanes))]:
            for following, *_ in lane_api.getLinks(lane):
                ends = np.array(lane_api.getShape(lane)[-2:])
                goes_on = np.array(lane_api.getShape(following)[:2])
                before, after = (np.arctan2(*np.diff(line, axis=0)[0, ::-1]) for line in (ends, goes_on))
                if 0.005 < abs(after - before) < 0.1:
                    heading = (before + after) / 2
                    outwards = heading - np.sign(after - before) * np.pi / 2
                    aside = aside_m * np.array([np.cos(outwards), np.sin(outwards)])
                    yield (lane, following), np.array([*(ends[-1] + aside), heading])


def passers_through(files: SumoFiles, *, in_all_lanes: bool) -> tuple[int, int]:
    """Number of vehicles that pass an ego which straddles a line for 60 s, and of those whose outline overlaps its own."""
    passed: set[str] = set()
    overlapped: set[str] = set()
    was_behind: set[str] = set()
    with running(files.config) as session:
        while session.time < 60:
            session.step()
        for state, traffic in drive(session, files, y=LANE, x=150.0, duration_s=60, step_s=0.1, in_all_lanes=in_all_lanes):
            centre = advance(state.pose, CAR.axle_to_centre_m)
            sizes = np.column_stack([traffic.lengths, traffic.widths])
            hit = boxes_overlap(centre, np.array([CAR.length_m, CAR.width_m]), traffic.poses, sizes)
            for name, pose, touches in zip(traffic.ids, traffic.poses, hit, strict=True):
                if pose[0] < centre[0]:
                    was_behind.add(name)
                elif name in was_behind:
                    passed.add(name)
                if touches:
                    overlapped.add(name)
    return len(passed), len(overlapped)


def test_drivers_pass_through_a_straddling_ego_unless_it_has_a_body_in_both_lanes(files: SumoFiles) -> None:
    passed, overlapped = passers_through(files, in_all_lanes=False)
    assert passed >= 10
    assert overlapped >= 2  # the trap: SUMO counts the ego to one lane
    passed, overlapped = passers_through(files, in_all_lanes=True)
    assert passed >= 5
    assert overlapped == 0


def vehicles_that_touch_an_ego_askew(files: SumoFiles, *, as_wide_as_it_lies: bool) -> set[str]:
    """Ids of the vehicles whose outline overlaps an ego that stands 0.7 m off the middle of its lane, turned by 11 degrees."""
    x, speed = 250.0, 10.0
    touching: set[str] = set()
    with running(files.config, options=FINE) as session:
        while session.time < 40:
            session.step()
        session.request_ego(CAR, edges=ids_of(files), lane=1, position=x + CAR.axle_to_bumper_m, speed=speed)
        while not session.has_ego():
            session.step()
        session.take_over_ego()
        traffic = session.traffic()
        while session.time < 85:
            speed = max(speed - 0.1, 0.0)
            x += 0.05 * speed
            state = EgoState(x=x, y=1.5 * LANE + 0.7, heading=0.2, speed=speed)
            own, *others = bodies_in_lanes(state, CAR, traffic, road=LAYOUT.road, edges=files.edges)
            if not as_wide_as_it_lies:
                front = advance(state.pose, CAR.axle_to_bumper_m)
                own = replace(own, front=front, width=CAR.width_m + 2 * 0.3)
            session.place_ego((own, *others), speed=speed)
            session.step()
            traffic = session.traffic()
            sizes = np.column_stack([traffic.lengths, traffic.widths])
            centre = advance(state.pose, CAR.axle_to_centre_m)
            hit = boxes_overlap(centre, np.array([CAR.length_m, CAR.width_m]), traffic.poses, sizes)
            touching |= set(np.array(traffic.ids)[hit])
    return touching


def test_drivers_creep_into_the_corner_of_an_ego_that_stands_askew_unless_its_body_is_as_wide_as_it_lies(
    tmp_path: Path,
) -> None:
    spec = SimulationSpec(demand=DemandSpec(flow_vph=1800, duration_s=200, truck_share=0.1))
    files = write_sumo_files(LAYOUT, tmp_path, spec=spec, seed=7)
    assert vehicles_that_touch_an_ego_askew(files, as_wide_as_it_lies=False)  # the trap: SUMO lays it along the lane
    assert not vehicles_that_touch_an_ego_askew(files, as_wide_as_it_lies=True)


def bodies(session: Session) -> Iterator[tuple[str, str, float, float, float]]:
    """(name, lane, lateral position in it, width, the lane's width) of the ego's bodies in SUMO."""
    api, lane_api = session._sumo.vehicle, session._sumo.lane
    for name in api.getIDList():
        if name.startswith(EGO_ID):
            lane = api.getLaneID(name)
            yield name, lane, api.getLateralLanePosition(name), api.getWidth(name), lane_api.getWidth(lane) if lane else 0.0


def test_body_without_a_lane_stays_inside_the_first_until_it_is_needed_again(
    files: SumoFiles, capfd: pytest.CaptureFixture[str]
) -> None:
    # Drivers remember the vehicles beside them until they act again: SUMO 1.28 crashed over bodies that had been removed, at
    # once or later, and over those that lay beside the road.
    with running(files.config, options=FINE) as session:
        api = session._sumo.vehicle
        *_, (state, traffic) = drive(session, files, y=LANE, duration_s=0.5)
        both = bodies_in_lanes(state, CAR, traffic, road=LAYOUT.road, edges=files.edges)
        known = {name for name, *_ in bodies(session)}
        assert len({lane for _, lane, *_ in bodies(session)}) == len(known) == 2
        for _ in range(45):
            session.place_ego(both[:1], speed=state.speed)
            session.step()
        assert {lane for _, lane, *_ in bodies(session)} == {f"{both[0].edge}_{both[0].lane_on_edge}"}
        assert {api.getPosition(name) for name in known} == {api.getPosition(EGO_ID)}
        assert min(width for *_, width, _ in bodies(session)) == pytest.approx(0.1)
        for _ in range(2):
            session.place_ego(both, speed=state.speed)
            session.step()
        assert {name for name, *_ in bodies(session)} == known
        assert len({lane for _, lane, *_ in bodies(session)}) == 2
    assert "implied speed" not in capfd.readouterr().err


def test_body_in_a_lane_beside_a_narrower_one_is_counted_to_its_own(tmp_path: Path) -> None:
    # Nearest to the body is the middle of the closing lane's remnant, 0.1 m wide in SUMO: in that it would be off the road.
    layout = paper_layout()
    spec = SimulationSpec(demand=DemandSpec(flow_vph=200, duration_s=60))
    closing = write_sumo_files(layout, tmp_path, spec=spec, seed=3)
    edge = next(edge for edge in closing.edges if len(edge.through_lanes) < len(edge.lanes))
    index = 1
    station = (edge.start + edge.end) / 2
    _, line = edge.lanes[index].lines(station)
    with running(closing.config, options=FINE) as session:
        session.request_ego(CAR, edges=ids_of(closing), lane=0, position=20.0, speed=10.0)
        while not session.has_ego():
            session.step()
        session.take_over_ego()
        front = np.array([station, line - 0.45, 0.0])
        for _ in range(2):
            body = LaneBody(lane=1, edge=edge.id, lane_on_edge=index, front=front, width=0.1)
            session.place_ego((body,), speed=0.0)
            session.step()
        assert session._sumo.vehicle.getLaneID(EGO_ID) == f"{edge.id}_{index}"


def test_no_body_of_an_ego_that_merges_in_traffic_ever_leaves_the_road_or_reaches_into_a_second_lane(tmp_path: Path) -> None:
    # SUMO 1.28 keeps a list of lanes for such a body, and has crashed over an old list after the body had lost its place.
    layout = lay_out(paper_work_zone(), bent_road(984.3))
    spec = SimulationSpec(demand=DemandSpec(flow_vph=3000, duration_s=120))
    bent = write_sumo_files(layout, tmp_path, spec=spec, seed=3)
    start, end = (layout.area(name).start for name in ("merging taper", "activity area"))
    speed = 20.0
    lanes: set[str] = set()
    with running(bent.config, options=FINE) as session:
        while session.time < 40:
            session.step()
        session.request_ego(CAR, edges=ids_of(bent), lane=2, position=start - 150.0, speed=speed)
        while not session.has_ego():
            session.step()
        session.take_over_ego()
        known = {EGO_ID}
        for station in np.arange(start - 150.0, end, 0.05 * speed):
            share = np.clip((station - (start - 100.0)) / 200.0, 0.0, 1.0)  # slowly over two lanes and back over one
            offset = LANE * (2.5 - 2 * share + np.clip((station - start - 150.0) / 60.0, 0.0, 1.0))
            x, y = layout.road.to_xy(station, offset)
            state = EgoState(x=x, y=y, heading=float(layout.road.heading_at(station)), speed=speed)
            session.place_ego(bodies_in_lanes(state, CAR, session.traffic(), road=layout.road, edges=bent.edges), speed=speed)
            for name, lane, aside, width, lane_width in bodies(session):  # as SUMO holds them while it steps
                assert lane or name not in known
                assert not lane or abs(aside) + width / 2 <= lane_width / 2 + 1e-6
            session.step()
            for name, lane, aside, width, lane_width in bodies(session):
                assert lane
                assert abs(aside) + width / 2 <= lane_width / 2 + 1e-6
                known.add(name)
                lanes.add(lane)
    assert len(lanes) > 8
    assert len(known) >= 2


def test_vehicles_types_and_routes_of_a_network_that_are_called_ego_are_traffic(files: SumoFiles, tmp_path: Path) -> None:
    first, last = files.edges[0].id, files.edges[-1].id
    demand = tmp_path / "ego.rou.xml"
    demand.write_text(
        f'<routes><vType id="ego" length="7"/><route id="ego" edges="{" ".join(ids_of(files))}"/>'
        f'<vehicle id="ego" type="ego" route="ego" depart="0"/><flow id="ego" from="{first}" to="{last}" begin="1" end="9" '
        'number="2" departLane="free"/></routes>'
    )
    with running(files.config, options=(*FINE, "--route-files", str(demand))) as session:
        while session.time < 12:
            session.step()
        session.request_ego(CAR, edges=ids_of(files), lane=1, position=300.0, speed=10.0)
        while not session.has_ego():
            session.step()
        assert set(session.traffic().ids) == {"ego", "ego.0", "ego.1"}
