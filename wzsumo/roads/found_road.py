"""FoundRoad: a stretch of road as a source describes it, and what was taken for what the source leaves open."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.road import Road
from wzsumo.units import METRES_PER_FOOT

# Of freeways: AASHTO, A Policy on Geometric Design (2018), 8.2.4: 10 ft paved on the right, 4 ft on the left of two lanes and
# 10 ft on the left of three or more.
RIGHT_SHOULDER_M = 10 * METRES_PER_FOOT
LEFT_SHOULDER_M = {True: 10 * METRES_PER_FOOT, False: 4 * METRES_PER_FOOT}
LANE_WIDTH_M = 12 * METRES_PER_FOOT  # AASHTO, ibid., freeway lane
FREEWAY_FROM_MPS = 22.0  # 50 mph: slower roads are taken for streets, which have kerbs and no shoulders. Chosen by us
# Of a line against the source's points: the least of these at which its bends are those of a road.
LINE_ERRORS_M = (0.01, 0.03, 0.06, 0.1, 0.15)


@dataclass(frozen=True, kw_only=True)
class LaneCount:
    """Number of lanes of the travel direction from one station to another [m]; `extra` of them are not lanes of the Road.

    `name` is the source's name of that piece.
    """

    start_m: float
    end_m: float
    lanes: int
    extra: int
    name: str


@dataclass(frozen=True, kw_only=True)
class Ramp:
    """Where another road joins or leaves, by station [m] and the source's name."""

    at_m: float
    kind: str  # on-ramp or off-ramp
    name: str


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundRoad:
    """A Road of the lanes that go through, the lane counts along it, ramps, the speed limit, and what was assumed."""

    road: Road
    counts: tuple[LaneCount, ...] = ()
    ramps: tuple[Ramp, ...] = ()
    speed_mps: float | None = None
    assumed: tuple[str, ...] = field(default=())


def road_along(
    line: FloatArray,
    *,
    lane_widths: Sequence[float],
    shoulders: tuple[float, float] | None,
    speed_mps: float | None,
    source: str,
) -> tuple[Road, list[str]]:
    """(the Road whose lanes' middle is a line (n, 2) [m], what was assumed).

    `shoulders` are left and right [m]; where they are None, those of a freeway or of a street by the speed limit are taken. The
    line is simplified as little as a Road needs. Raises SpecError where it bends more sharply than a road.
    """
    if not np.isfinite(line).all():
        raise SpecError(f"{source}: its line goes too far over the earth to be one road")
    assumed = []
    if shoulders is None:
        freeway = speed_mps is None or speed_mps >= FREEWAY_FROM_MPS
        shoulders = (LEFT_SHOULDER_M[len(lane_widths) > 2], RIGHT_SHOULDER_M) if freeway else (0.0, 0.0)
        kind = "a freeway" if freeway else "a street"
        assumed.append(f"shoulders of {shoulders[0]:.2f} m on the left and {shoulders[1]:.2f} m on the right, as of {kind}")
    points = without_repeats(line)
    refused = SpecError("")
    for error in LINE_ERRORS_M:
        thinned = shapely.get_coordinates(shapely.simplify(shapely.LineString(points), error))
        try:
            road = Road(
                reference_line=thinned, lane_widths=tuple(lane_widths), left_shoulder=shoulders[0], right_shoulder=shoulders[1]
            )
        except SpecError as why:
            refused = why
            continue
        if road.strip(0.0, road.length, -road.right_shoulder, road.left_edge).is_valid:
            return road, assumed
        refused = SpecError("the road runs across itself")
    raise SpecError(f"{source}: {refused}; or take a stretch without sharp turns")


def without_repeats(line: FloatArray, *, least_m: float = 0.05) -> FloatArray:
    """The points of a line that are at least a little farther on than the one before."""
    kept = [line[0]]
    for point in line[1:]:
        if np.hypot(*(point - kept[-1])) >= least_m:
            kept.append(point)
    return np.array(kept)
