"""What SUMO does with an ego that moveToXY places: one test for each way in which it goes wrong if it is done naively."""

import numpy as np
import pytest
from builders import bent_road, paper_layout, paper_work_zone

from wzsumo.ego import EgoState
from wzsumo.frames import advance
from wzsumo.metrics.conflicts import boxes_overlap
from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.files import SimulationSpec, write_sumo_files
from wzsumo.simulation.session import EGO_ID, Intrusion, running
from wzsumo.study.lane_intrusion import seen_by_others
from wzsumo.vehicle import VehicleGeometry

LAYOUT = paper_layout(start_ft=3800, work_length_ft=100, closed_lanes=(), shift_ft=0, shifted_lane_width_ft=None)
CAR = VehicleGeometry()
LANE = 12 * 0.3048
FINE = ("--step-length", "0.05", "--default.action-step-length", "0.1")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    spec = SimulationSpec(demand=DemandSpec(flow_vph=1800, duration_s=200, truck_share=0.1))
    return write_sumo_files(LAYOUT, tmp_path_factory.mktemp("session"), spec=spec, seed=3)


def drive(session, files, *, y, x=250.0, speed=10.0, duration_s=5.0, step_s=0.05, shown=True):
    """Yield (state, traffic) after each step of an ego that goes straight ahead at y."""
    lane = int(np.clip(y // LANE, 0, 2))
    session.request_ego(CAR, edge=files.edges[0].id, lane=lane, position=x + CAR.axle_to_bumper_m, speed=speed)
    while not session.has_ego():
        session.step()
    session.take_over_ego()
    traffic = session.traffic()
    for step in range(1, int(duration_s / step_s) + 1):
        state = EgoState(x=x + speed * step_s * step, y=y, heading=0.0, speed=speed)
        seen = seen_by_others(state, CAR, traffic, road=LAYOUT.road, edges=files.edges)
        session.place_ego(state, CAR, intrusions=seen.intrusions if shown else ())
        session.step()
        traffic = session.traffic()
        yield state, traffic


def sumo_bumper(session):
    return np.array(session._sumo.vehicle.getPosition(EGO_ID))


@pytest.mark.parametrize("y", [1.5 * LANE, 1.5 * LANE + 0.9, LANE], ids=["lane centre", "beside it", "on the line"])
def test_front_bumper_is_exactly_where_it_was_put_and_not_snapped_to_a_lane(files, y):
    with running(files.config, options=FINE) as session:
        for state, _ in drive(session, files, y=y, duration_s=1.0):
            assert sumo_bumper(session) == pytest.approx(advance(state.pose, CAR.axle_to_bumper_m)[:2], abs=1e-3)


def test_ego_on_the_shoulder_does_not_vanish(files):
    with running(files.config, options=FINE) as session:
        for _ in drive(session, files, y=-1.6, duration_s=1.0):
            assert session.has_ego()
        assert sumo_bumper(session)[1] == pytest.approx(-1.6, abs=1e-3)


def test_speed_that_sumo_sees_has_no_spikes(files):
    with running(files.config, options=FINE) as session:
        for _ in drive(session, files, y=1.5 * LANE, duration_s=3.0):
            assert session._sumo.vehicle.getSpeed(EGO_ID) == pytest.approx(10.0, abs=1e-6)


def test_ego_crosses_every_junction_of_the_zone(files):
    roads = []
    with running(files.config, options=FINE) as session:
        for _ in drive(session, files, y=0.5 * LANE, x=1000.0, speed=25.0, duration_s=15.0):
            road = session._sumo.vehicle.getRoadID(EGO_ID)
            assert sumo_bumper(session)[1] == pytest.approx(0.5 * LANE, abs=1e-3)
            if not road.startswith(":") and road not in roads:
                roads.append(road)
    reached = [edge.id for edge in files.edges if edge.end > 1010 and edge.start < 1370]
    assert len(reached) == 3
    assert roads == reached


@pytest.mark.parametrize("radius_ft", [984.3, -984.3], ids=["left", "right"])
def test_ego_on_the_outer_side_of_a_kink_between_two_edges_is_counted_to_the_lane_that_it_is_in(tmp_path, radius_ft):
    layout = lay_out(paper_work_zone(), bent_road(radius_ft))
    spec = SimulationSpec(demand=DemandSpec(flow_vph=200, duration_s=60))
    bent = write_sumo_files(layout, tmp_path, spec=spec, seed=3)
    with running(bent.config, options=FINE) as session:
        session.request_ego(CAR, edge=bent.edges[0].id, lane=0, position=20.0, speed=10.0)
        while not session.has_ego():
            session.step()
        session.take_over_ego()
        kinks = list(outer_sides_of_kinks(session._sumo.lane, bent.edges, aside_m=0.7))
        assert len(kinks) >= 8
        for lanes, bumper in kinks:
            for before_m in (0.5, 0.0):
                x, y, heading = advance(bumper, -before_m - CAR.axle_to_bumper_m)
                session.place_ego(EgoState(x=x, y=y, heading=heading, speed=10.0), CAR)
                session.step()
            assert session._sumo.vehicle.getLaneID(EGO_ID) in lanes


def outer_sides_of_kinks(lane_api, edges, *, aside_m):
    """Of each lane that bends where its edge ends: the lanes that meet there, and a pose in the wedge that none runs past."""
    for edge in edges[:-1]:
        for lane in [f"{edge.id}_{index}" for index in range(len(edge.lanes))]:
            for following, *_, across_the_node, _, _, _ in lane_api.getLinks(lane):
                ends = np.array(lane_api.getShape(lane)[-2:])
                goes_on = np.array(lane_api.getShape(following)[:2])
                before, after = (np.arctan2(*np.diff(line, axis=0)[0, ::-1]) for line in (ends, goes_on))
                if 0.005 < abs(after - before) < 0.1:
                    heading = (before + after) / 2
                    outwards = heading - np.sign(after - before) * np.pi / 2
                    aside = aside_m * np.array([np.cos(outwards), np.sin(outwards)])
                    yield {lane, across_the_node, following}, np.array([*(ends[-1] + aside), heading])


def passers_through(files, *, shown):
    """Number of vehicles that pass an ego which straddles a line for 60 s, and of those whose outline overlaps its own."""
    passed, overlapped, was_behind = set(), set(), set()
    with running(files.config) as session:
        while session.time < 60:
            session.step()
        for state, traffic in drive(session, files, y=LANE, x=150.0, duration_s=60, step_s=0.1, shown=shown):
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


def test_drivers_pass_through_a_straddling_ego_unless_it_is_shown_in_both_lanes(files):
    passed, overlapped = passers_through(files, shown=False)
    assert passed >= 10
    assert overlapped >= 2  # the trap: SUMO counts the ego to one lane
    passed, overlapped = passers_through(files, shown=True)
    assert passed >= 5
    assert overlapped == 0


def who_touches_an_ego_that_stands_askew(files, *, wide):
    """Ids of those whose outline overlaps an ego that has stopped 0.7 m beside the middle of its lane, turned by 7 degrees."""
    x, speed, touching = 250.0, 10.0, set()
    with running(files.config, options=FINE) as session:
        while session.time < 40:
            session.step()
        session.request_ego(CAR, edge=files.edges[0].id, lane=1, position=x + CAR.axle_to_bumper_m, speed=speed)
        while not session.has_ego():
            session.step()
        session.take_over_ego()
        traffic = session.traffic()
        while session.time < 85:
            speed = max(speed - 0.1, 0.0)
            x += 0.05 * speed
            state = EgoState(x=x, y=1.5 * LANE + 0.7, heading=0.12, speed=speed)
            seen = seen_by_others(state, CAR, traffic, road=LAYOUT.road, edges=files.edges)
            session.place_ego(state, CAR, width=seen.width if wide else None, intrusions=seen.intrusions)
            session.step()
            traffic = session.traffic()
            sizes = np.column_stack([traffic.lengths, traffic.widths])
            centre = advance(state.pose, CAR.axle_to_centre_m)
            hit = boxes_overlap(centre, np.array([CAR.length_m, CAR.width_m]), traffic.poses, sizes)
            touching |= set(np.array(traffic.ids)[hit])
    return touching


def test_drivers_creep_into_the_corner_of_an_ego_that_stands_askew_unless_it_is_shown_as_wide_as_it_lies(files):
    assert who_touches_an_ego_that_stands_askew(files, wide=False)  # the trap: SUMO lays it along the lane
    assert not who_touches_an_ego_that_stands_askew(files, wide=True)


def test_stand_in_that_nobody_needs_rides_inside_the_ego_until_it_is_needed_again(files, capfd):
    # Drivers keep whom they saw beside them until they act again: SUMO 1.28 crashed over stand-ins that had been removed, at
    # once or later, and over those that lay beside the road.
    with running(files.config, options=FINE) as session:
        api, stand_in = session._sumo.vehicle, f"{EGO_ID}.1"
        *_, (state, _) = drive(session, files, y=LANE, duration_s=0.5)
        assert api.getLaneID(stand_in) != api.getLaneID(EGO_ID)
        for _ in range(45):
            session.place_ego(state, CAR)
            session.step()
            assert api.getLaneID(stand_in) == api.getLaneID(EGO_ID)
            assert np.hypot(*np.subtract(api.getPosition(stand_in), api.getPosition(EGO_ID))) < 0.2
        known, front = api.getIDList(), advance(state.pose, CAR.axle_to_bumper_m)
        session.place_ego(state, CAR, intrusions=(Intrusion(lane=0, front=front - [0.0, 1.0, 0.0], width=0.5),))
        session.step()
        assert {name for name in api.getIDList() if name.startswith(EGO_ID)} <= set(known)
        assert sum(api.getLaneID(name) != api.getLaneID(EGO_ID) for name in known if name.startswith(EGO_ID)) == 1
    assert "implied speed" not in capfd.readouterr().err
