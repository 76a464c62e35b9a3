"""The scene of a LiDAR: ground, devices, guardrail, poles and the vehicles of one moment, as solids of closed form.

Cones, drums and poles are frustums of circular cones about any axis, so that they can also lean or lie. All else is boxes.
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

CONE_TOP_RADIUS_M = 1.5 * METRES_PER_INCH  # tip of a 36 in cone, some 3 in wide; makers' drawings
FRUSTUM_COLUMNS = 9  # x, y, z of the foot; unit axis; height; radius at the foot; radius at the top
BOX_COLUMNS = 8  # x, y, z of the centre; half length, half width, half height; cos and sin of the heading
BURIED_M = 0.1  # that poles, rails and walls reach below the ground, so that no gap opens on a slope
CAR_HEIGHT_M = 1.5  # SUMO docs, "Vehicle Type Defaults", class "passenger"
TRUCK_HEIGHT_M = 3.5  # chosen by us; ibid., class "truck" is 2.4 m high, "trailer" 4.0 m
MIN_TRUCK_LENGTH_M = 7.0  # shorter vehicles are cars; ibid., class "truck" is 7.1 m long, "delivery" 6.5 m
GROUND_CLEARANCE_M = 0.2  # under a vehicle's body; chosen by us
BEAM_HALF_DEPTH_M = 0.04  # of a guardrail's W-beam, which is 3 1/4 in deep; AASHTO M 180
POLE_HEIGHT_M, POLE_RADIUS_M = 2.1, 0.05  # 7 ft to the bottom of a sign, MUTCD 2A.15; 4 in posts


class DeviceFaults(Spec):
    """Which share of the devices does not stand as laid out."""

    set_up_every: int = Field(default=1, ge=1)  # only every n-th device of the layout is set up
    missing_share: float = Field(default=0.0, ge=0, le=1)  # of the devices set up; likewise the shares below
    tilted_share: float = Field(default=0.0, ge=0, le=1)  # lean by tilt_deg
    lying_share: float = Field(default=0.0, ge=0, le=1)  # lie on the ground
    tilt_deg: float = Field(default=20.0, gt=0, lt=60)  # how far a tilted device leans; chosen by us
    seed: int = Field(default=0, ge=0)  # which devices are struck, and the side they lean to

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
    guardrail: Literal["none", "left", "right", "both"] = "none"  # beside the pavement, on which side
    guardrail_offset_m: float = Field(default=0.6, ge=0)  # beyond the pavement's edge: 2 ft shy line, AASHTO RDG Table 5-7
    post_spacing_m: float = Field(default=1.905, gt=0)  # 6 ft 3 in, W-beam of the Midwest Guardrail System
    # Delineators and sign posts on both verges; 0: none. MUTCD 3G.04: 200 to 530 ft.
    pole_spacing_m: float = Field(default=60.0, ge=0)
    pole_offset_m: float = Field(default=3.0, ge=0)  # beyond the pavement's edge; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Ground and solids in the world frame.

    Object ids count from 1, frusta first, then boxes; `kinds` names them in that order. `device_id` (n_devices,) is the object
    id of each device of the layout, 0 for a missing one.
    """

    ground: Ground
    frusta: FloatArray  # (n, FRUSTUM_COLUMNS)
    boxes: FloatArray  # (m, BOX_COLUMNS)
    kinds: tuple[str, ...]
    device_id: IntArray


def scene_of(layout: WorkZoneLayout, spec: SceneSpec, *, seed: int) -> Scene:
    """The scene of a layout without vehicles. `seed` decides the ground's unevenness; faults have their own seed."""
    return road_scene(layout.road, layout.devices, spec, seed=seed)


