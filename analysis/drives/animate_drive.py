"""A moving picture of a drive, drawn from a run's folder: lane lines, devices, the traffic, the ego and its planned path.

    wzsumo run scenarios/paper.toml --seed 21 --method lanes --out DIR
    python analysis/drives/animate_drive.py DIR --out docs/results/paper_drive.gif [--from 520 --to 1180] [--times 3]

Above, the zone from end to end, its offsets stretched, with the ego's place. Below, what is around the ego, to scale; brake
lights are red, the ego is blue, its planned path is the line ahead of it, and where it drove lies behind.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import shapely
from PIL import Image, ImageColor, ImageDraw, ImageFont

from wzsumo.figures.lane_lines import lane_lines
from wzsumo.figures.road_coordinates import area_in_road_coordinates
from wzsumo.files.result_folder import ResultFolder, read_result_folder
from wzsumo.frames import FloatArray, advance

WIDTH, HEIGHT, SMOOTH = 840, 250, 2  # pixels; drawn SMOOTH times as large and made smaller, which smooths the edges
FRAMES_PER_S = 12.5
SEEN_M, BEHIND_SHARE = 150.0, 0.36  # of the road in the lower picture; share of it behind the ego
OVERVIEW = (44, 104)  # rows of the upper picture [pixels]
MARGIN_M = 30.0  # around the zone in the upper picture
BRAKING_MPS2 = 0.7  # brake lights: UNECE R13-H
PAVEMENT, VERGE, CLOSED = "#5B5F66", "#DDE5D6", "#B9A58A"
LINE, DEVICE, OTHER, BRAKES = "#F2F2F2", "#FF7A00", "#E3E6EA", "#E0231C"
EGO, PATH, TRAIL, INK = "#1F78FF", "#7FD3FF", "#2E4D7A", "#20242B"
WINDSCREEN, OUTLINE, FRAME = "#3A4350", "#30343B", "#8A8F98"


@dataclass(frozen=True)
class View:
    """Pixels of stations and offsets: the lower left corner of a picture and pixels a metre, both ways."""

    left: float
    bottom: float
    station: float
    offset: float
    along: float
    across: float

    def __call__(self, points: FloatArray) -> list[tuple[float, float]]:
        """Pixels of (station, offset) points (n, 2)."""
        x = self.left + self.along * (points[:, 0] - self.station)
        y = self.bottom - self.across * (points[:, 1] - self.offset)
        return list(zip((SMOOTH * x).tolist(), (SMOOTH * y).tolist(), strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder of `wzsumo run`")
    parser.add_argument("--method", default="lanes", help="the map whose drive is shown")
    parser.add_argument("--from", dest="start", type=float, default=520.0, help="station of the ego in the first frame [m]")
    parser.add_argument("--to", dest="end", type=float, default=1180.0, help="station of the ego in the last frame [m]")
    parser.add_argument("--times", type=float, default=3.0, help="how many times as fast as it was")
    parser.add_argument("--out", type=Path, required=True, help="a .gif or .png (animated) file")
    args = parser.parse_args()
    run = read_result_folder(args.run)
    colours = palette()
    frames = [
        picture.quantize(palette=colours, dither=Image.Dither.NONE)
        for picture in pictures(run, args.method, start=args.start, end=args.end, times=args.times)
    ]
    frames[0].save(args.out, save_all=True, append_images=frames[1:], duration=1000 / FRAMES_PER_S, loop=0, optimize=True)
    print(f"{args.out}: {len(frames)} frames, {args.out.stat().st_size / 1e6:.2f} MB")


def pictures(run: ResultFolder, method: str, *, start: float, end: float, times: float) -> Iterator[Image.Image]:
    """The frames, from the ego's station `start` to `end` [m]."""
    log, traffic, path = run.drive_of(method), run.drive_traffic_of(method), run.path_of(method)
    if log is None or traffic is None or path is None:
        raise SystemExit(f"{run.folder}: no drive on a map of {method}")
    poses = advance(log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float), run.vehicle.axle_to_centre_m)
    driven = np.column_stack(run.road.to_sd(poses[:, :2]))
    planned = np.column_stack(run.road.to_sd(path[["x_m", "y_m"]].to_numpy(dtype=float)))
    traffic = with_brakes(traffic)
    behind = background(run, planned)
    time = log["time_s"].to_numpy(dtype=float)
    began, ended = (float(np.interp(place, driven[:, 0], time)) for place in (start, end))
    columns = ["x_m", "y_m", "heading_rad", "length_m", "width_m", "braking"]
    by_time = {float(str(at)): part[columns] for at, part in traffic.groupby(traffic["time_s"].round(1))}
    nobody = traffic[columns].iloc[:0]
    for now in np.arange(began, ended, times / FRAMES_PER_S):
        at = int(np.searchsorted(time, now))
        ego = outline(run, poses[at], length=run.vehicle.length_m, width=run.vehicle.width_m)
        others = [
            (outline(run, np.array([x, y, heading]), length=length, width=width), bool(braking))
            for x, y, heading, length, width, braking in by_time.get(round(float(now), 1), nobody).to_numpy(dtype=float)
        ]
        words = f"{log['speed_mps'].iloc[at]:.0f} m/s, {times:g} times as fast as it was"
        yield frame(run, behind, ego=ego, others=others, driven=driven[: at + 1], planned=planned, words=words)


