"""What sumo-gui draws of a zone, and the view that it opens with. SUMO's vehicles do not see any of it."""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import shapely
import shapely.ops
from shapely.geometry.base import BaseGeometry

from wzsumo.simulation.drawing.sign_faces import write_arrow_board, write_device, write_sign_face
from wzsumo.simulation.network import write_xml
from wzsumo.work_zone import DeviceKind, RoadType, WorkZoneLayout

PICTURES = "signs"  # folder beside the drawing
OUTLINE_TOLERANCE_M = 0.01  # of a device's outline as it is drawn
Bounds = tuple[float, float, float, float]  # least x and y, greatest x and y [m]
_AREA_COLOURS = {"closed_area": "230,159,0,120", "drivable": "0,158,115,60"}  # Okabe-Ito orange, green
_SHOULDER_COLOUR = "150,150,150"
# Sizes of pictures, in metres of the map: large enough to be read where the window shows some 300 m. Chosen by us
SIGN_M, BOARD_M, DEVICE_M = 16.0, 16.0, 2.2
POST_COLOUR, DEVICE_COLOUR = "90,90,90", "213,94,0"
FIRST_PLACE_M, PLACES_APART_M = 10.0, 20.0  # of signs that stand ahead of the modelled road
VIEW_M, VIEW_AHEAD_M = 320.0, 130.0  # length that the view shows, and how much of it lies ahead of the first device
TIMES_AS_FAST_AS_LIFE = 2.0  # at which the window begins to show; chosen by us


def write_drawing(layout: WorkZoneLayout, path: Path, *, prefix: str = "") -> Path:
    """Write the zone as polygons and pictures that sumo-gui draws; returns the file's path. Pictures lie beside it in signs/.

    All ids begin with `prefix`, so that they are none of those which a network's own files use.

    Signs stand outside of the road, at the end of a post from their place, so that they hide nothing. Those ahead of the
    modelled road are drawn at its beginning; their ids say how far ahead they stand.
    """
    root = ET.Element("additional")
    pictures = path.parent / PICTURES
    pictures.mkdir(exist_ok=True)
    whole = layout.road.strip(0.0, layout.road.length, -layout.road.right_shoulder, layout.road.left_edge)
    for number, part in enumerate(_without_holes(whole)):
        _polygon(root, f"pavement_{number}", part, colour=_SHOULDER_COLOUR, layer=-2, kind="pavement")
    for name, colour in _AREA_COLOURS.items():
        area: BaseGeometry = getattr(layout, name)
        for number, part in enumerate(_without_holes(area)):
            _polygon(root, f"{name}_{number}", part, colour=colour, layer=-1, kind=name)
    for number, (kind, outline) in enumerate(zip(layout.devices["kind"], layout.device_outlines, strict=True)):
        simple = outline.simplify(OUTLINE_TOLERANCE_M)
        _polygon(root, f"device_{number:03d}", simple, colour=DEVICE_COLOUR, layer=5, kind=str(kind))
    _draw_devices(root, layout, pictures)
    _draw_signs(root, layout, pictures)
    if layout.work_zone.road_type is RoadType.FREEWAY:
        _draw_arrow_boards(root, layout, pictures)
    for item in root:
        item.set("id", f"{prefix}{item.get('id')}")
    write_xml(root, path)
    return path


def write_view(layout: WorkZoneLayout, path: Path, *, step_length: float, network: Bounds | None = None) -> Path:
    """Write sumo-gui's view of the zone: its beginning, slow enough to watch at this step [s], without marks at ends of edges.

    `network` says how far the network reaches; None where the road of the layout is all of it, with no junction to be drawn.
    """
    road, signals = layout.road, network is not None or layout.taking_turns is not None
    x, y = road.to_xy(layout.start + VIEW_M / 2 - VIEW_AHEAD_M, road.travelled_width / 2)
    whole = network or road.strip(0.0, road.length, -road.right_shoulder, road.left_edge).bounds
    zoom = 100 * max(whole[2] - whole[0], whole[3] - whole[1]) / VIEW_M  # 100: the whole net
    root = ET.Element("viewsettings")
    scheme = ET.SubElement(root, "scheme", name="work zone")
    ET.SubElement(scheme, "background", backgroundColor="235,240,230", showGrid="0")
    # Each piece of the zone is an edge: at its end SUMO would draw a stop line and arrows, which the road does not have.
    marks = {"showLinkDecals": "0", "showLinkRules": "1" if signals else "0", "laneShowBorders": "1"}
    ET.SubElement(scheme, "edges", marks)
    ET.SubElement(scheme, "vehicles", vehicleMode="0", vehicleQuality="2")
    ET.SubElement(scheme, "junctions", drawShape="0" if network is None else "1")
    ET.SubElement(root, "viewport", x=f"{float(x):.1f}", y=f"{float(y):.1f}", zoom=f"{zoom:.0f}")
    ET.SubElement(root, "delay", value=f"{1000 * step_length / TIMES_AS_FAST_AS_LIFE:.0f}")
    write_xml(root, path)
    return path


