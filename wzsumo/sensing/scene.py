"""The scene of a LiDAR: ground, devices, guardrail, poles and the vehicles of one moment, as solids a ray can meet exactly.

A cone or drum is a frustum of a circular cone about any axis, so that it may also lean or lie; everything else is a box.
"""

from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
import numpy.typing as npt
import pandas as pd
from pydantic import Field, model_validator

from wzsumo.errors import InputError
from wzsumo.frames import FloatArray, IntArray
from wzsumo.road import Road
from wzsumo.sensing.ground import Ground, GroundSpec, ground_of
from wzsumo.spec import Spec
from wzsumo.units import METRES_PER_INCH
from wzsumo.work_zone import WorkZoneLayout

CONE_TOP_RADIUS_M = 1.5 * METRES_PER_INCH  # rounded tip of a 36 in cone, about 3 in wide; makers' drawings
FRUSTUM_COLUMNS = 9  # x, y, z of the foot; unit axis; height; radius at the foot; radius at the top
BOX_COLUMNS = 8  # x, y, z of the centre; half length, half width, half height; cos and sin of the heading
BURIED_M = 0.1  # solids reach this far below the ground, so that no gap opens on a slope
CAR_HEIGHT_M, TRUCK_HEIGHT_M = 1.5, 3.5  # SUMO vClass "passenger" and "trailer" (4.0 with load), docs "Vehicle Type Defaults"
TRUCK_LENGTH_M = 7.0  # SUMO's class "truck" is 7.1 m long, "delivery" 6.5 m, ibid.
CLEARANCE_M = 0.2  # under a vehicle


class DeviceFaults(Spec):
    """Shares of the devices that do not stand as laid out."""

    set_up_every: int = Field(default=1, ge=1)  # of the devices of the layout only every n-th one stands: a sparse set-up
    missing_share: float = Field(default=0.0, ge=0, le=1)  # of those set up, as the shares below
    tilted_share: float = Field(default=0.0, ge=0, le=1)
    lying_share: float = Field(default=0.0, ge=0, le=1)
    tilt_deg: float = Field(default=20.0, gt=0, lt=60)  # how far a tilted device leans; an assumption
    seed: int = Field(default=0, ge=0)  # which ones, and to which side

    @model_validator(mode="after")
    def _shares_leave_no_device_twice(self) -> Self:
        if self.missing_share + self.tilted_share + self.lying_share > 1:
            raise ValueError(
                f"missing_share={self.missing_share} + tilted_share={self.tilted_share} + lying_share={self.lying_share} "
                "must not exceed 1: a device has one fault"
            )
        return self


class SceneSpec(Spec):
    """What stands beside the road, and how the ground is."""

    ground: GroundSpec = GroundSpec()
    faults: DeviceFaults = DeviceFaults()
    guardrail: Literal["none", "left", "right", "both"] = "none"
    guardrail_offset_m: float = Field(default=0.6, ge=0)  # beyond the pavement's edge: 2 ft shy line, AASHTO RDG Table 5-7
    post_spacing_m: float = Field(default=1.905, gt=0)  # 6 ft 3 in, W-beam of the Midwest Guardrail System
    pole_spacing_m: float = Field(
        default=60.0, ge=0
    )  # delineators and sign posts on both verges; 0: none; MUTCD 3G.04: 200..530 ft
    pole_offset_m: float = Field(default=3.0, ge=0)  # beyond the pavement's edge


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Ground and solids in the world frame. Object ids count from 1: frusta first, then boxes; `kinds` names them in order.

    `device_id` (n_devices,) is the object id of each device of the layout, 0 for a missing one.
    """

    ground: Ground
    frusta: FloatArray  # (n, FRUSTUM_COLUMNS)
    boxes: FloatArray  # (m, BOX_COLUMNS)
    kinds: tuple[str, ...]
    device_id: IntArray


def scene_of(layout: WorkZoneLayout, spec: SceneSpec, *, seed: int) -> Scene:
    """The scene of a layout without vehicles; `seed` draws the ground's unevenness, the faults have their own."""
    return road_scene(layout.road, layout.devices, spec, seed=seed)