def palette() -> Image.Image:
    """The colours of every frame: those above, and those between neighbours, which smooth the edges."""
    grounds = (PAVEMENT, VERGE, CLOSED, "#FFFFFF")
    on_them = (LINE, DEVICE, OTHER, BRAKES, EGO, PATH, TRAIL, INK, OUTLINE)
    pairs = [(a, b) for a in grounds for b in (*grounds, *on_them) if a != b] + [
        (OTHER, OUTLINE),
        (EGO, OUTLINE),
        (OTHER, WINDSCREEN),
    ]
    base = [ImageColor.getrgb(colour) for colour in (*grounds, *on_them, WINDSCREEN, FRAME)]
    between = [
        tuple(round((1 - share) * x + share * y) for x, y in zip(ImageColor.getrgb(a), ImageColor.getrgb(b), strict=True))
        for share in (0.35, 0.7)
        for a, b in pairs
    ]
    flat = [value for colour in dict.fromkeys([*base, *between]) for value in colour][: 3 * 128]
    picture = Image.new("P", (1, 1))
    picture.putpalette(flat)
    return picture


def with_brakes(traffic: pd.DataFrame) -> pd.DataFrame:
    """The traffic with whether each vehicle brakes, over half a second."""
    traffic = traffic.sort_values(["vehicle_id", "time_s"], kind="stable")
    gained = traffic.groupby("vehicle_id")[["speed_mps", "time_s"]].diff(5)
    return traffic.assign(braking=(gained["speed_mps"] / gained["time_s"]) <= -BRAKING_MPS2)


def outline(run: ResultFolder, pose: FloatArray, *, length: float, width: float) -> FloatArray:
    """Corners (4, 2) [station, offset] of a vehicle, front left first, of the pose (x, y, heading) of its centre."""
    ahead = np.array([np.cos(pose[2]), np.sin(pose[2])])
    aside = np.array([-ahead[1], ahead[0]])
    signs = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    corners = pose[:2] + signs[:, :1] * length / 2 * ahead + signs[:, 1:] * width / 2 * aside
    return np.column_stack(run.road.to_sd(corners))


def view_of_zone(run: ResultFolder) -> View:
    """The whole zone in the upper picture, its offsets stretched."""
    start, end = run.span[0] - MARGIN_M, run.span[1] + MARGIN_M
    low, high = -run.road.right_shoulder, run.road.left_edge
    top, bottom = OVERVIEW
    return View(0, bottom, start, low, WIDTH / (end - start), (bottom - top) / (high - low))


def view_around(run: ResultFolder, station: float) -> View:
    """The road around a station, to scale."""
    scale = WIDTH / SEEN_M
    return View(0, HEIGHT - 16, station - BEHIND_SHARE * SEEN_M, -run.road.right_shoulder, scale, scale)


def background(run: ResultFolder, planned: FloatArray) -> Image.Image:
    """The upper picture without the ego, and the legend."""
    picture = Image.new("RGB", (SMOOTH * WIDTH, SMOOTH * HEIGHT), "white")
    draw = ImageDraw.Draw(picture)
    draw_road(run, draw, view_of_zone(run), detail=False)
    start, end = run.span[0] - MARGIN_M, run.span[1] + MARGIN_M
    draw.line(view_of_zone(run)(planned[(planned[:, 0] > start) & (planned[:, 0] < end)]), fill=PATH, width=2 * SMOOTH)
    place = 16
    for colour, words in (
        (EGO, "ego"),
        (PATH, "planned path"),
        (OTHER, "traffic"),
        (BRAKES, "brakes"),
        (DEVICE, "devices"),
        (CLOSED, "closed"),
    ):
        draw.rectangle([SMOOTH * place, SMOOTH * 14, SMOOTH * (place + 12), SMOOTH * 26], fill=colour, outline=FRAME)
        draw.text((SMOOTH * (place + 17), SMOOTH * 12), words, fill=INK, font=font(13))
        place += 30 + int(draw.textlength(words, font=font(13)) / SMOOTH) + 8
    return picture


