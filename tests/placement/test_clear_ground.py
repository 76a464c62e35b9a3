"""The closed ground keeps clear of vehicles on bends, within edges and where lanes meet, as SUMO itself drives them."""

import functools
import subprocess
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest
import shapely
from placement.networks import netconvert, new_folder, placed_on_freeway, zone
from sumo_runs import outlines_in

from wzsumo.errors import PlacementError
from wzsumo.frames import FloatArray
from wzsumo.placement import placement
from wzsumo.placement.configuration import Configuration
from wzsumo.placement.demand_files.vehicle_sizes import CARS, VehicleSize
from wzsumo.placement.ground.driven_lanes import DrivenLane, driven_lanes
from wzsumo.placement.ground.swept import vehicles_along
from wzsumo.placement.net import Net
from wzsumo.placement.placement import Placed, place_zone, write_placement
from wzsumo.simulation.connection import sumo_binary
from wzsumo.work_zone import WorkZoneLayout

BEND_M = 500.0  # from the beginning of the road
# Length and width [m] of the demand's types; of those with a trailer, of the part whose heading SUMO writes.
SIZES = {"car": (5.0, 1.8), "coach": (14.0, 2.6), "articulated": (9.25, 2.55), "short": (9.25, 2.55)}
NAMES = {5.0: "car", 14.0: "coach", 16.5: "articulated", 10.0: "short"}  # by their whole length
DEMAND = """<routes>
    <vType id="car"/> <vType id="coach" vClass="coach"/> <vType id="articulated" vClass="trailer"/>
    <vType id="short" vClass="trailer" length="10"/>
    {flows}
</routes>"""