def road_scene(road: Road, devices: pd.DataFrame, spec: SceneSpec, *, seed: int) -> Scene:
    """The scene of a road with any devices (columns kind, x_m, y_m, height_m, radius_m).

    Those with a length_m above 0, pieces of barrier, are boxes along heading_rad.
    """
    ground = ground_of(road, spec.ground, seed=seed)
    long = devices["length_m"].to_numpy() > 0 if "length_m" in devices else np.zeros(len(devices), dtype=bool)
    standing, kept = _device_frusta(devices[~long], ground, spec.faults)
    walls = _walls(devices[long], ground)
    poles = _poles(road, ground, spec)
    rail = _guardrail(road, ground, spec)
    device_id = np.zeros(len(devices), dtype=np.int64)
    kept = np.flatnonzero(~long)[kept]
    device_id[kept] = np.arange(1, len(kept) + 1)
    device_id[long] = np.arange(1, len(walls) + 1) + len(standing) + len(poles)
    names = devices["kind"].astype(str)
    kinds = (*names.iloc[kept], *["pole"] * len(poles), *names[long], *["guardrail"] * len(rail))
    frusta, boxes = np.vstack([standing, poles]), np.vstack([walls, rail])
    return Scene(ground=ground, frusta=frusta, boxes=boxes, kinds=kinds, device_id=device_id)


def with_vehicles(scene: Scene, vehicles: pd.DataFrame) -> Scene:
    """The scene with boxes for vehicles: x_m, y_m of their CENTRE, heading_rad, length_m, width_m, and height_m where known."""
    needed = ("x_m", "y_m", "heading_rad", "length_m", "width_m")
    missing = [name for name in needed if name not in vehicles.columns]
    if missing:
        raise InputError(f"vehicles: column(s) {', '.join(missing)} missing; a LiDAR scene needs {', '.join(needed)}")
    x, y, heading, length, width = vehicles[list(needed)].to_numpy(dtype=float).T
    height = np.where(length < TRUCK_LENGTH_M, CAR_HEIGHT_M, TRUCK_HEIGHT_M)
    if "height_m" in vehicles.columns:
        height = vehicles["height_m"].to_numpy(dtype=float)
    z = scene.ground.height(np.column_stack([x, y]))
    half = (height - CLEARANCE_M) / 2
    boxes = np.column_stack([x, y, z + CLEARANCE_M + half, length / 2, width / 2, half, np.cos(heading), np.sin(heading)])
    return replace(scene, boxes=np.vstack([scene.boxes, boxes]), kinds=(*scene.kinds, *["vehicle"] * len(boxes)))


def _device_frusta(devices: pd.DataFrame, ground: Ground, faults: DeviceFaults) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """(frusta of the devices that are there, their rows in the table)."""
    n = len(devices)
    rng = np.random.default_rng(faults.seed)
    fate, side = rng.random(n), rng.uniform(-np.pi, np.pi, n)
    missing = (fate < faults.missing_share) | (np.arange(n) % faults.set_up_every > 0)
    lying = ~missing & (fate < faults.missing_share + faults.lying_share)
    tilted = ~missing & ~lying & (fate < faults.missing_share + faults.lying_share + faults.tilted_share)
    xy = devices[["x_m", "y_m"]].to_numpy(dtype=float)
    height, foot = devices["height_m"].to_numpy(dtype=float), devices["radius_m"].to_numpy(dtype=float)
    top = np.where(devices["kind"].astype(str) == "drum", foot, np.minimum(CONE_TOP_RADIUS_M, foot))
    # A lying frustum touches the ground along its side: its axis dips by the half angle of the cone.
    half_angle = np.arctan2(foot - top, height)
    lean = np.where(lying, np.pi / 2 + half_angle, np.where(tilted, np.deg2rad(faults.tilt_deg), 0.0))
    axis = np.column_stack([np.sin(lean) * np.cos(side), np.sin(lean) * np.sin(side), np.cos(lean)])
    lifted = np.where(lying, foot * np.cos(half_angle), np.where(tilted, foot * np.sin(lean), 0.0))
    z = ground.height(xy) + lifted
    frusta = np.column_stack([xy, z, axis, height, foot, top])
    kept = np.flatnonzero(~missing)
    return frusta[kept], kept