def road_scene(road: Road, devices: pd.DataFrame, spec: SceneSpec, *, seed: int) -> Scene:
    """The scene of a road with given devices (columns kind, x_m, y_m, height_m, radius_m; length_m and heading_rad for walls).

    Devices with a length_m above 0 are pieces of barrier: boxes along heading_rad. All others are frustums.
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
    """The scene with a box per vehicle: x_m, y_m of its CENTRE, heading_rad, length_m, width_m, height_m where given."""
    needed = ("x_m", "y_m", "heading_rad", "length_m", "width_m")
    missing = [name for name in needed if name not in vehicles.columns]
    if missing:
        raise InputError(f"vehicles: column(s) {', '.join(missing)} missing; a LiDAR scene needs {', '.join(needed)}")
    x, y, heading, length, width = vehicles[list(needed)].to_numpy(dtype=float).T
    height = np.where(length < MIN_TRUCK_LENGTH_M, CAR_HEIGHT_M, TRUCK_HEIGHT_M)
    if "height_m" in vehicles.columns:
        height = vehicles["height_m"].to_numpy(dtype=float)
    z = scene.ground.height(np.column_stack([x, y]))
    half = (height - GROUND_CLEARANCE_M) / 2
    boxes = np.column_stack(
        [x, y, z + GROUND_CLEARANCE_M + half, length / 2, width / 2, half, np.cos(heading), np.sin(heading)]
    )
    return replace(scene, boxes=np.vstack([scene.boxes, boxes]), kinds=(*scene.kinds, *["vehicle"] * len(boxes)))


def _device_frusta(devices: pd.DataFrame, ground: Ground, faults: DeviceFaults) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """(frusta of the devices that are not missing, their rows in the table)."""
    n = len(devices)
    rng = np.random.default_rng(faults.seed)
    fate, side = rng.random(n), rng.uniform(-np.pi, np.pi, n)
    missing = (fate < faults.missing_share) | (np.arange(n) % faults.set_up_every > 0)
    lying = ~missing & (fate < faults.missing_share + faults.lying_share)
    tilted = ~missing & ~lying & (fate < faults.missing_share + faults.lying_share + faults.tilted_share)
    xy = devices[["x_m", "y_m"]].to_numpy(dtype=float)
    height, foot = devices["height_m"].to_numpy(dtype=float), devices["radius_m"].to_numpy(dtype=float)
    top = np.where(devices["kind"].astype(str) == "drum", foot, np.minimum(CONE_TOP_RADIUS_M, foot))
    # A lying frustum touches the ground along its side, so its axis points below the horizontal by the half angle of the cone.
    half_angle = np.arctan2(foot - top, height)
    lean = np.where(lying, np.pi / 2 + half_angle, np.where(tilted, np.deg2rad(faults.tilt_deg), 0.0))
    axis = np.column_stack([np.sin(lean) * np.cos(side), np.sin(lean) * np.sin(side), np.cos(lean)])
    lifted = np.where(lying, foot * np.cos(half_angle), np.where(tilted, foot * np.sin(lean), 0.0))
    z = ground.height(xy) + lifted
    frusta = np.column_stack([xy, z, axis, height, foot, top])
    kept = np.flatnonzero(~missing)
    return frusta[kept], kept


def _walls(pieces: pd.DataFrame, ground: Ground) -> FloatArray:
    """Boxes of pieces of barrier: upright, as wide all the way up as at their foot."""
    if pieces.empty:
        return np.empty((0, BOX_COLUMNS))
    columns = ["x_m", "y_m", "heading_rad", "length_m", "radius_m", "height_m"]
    x, y, heading, length, half_width, height = pieces[columns].to_numpy(dtype=float).T
    half_height = (height + BURIED_M) / 2
    z = ground.height(np.column_stack([x, y])) + height - half_height
    return np.column_stack([x, y, z, length / 2, half_width, half_height, np.cos(heading), np.sin(heading)])


def _poles(road: Road, ground: Ground, spec: SceneSpec) -> FloatArray:
    """Frusta of the poles on both verges; those on the left are shifted by a third of the spacing."""
    if spec.pole_spacing_m == 0:
        return np.empty((0, FRUSTUM_COLUMNS))
    s = np.arange(spec.pole_spacing_m / 2, road.length, spec.pole_spacing_m)
    right = road.to_xy(s, -road.right_shoulder - spec.pole_offset_m)
    left = road.to_xy(s + spec.pole_spacing_m / 3, road.left_edge + spec.pole_offset_m)
    xy = np.vstack([right, left])
    size = np.tile([0.0, 0.0, 1.0, POLE_HEIGHT_M + BURIED_M, POLE_RADIUS_M, POLE_RADIUS_M], (len(xy), 1))
    return np.column_stack([xy, ground.height(xy) - BURIED_M, size])


def _guardrail(road: Road, ground: Ground, spec: SceneSpec) -> FloatArray:
    """Boxes of a guardrail: for each post spacing a piece of beam and, behind it, a post.

    The W-beam is 312 mm high with its top at 31 in; blocks are 8 in deep, posts 150 mm wide and 200 mm deep.
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
        rail_top, beam_height = 31 * METRES_PER_INCH, 0.312
        columns = (np.cos(heading), np.sin(heading))
        size = np.ones(len(middles))
        z = ground.height(middles) + rail_top - beam_height / 2
        boxes.append(np.column_stack([middles, z, length / 2, BEAM_HALF_DEPTH_M * size, beam_height / 2 * size, *columns]))
        post_height = rail_top + BURIED_M
        behind = np.copysign(BEAM_HALF_DEPTH_M + 8 * METRES_PER_INCH + 0.1, offsets[side])
        feet = road.to_xy(s[1:], np.full(len(s) - 1, offsets[side] + behind))
        z = ground.height(feet) - BURIED_M + post_height / 2
        boxes.append(np.column_stack([feet, z, 0.075 * size, 0.1 * size, post_height / 2 * size, *columns]))
    return np.vstack(boxes)