@functools.cache
def bent_road(turn_deg: float, *, within: bool) -> Configuration:
    """Two lanes that bend once, to the left where `turn_deg` > 0: within one edge, or at a node without internal lanes."""
    folder, turn = new_folder(), np.deg2rad(turn_deg)
    x, y = (np.array([[BEND_M], [0.0]]) + np.outer([np.cos(turn), np.sin(turn)], [500.0, 800.0])).round(2)
    nodes = f'<node id="a" x="0" y="0"/> <node id="c" x="{x[0]}" y="{y[0]}"/> <node id="d" x="{x[1]}" y="{y[1]}"/>'
    nodes += "" if within else f'<node id="b" x="{BEND_M}" y="0"/>'
    common = 'numLanes="2" speed="16"'
    edges = f'<edge id="g" from="c" to="d" {common}/>' + (
        f'<edge id="e" from="a" to="c" {common} shape="0,0 {BEND_M},0 {x[0]},{y[0]}"/>'
        if within
        else f'<edge id="e" from="a" to="b" {common}/> <edge id="f" from="b" to="c" {common}/>'
    )
    route = "e g" if within else "e f g"
    flows = "\n".join(
        f'<flow id="{name}" type="{name}" begin="0" end="90" period="6" departLane="random" departSpeed="max">'
        f'<route edges="{route}"/></flow>'
        for name in SIZES
    )
    (folder / "small.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    (folder / "small.edg.xml").write_text(f"<edges>{edges}</edges>")
    (folder / "demand.rou.xml").write_text(DEMAND.format(flows=flows))
    plain = ("-n", str(folder / "small.nod.xml"), "-e", str(folder / "small.edg.xml"))
    options = () if within else ("--no-internal-links",)
    return Configuration.of_files(netconvert(folder, *plain, *options), [folder / "demand.rou.xml"], [])


def placed_at_bend(configuration: Configuration, lane: int, sizes: frozenset[VehicleSize] | None = None) -> Placed:
    """A zone whose work space lies at the bend."""
    wanted = zone(closed_lanes=[lane], work_length_ft=300, posted_speed_mph=25)
    sizes = configuration.vehicle_sizes if sizes is None else sizes
    return place_zone(Net.read(configuration.net), wanted, edge_id="e", position=BEND_M - 120, sizes=sizes)


def driven(configuration: Configuration, placed: Placed) -> pd.DataFrame:
    """SUMO's FCD of the closed network, with the outline of each vehicle by its type's size."""
    folder = new_folder()
    write_placement(placed, configuration, folder / "placed")
    fcd = folder / "fcd.csv"
    words = ("--fcd-output", str(fcd), "--step-length", "0.2", "--end", "160", "--xml-validation", "never", "--no-step-log")
    config = folder / "placed" / "closed" / "run.sumocfg"
    subprocess.run([str(sumo_binary("sumo")), "-c", str(config), *words], check=True, capture_output=True)
    rows = pd.read_csv(fcd, sep=";").rename(columns=lambda column: column.split("_", 1)[1])
    rows = rows[rows["id"].notna()].reset_index(drop=True)
    rows["outline"] = None
    for name, (length, width) in SIZES.items():
        own = rows["type"] == name
        rows.loc[own, "outline"] = outlines_in(rows[own], length=length, width=width)
    return rows


@pytest.mark.parametrize("lane", [0, 1], ids=["right lane closed", "left lane closed"])
@pytest.mark.parametrize(("within", "turn_deg"), [(True, 35.0), (True, -25.0), (False, 22.0), (False, -18.0)])
def test_no_vehicle_of_any_class_swings_over_the_closed_ground_at_a_bend(
    within: bool, turn_deg: float, lane: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    configuration = bent_road(turn_deg, within=within)
    placed = placed_at_bend(configuration, lane)
    rows = driven(configuration, placed)
    assert set(rows["type"]) == set(SIZES)
    assert not placed.layout.closed_area.buffer(-0.1).intersects(rows["outline"]).any()
    monkeypatch.setattr(placement, "with_clear_ground", lambda plan, _closed, _sizes: (plan, []))
    before = placed_at_bend(configuration, lane).layout
    swung = bool(before.closed_area.buffer(-0.1).intersects(rows["outline"]).any())
    assert any("drawn back" in doubt for doubt in placed.doubts) == swung
    inner_side_is_open = (turn_deg > 0) == (lane == 0)
    assert swung or inner_side_is_open  # the closed lane on the inner side is what a body cuts across
    _check_line(before, placed)


def _check_line(before: WorkZoneLayout, placed: Placed) -> None:
    """The ground is smaller near the bend alone, half of it is left, and devices stand along its edge, all of them."""
    layout, taken = placed.layout, before.closed_area.difference(placed.layout.closed_area)
    assert placed.layout.closed_area.difference(before.closed_area).area < 0.01
    assert len(layout.devices) == len(before.devices)
    on_ground, were = (shapely.area(shapely.intersection(one.device_outlines, one.closed_area)) for one in (layout, before))
    assert (on_ground >= 0.9 * were).all()  # at the tips of tapers the ground is narrower than a device
    assert shapely.distance(layout.closed_area.boundary, layout.device_outlines).max() < 0.1
    assert layout.drivable.intersection(layout.closed_area).area < 0.01
    assert layout.drivable.area - before.drivable.area == pytest.approx(taken.area, abs=0.01)
    if not taken.is_empty:
        parts = shapely.get_parts(taken)
        s, _ = layout.road.to_sd(shapely.get_coordinates(parts[shapely.area(parts) > 0.01]))
        assert np.ptp(s) < 80
        assert layout.closed_area.area > 0.8 * before.closed_area.area


def test_vehicles_are_where_sumo_has_them() -> None:
    for within, turn_deg in ((True, 35.0), (False, 22.0)):
        configuration = bent_road(turn_deg, within=within)
        placed = placed_at_bend(configuration, 1)
        rows = driven(configuration, placed)
        lanes = driven_lanes(placed.plan, placed.closed)
        near = rows[np.hypot(rows["x"] - BEND_M, rows["y"]) < 30]
        n_checked = 0
        for size in configuration.vehicle_sizes:
            for lane_id, own in near[near["type"] == NAMES[size.length]].groupby("lane"):
                swept = shapely.union_all(
                    [o for way in lanes.ways_to(str(lane_id), size.length) for o in vehicles_along(way, size)]
                )
                outside = shapely.area(shapely.difference(np.array(own["outline"].tolist()), swept.buffer(0.05)))
                assert outside.max() < 0.01, (size, lane_id)
                n_checked += len(own)
        assert n_checked > 100


def test_headings_are_those_that_sumo_writes() -> None:
    configuration = bent_road(35.0, within=True)
    placed = placed_at_bend(configuration, 1)
    lanes, rows = driven_lanes(placed.plan, placed.closed), driven(configuration, placed)
    rows = rows[np.hypot(rows["x"] - BEND_M, rows["y"]) < 15]
    for size in configuration.vehicle_sizes:
        first_part = replace(size, length=size.first_part)
        for lane_id, own in rows[rows["type"] == NAMES[size.length]].groupby("lane"):
            (way,) = lanes.ways_to(str(lane_id), size.length)
            front, back = noses_and_tails(vehicles_along(way, first_part))
            heading = 90.0 - np.rad2deg(np.arctan2(*(front - back).T[::-1]))
            nearest = np.hypot(*(own[["x", "y"]].to_numpy()[:, None] - front).T).argmin(axis=0)
            assert len(own) > 20
            assert np.abs(heading[nearest] - own["angle"]).max() < 1.0  # a quarter of a metre apart


def noses_and_tails(outlines: npt.NDArray[np.object_]) -> tuple[FloatArray, FloatArray]:
    """The middles (n, 2) of the front and back edges of vehicles."""
    corners = shapely.get_coordinates(outlines).reshape(-1, 5, 2)
    return corners[:, :2].mean(axis=1), corners[:, 2:4].mean(axis=1)


@pytest.mark.parametrize(("lane_length", "back_m"), [(40.0, 15.0), (20.0, 5.0)], ids=["as its shape", "half its shape"])
def test_rigid_vehicle_on_a_corner_lies_along_its_chord(lane_length: float, back_m: float) -> None:
    lane = DrivenLane(id="a", points=np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0]]), length=lane_length, attributes={})
    size = VehicleSize(vehicle_class="coach", length=10.0, width=2.0, first_part=10.0)
    front, back = noses_and_tails(vehicles_along((lane,), size))
    at = np.hypot(front[:, 0] - 20.0, front[:, 1] - 5.0).argmin()  # 5 m past the corner by the shape
    chord = np.array([20.0, 5.0]) - [back_m, 0.0]
    assert front[at] - back[at] == pytest.approx(chord / np.hypot(*chord) * 10.0, abs=1e-3)


def test_only_sizes_of_the_demand_draw_the_line_back() -> None:
    configuration = bent_road(35.0, within=True)
    by_cars, by_all = (placed_at_bend(configuration, 1, sizes).layout for sizes in (CARS, configuration.vehicle_sizes))
    assert by_cars.closed_area.area - by_all.closed_area.area > 2.0


def test_bend_too_sharp_for_what_the_ground_leaves_is_refused() -> None:
    configuration = bent_road(35.0, within=True)
    longest = next(size for size in configuration.vehicle_sizes if size.length == 14.0)
    with pytest.raises(PlacementError, match=r"coach vehicles, 30 m long, on lane 'e.wz.*would swing over"):
        placed_at_bend(configuration, 1, frozenset({replace(longest, length=30.0, first_part=30.0)}))


def test_ground_beside_a_straight_lane_is_as_the_manual_lays_it_out() -> None:
    assert placed_on_freeway("m3", 300.0, closed_lanes=[2]).doubts == ()