def frame(
    run: ResultFolder,
    behind: Image.Image,
    *,
    ego: FloatArray,
    others: list[tuple[FloatArray, bool]],
    driven: FloatArray,
    planned: FloatArray,
    words: str,
) -> Image.Image:
    """One picture."""
    picture = behind.copy()
    draw = ImageDraw.Draw(picture)
    station, offset = ego.mean(axis=0)
    (place,) = view_of_zone(run)(np.array([[station, offset]]))
    draw.ellipse([place[0] - 10, place[1] - 10, place[0] + 10, place[1] + 10], fill=EGO, outline="white", width=3)
    draw.text((SMOOTH * (WIDTH - 16), SMOOTH * 12), words, fill=INK, font=font(13), anchor="ra")
    view = view_around(run, station)
    draw_road(run, draw, view, detail=True)
    seen = (station - SEEN_M, station + SEEN_M)
    for line, colour in ((driven, TRAIL), (planned[planned[:, 0] > station], PATH)):
        near = line[(line[:, 0] > seen[0]) & (line[:, 0] < seen[1])]
        if len(near) > 1:
            draw.line(view(near), fill=colour, width=3 * SMOOTH, joint="curve")
    for corners, braking in others:
        draw_vehicle(draw, view, corners, colour=OTHER, braking=braking)
    draw_vehicle(draw, view, ego, colour=EGO, braking=False)
    return picture.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def draw_road(run: ResultFolder, draw: ImageDraw.ImageDraw, view: View, *, detail: bool) -> None:
    """Pavement, closed area, lane lines and devices."""
    low, high = -run.road.right_shoulder, run.road.left_edge
    left, right = view.station, view.station + WIDTH / view.along
    window = shapely.box(left, low - 2, right, high + 2)
    if detail:
        draw.polygon(view(np.array([[left, low - 3], [right, low - 3], [right, high + 2], [left, high + 2]])), fill=VERGE)
    draw.polygon(view(np.array([[left, low], [right, low], [right, high], [left, high]])), fill=PAVEMENT)
    closed = shapely.intersection(area_in_road_coordinates(run.polygons["closed_area"], run.road), window)
    for part in getattr(closed, "geoms", [closed]):
        if isinstance(part, shapely.Polygon) and not part.is_empty:
            draw.polygon(view(shapely.get_coordinates(part.exterior)), fill=CLOSED)
    for line in lane_lines(run):
        points = np.column_stack([line.stations, line.offsets])
        if line.kind == "lane" and detail:
            for station in np.arange(np.ceil(max(left, points[0, 0]) / 12) * 12, min(right, points[-1, 0]), 12.0):
                dash = station + np.array([0.0, 3.0])  # 10 ft every 40 ft: MUTCD 3A.04
                draw.line(view(np.column_stack([dash, np.interp(dash, *points.T)])), fill=LINE, width=SMOOTH)
        elif line.kind != "lane":
            near = points[(points[:, 0] > left - 10) & (points[:, 0] < right + 10)]
            if len(near) > 1:
                draw.line(view(near), fill=LINE, width=SMOOTH if detail else 1)
    places = np.column_stack(run.road.to_sd(run.devices[["x_m", "y_m"]].to_numpy(dtype=float)))
    radius = SMOOTH * (3.0 if detail else 1.0)
    for x, y in view(places[(places[:, 0] > left) & (places[:, 0] < right)]):
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=DEVICE)


def draw_vehicle(draw: ImageDraw.ImageDraw, view: View, corners: FloatArray, *, colour: str, braking: bool) -> None:
    """A body with its windscreen, and red at the back where it brakes."""
    front_left, front_right, rear_right, rear_left = corners
    draw.polygon(view(corners), fill=colour, outline=OUTLINE, width=SMOOTH)
    screen = [
        front + back * (rear - front) + inset * (other - front)
        for front, rear, other, back, inset in (
            (front_left, rear_left, front_right, 0.26, 0.1), (front_right, rear_right, front_left, 0.26, 0.1),
            (front_right, rear_right, front_left, 0.4, 0.16), (front_left, rear_left, front_right, 0.4, 0.16),
        )
    ]  # fmt: skip
    draw.polygon(view(np.array(screen)), fill=WINDSCREEN)
    if braking:
        ahead = (front_left - rear_left) / np.linalg.norm(front_left - rear_left)
        draw.polygon(view(np.array([rear_left, rear_right, rear_right + 0.7 * ahead, rear_left + 0.7 * ahead])), fill=BRAKES)


def font(size: int) -> ImageFont.FreeTypeFont:
    """The sans serif font that comes with matplotlib."""
    return ImageFont.truetype(Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf", SMOOTH * size)


if __name__ == "__main__":
    main()