def _draw_devices(root: ET.Element, layout: WorkZoneLayout, pictures: Path) -> None:
    """A picture over each cone and drum, whose true outlines are too small to be seen; barriers are large enough."""
    for kind in sorted(set(layout.devices["kind"]) - {str(DeviceKind.BARRIER)}):
        write_device(pictures / f"{kind}.png", is_cone=kind != DeviceKind.DRUM)
    for number, device in enumerate(layout.devices.to_dict("records")):
        if device["kind"] != DeviceKind.BARRIER:
            place = (device["x_m"], device["y_m"])
            id_, file = f"picture_of_device_{number:03d}", f"{device['kind']}.png"
            _picture(root, id_, place, file, size=DEVICE_M, kind="device", layer=6)


def _draw_signs(root: ET.Element, layout: WorkZoneLayout, pictures: Path) -> None:
    road = layout.road
    signs = layout.signs.to_dict("records")
    ahead = sorted({sign["s_m"] for sign in signs if sign["s_m"] < 0})  # the farthest first
    for number, sign in enumerate(signs):
        station, id_ = sign["s_m"], f"sign_{number:02d}_{sign['text'].replace(' ', '_')}"
        if station < 0:
            drawn = FIRST_PLACE_M + PLACES_APART_M * ahead.index(station)
            id_ += f"_{drawn - station:.0f}_m_further_ahead"
            station = drawn
        elif station > road.length:
            station = road.length - FIRST_PLACE_M
        write_sign_face(sign["code"], sign["text"], pictures / f"{sign['code']}.png")
        _at_a_post(root, layout, id_, (station, sign["d_m"]), f"{sign['code']}.png", size=SIGN_M, kind=sign["code"])


def _draw_arrow_boards(root: ET.Element, layout: WorkZoneLayout, pictures: Path) -> None:
    """An arrow board for each closed lane of a freeway, at the beginning of its merging taper.

    The first stands on the shoulder, the next in the lane that is closed already. Source: MUTCD, notes to the typical
    applications 33 and 37.
    """
    road = layout.road
    tapers = [area for area in layout.areas if area.name.startswith("merging taper")]
    for number, taper in enumerate(tapers):
        edges = layout.drivable_right, layout.drivable_left
        right, left = (np.abs(np.diff(edge([taper.start, taper.end])))[0] for edge in edges)
        closes_right = bool(right > left)
        if number:
            offset = road.lane_centre(number - 1 if closes_right else road.own_lanes - number)
        else:
            offset = -road.right_shoulder / 2 if closes_right else (road.left_edge + road.travelled_width) / 2
        name = "arrow_board_left.png" if closes_right else "arrow_board_right.png"
        write_arrow_board(pictures / name, to_the_left=closes_right)
        _at_a_post(root, layout, f"arrow_board_{number}", (taper.start, offset), name, size=BOARD_M, kind="arrow board")


def _at_a_post(
    root: ET.Element, layout: WorkZoneLayout, id_: str, place: tuple[float, float], picture: str, *, size: float, kind: str
) -> None:
    """Draw a picture outside of the road, and a post from the place (station, offset) where it stands to it."""
    road, (station, offset) = layout.road, place
    is_left = offset > road.travelled_width / 2
    out = road.left_edge + size if is_left else -road.right_shoulder - size
    foot, top = (road.to_xy(station, d) for d in (offset, out))
    post = shapely.LineString([foot, top]).buffer(0.12, cap_style="flat")
    _polygon(root, f"{id_}_post", post, colour=POST_COLOUR, layer=5, kind="post")
    _picture(root, id_, (float(top[0]), float(top[1])), picture, size=size, kind=kind, layer=7)


def _picture(root: ET.Element, id_: str, place: tuple[float, float], file: str, *, size: float, kind: str, layer: int) -> None:
    values = {"id": id_, "type": kind, "color": "255,255,255", "layer": str(layer), "imgFile": f"{PICTURES}/{file}"}
    measures = {"x": f"{place[0]:.3f}", "y": f"{place[1]:.3f}", "width": f"{size:g}", "height": f"{size:g}"}
    ET.SubElement(root, "poi", values | measures)


def _polygon(root: ET.Element, id_: str, polygon: shapely.Polygon, *, colour: str, layer: int, kind: str) -> None:
    shape = " ".join(f"{x:.3f},{y:.3f}" for x, y in polygon.exterior.coords)
    ET.SubElement(root, "poly", id=id_, color=colour, fill="1", layer=str(layer), shape=shape, type=kind)


def _without_holes(area: BaseGeometry) -> list[shapely.Polygon]:
    """The same ground as polygons without holes, which SUMO cannot draw: each is cut in two through its first hole."""
    parts = []
    for polygon in getattr(area, "geoms", [area]):
        if polygon.interiors:
            x, (_, lowest, _, highest) = polygon.interiors[0].centroid.x, polygon.bounds
            cut = shapely.LineString([(x, lowest - 1), (x, highest + 1)])
            parts += _without_holes(shapely.ops.split(polygon, cut))
        else:
            parts.append(polygon)
    return parts