def _walls(pieces: pd.DataFrame, ground: Ground) -> FloatArray:
    """Boxes of pieces of barrier, upright and as wide as at their foot."""
    if pieces.empty:
        return np.empty((0, BOX_COLUMNS))
    columns = ["x_m", "y_m", "heading_rad", "length_m", "radius_m", "height_m"]
    x, y, heading, length, half_width, height = pieces[columns].to_numpy(dtype=float).T
    half_height = (height + BURIED_M) / 2
    z = ground.height(np.column_stack([x, y])) + height - half_height
    return np.column_stack([x, y, z, length / 2, half_width, half_height, np.cos(heading), np.sin(heading)])


def _poles(road: Road, ground: Ground, spec: SceneSpec) -> FloatArray:
    if spec.pole_spacing_m == 0:
        return np.empty((0, FRUSTUM_COLUMNS))
    s = np.arange(spec.pole_spacing_m / 2, road.length, spec.pole_spacing_m)
    right = road.to_xy(s, -road.right_shoulder - spec.pole_offset_m)
    left = road.to_xy(s + spec.pole_spacing_m / 3, road.left_edge + spec.pole_offset_m)  # not opposite each other
    xy = np.vstack([right, left])
    size = np.tile([0.0, 0.0, 1.0, 2.1 + BURIED_M, 0.05, 0.05], (len(xy), 1))  # 7 ft to a sign, MUTCD 2A.15; 4 in posts
    return np.column_stack([xy, ground.height(xy) - BURIED_M, size])


def _guardrail(road: Road, ground: Ground, spec: SceneSpec) -> FloatArray:
    """Boxes: one beam and one post a spacing, behind it. W-beam: 312 mm deep, top at 31 in; 8 in blocks; posts 150 mm.

    Source: AASHTO Roadside Design Guide, ch. 5, Midwest Guardrail System.
    """
    boxes = [np.empty((0, BOX_COLUMNS))]
    offsets = {"right": -road.right_shoulder - spec.guardrail_offset_m, "left": road.left_edge + spec.guardrail_offset_m}
    for side in ("right", "left"):
        if spec.guardrail not in {side, "both"}:
            continue
        s = np.arange(0.0, road.length, spec.post_spacing_m)
        ends = road.to_xy(s, np.full_like(s, offsets[side]))
        chord = np.diff(ends, axis=0)
        heading, length = np.arctan2(chord[:, 1], chord[:, 0]), np.hypot(*chord.T)
        middles = (ends[1:] + ends[:-1]) / 2
        rail_top, depth = 31 * METRES_PER_INCH, 0.312
        columns = (np.cos(heading), np.sin(heading))
        size = np.ones(len(middles))
        z = ground.height(middles) + rail_top - depth / 2
        boxes.append(np.column_stack([middles, z, length / 2, 0.04 * size, depth / 2 * size, *columns]))
        post_height = rail_top + BURIED_M
        behind = np.copysign(0.04 + 8 * METRES_PER_INCH + 0.1, offsets[side])
        feet = road.to_xy(s[1:], np.full(len(s) - 1, offsets[side] + behind))
        z = ground.height(feet) - BURIED_M + post_height / 2
        boxes.append(np.column_stack([feet, z, 0.075 * size, 0.1 * size, post_height / 2 * size, *columns]))
    return np.vstack(boxes)
