"""Road: a reference line with arc length, lanes and shoulders, and the conversion between (s, d) and (x, y).

Stations s are measured along the reference line, which runs in the MIDDLE of all lanes, as alignments are surveyed: a zone is
as long on a bend as on a straight. Offsets d count from the RIGHT EDGE LINE, positive to the left; the right shoulder
has d < 0. Lane 0 is the rightmost, as in SUMO.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator
from shapely import Polygon

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray, arc_length, wrap_angle
from wzsumo.geography import LocalFrame
from wzsumo.road_projection import MitredLine, mitred_line, project
from wzsumo.spec import Spec
from wzsumo.units import METRES_PER_FOOT, feet_from_metres

MAX_ROAD_FT = 528_000.0  # 100 miles; a bound on the work that a spec can ask for, chosen by us
MAX_POINTS = 200_000  # of a reference line, ibid.
MAX_CHORD_ERROR_M = 0.005  # between an arc and the polyline that stands for it: a tenth of the finest map cell


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """A quantity that changes piecewise linearly along the road: `offsets` (n,) [m] at `stations` (n,) [m], constant beyond."""

    stations: FloatArray
    offsets: FloatArray

    def __call__(self, s: npt.ArrayLike) -> FloatArray:
        """Values [m] at stations s [m], same shape."""
        return np.asarray(np.interp(np.asarray(s, dtype=float), self.stations, self.offsets))


@dataclass(frozen=True, kw_only=True, eq=False)
class Road:
    """A carriageway: reference line (n, 2) [m] (see the module), lane widths from the right, shoulders [m].

    The leftmost `opposing_lanes` of its lanes are driven against the stations; 0 on a one-way carriageway.
    """

    reference_line: FloatArray
    lane_widths: tuple[float, ...]
    left_shoulder: float
    right_shoulder: float
    opposing_lanes: int = 0

    def __post_init__(self) -> None:
        line = np.asarray(self.reference_line, dtype=float)
        if line.ndim != 2 or line.shape[1] != 2 or len(line) < 2 or not np.isfinite(line).all():
            raise SpecError(f"reference_line of shape {line.shape} must be (n >= 2, 2) finite points")
        if (np.hypot(*np.diff(line, axis=0).T) <= 0).any():
            raise SpecError("reference_line holds the same point twice in a row; remove one of them")
        object.__setattr__(self, "reference_line", line)
        turn = np.abs(wrap_angle(np.diff(self._segment_headings)))
        step = np.minimum(self._segment_lengths[:-1], self._segment_lengths[1:])
        reach = max(self.left_edge - self._middle, self.right_shoulder + self._middle)
        if turn.size and (turn * reach > step).any():
            tightest = float(np.min(step[turn > 0] / turn[turn > 0]))
            raise SpecError(
                f"the road bends with a radius of {tightest:.1f} m ({feet_from_metres(tightest):.0f} ft) at its reference line "
                f"and its pavement reaches {reach:.1f} m to one side of that; bend it with more than {reach:.2f} m "
                f"({feet_from_metres(reach):.1f} ft), or give finer points if it does not bend so sharply"
            )

    @cached_property
    def stations(self) -> FloatArray:
        """Arc length (n,) [m] of the reference points."""
        return arc_length(self.reference_line)

    @property
    def length(self) -> float:
        """Length [m] of the reference line."""
        return float(self.stations[-1])

    @property
    def travelled_width(self) -> float:
        """Width [m] of all lanes together; d of the left edge line."""
        return sum(self.lane_widths)

    @property
    def own_lanes(self) -> int:
        """Number of the lanes that are driven along the stations."""
        return len(self.lane_widths) - self.opposing_lanes

    @property
    def own_width(self) -> float:
        """Width [m] of the lanes that are driven along the stations; d of the line to their left."""
        return sum(self.lane_widths[: self.own_lanes])

    @property
    def left_edge(self) -> float:
        """Lateral offset d [m] of the pavement's left edge; the right edge is at -right_shoulder."""
        return self.travelled_width + self.left_shoulder

    def lane_span(self, lane: int) -> tuple[float, float]:
        """Lateral offsets (right, left) [m] of the two lines of a lane."""
        right = sum(self.lane_widths[:lane])
        return right, right + self.lane_widths[lane]

    def lane_centre(self, lane: int) -> float:
        """Lateral offset d [m] of a lane's centre."""
        return sum(self.lane_span(lane)) / 2

    def to_xy(self, s: npt.ArrayLike, d: npt.ArrayLike) -> FloatArray:
        """World points (..., 2) at stations s and lateral offsets d [m], broadcast together; straight on beyond both ends."""
        station, offset = np.broadcast_arrays(np.asarray(s, dtype=float), np.asarray(d, dtype=float))
        segment = np.clip(np.searchsorted(self.stations, station, side="right") - 1, 0, len(self.stations) - 2)
        share = ((station - self.stations[segment]) / self._segment_lengths[segment])[..., None]
        foot = self.reference_line[segment] + share * (self.reference_line[segment + 1] - self.reference_line[segment])
        normal = self._normals[segment] + share * (self._normals[segment + 1] - self._normals[segment])
        return np.asarray(foot + (offset[..., None] - self._middle) * normal)

    def to_sd(self, points: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Stations and lateral offsets [m] of world points (n, 2): the exact inverse of `to_xy` on and beside the pavement."""
        xy = np.ascontiguousarray(points, dtype=float).reshape(-1, 2)
        station, offset = project(xy, self._mitred_line)
        return station, offset + self._middle

    def heading_at(self, s: npt.ArrayLike) -> FloatArray:
        """Headings [rad] of the reference line at stations s [m], interpolated between the middles of its segments."""
        middles = (self.stations[1:] + self.stations[:-1]) / 2
        return wrap_angle(np.interp(np.asarray(s, dtype=float), middles, np.unwrap(self._segment_headings)))

    def strip(self, start: float, end: float, right: Profile | float, left: Profile | float) -> Polygon:
        """Polygon between two lateral offsets (constant or changing with s) from station `start` to `end` [m]."""
        breaks = [p.stations for p in (right, left) if isinstance(p, Profile)]
        s = np.unique(np.concatenate([[start, end], self.stations, *breaks]))
        s = s[(s >= start) & (s <= end)]
        sides = [self.to_xy(s, p(s) if isinstance(p, Profile) else np.full_like(s, p)) for p in (right, left)]
        return Polygon(np.vstack([sides[0], sides[1][::-1]]))

    @property
    def _middle(self) -> float:
        return self.travelled_width / 2

    @cached_property
    def _mitred_line(self) -> MitredLine:
        return mitred_line(self.reference_line, self._normals)

    @cached_property
    def _segment_lengths(self) -> FloatArray:
        return np.hypot(*np.diff(self.reference_line, axis=0).T)

    @cached_property
    def _segment_headings(self) -> FloatArray:
        return np.asarray(np.arctan2(*np.diff(self.reference_line, axis=0).T[::-1]))

    @cached_property
    def _segment_normals(self) -> FloatArray:
        return np.column_stack([-np.sin(self._segment_headings), np.cos(self._segment_headings)])

    @cached_property
    def _normals(self) -> FloatArray:
        """Mitre normals at the points: offset lines run parallel to the segments at exactly their distance d."""
        ends = self._segment_normals[[0, -1]]
        inner = self._segment_normals[:-1] + self._segment_normals[1:]
        inner = inner * (2 / np.einsum("ij,ij->i", inner, inner))[:, None]
        return np.vstack([ends[:1], inner, ends[1:]])


class Bend(Spec):
    """One piece of an alignment: a straight without a radius; positive radius turns left, negative right.

    The radius is that of the middle of all lanes.
    """

    length_ft: float = Field(gt=0, le=MAX_ROAD_FT)  # along the piece
    radius_ft: float | None = None  # of the middle of all lanes; positive turns left; None: a straight
    # A clothoid-like transition from radius_ft (or straight) to this radius, or to a straight; None: the radius stays.
    end_radius_ft: float | Literal["straight"] | None = None

    @model_validator(mode="after")
    def _radii_are_not_zero(self) -> Self:
        for name in ("radius_ft", "end_radius_ft"):
            if getattr(self, name) == 0:
                raise ValueError(f"{name}=0 is no bend; leave it out for a straight")
        return self


class RoadSpec(Spec):
    """The road before the work zone was set up. Lane 0 is the rightmost."""

    lane_count: int = Field(ge=1, le=8)  # in the direction of travel
    opposing_lane_count: int = Field(0, ge=0, le=4)  # to their left, without a median; 0: a divided or one-way road
    lane_width_ft: float = Field(12.0, ge=10, le=16)  # 12 ft: AASHTO Green Book, freeway lane; 10 ft: MUTCD 6G, narrowest
    left_shoulder_ft: float = Field(ge=0, le=30)  # paved; 0: none
    right_shoulder_ft: float = Field(ge=0, le=30)  # paved; 0: none
    length_ft: float | None = Field(None, gt=0, le=MAX_ROAD_FT)  # of a straight road
    alignment: tuple[Bend, ...] = ()  # instead: straights, arcs and transitions
    reference_points_m: tuple[tuple[float, float], ...] = Field(
        (), max_length=MAX_POINTS
    )  # instead: any line, the middle of all lanes, in the direction of travel
    crs: str | None = None  # of reference_points_m, as "EPSG:32617"; None: a road without a place on earth
    origin_m: tuple[float, float] = (0.0, 0.0)  # coordinates in the CRS of the point (0, 0)

    @model_validator(mode="after")
    def _one_alignment(self) -> Self:
        given = [k for k in ("length_ft", "alignment", "reference_points_m") if getattr(self, k)]
        if len(given) != 1:
            raise ValueError(f"give exactly one of length_ft, alignment, reference_points_m (given: {given or 'none'})")
        return self

    @model_validator(mode="after")
    def _crs_is_known(self) -> Self:
        if self.crs is not None:
            try:
                LocalFrame(crs=self.crs, origin_m=self.origin_m)
            except SpecError as error:
                raise ValueError(str(error)) from None
        return self

    @property
    def frame(self) -> LocalFrame | None:
        """The place of the road's metres on earth; None where it has none."""
        return None if self.crs is None else LocalFrame(crs=self.crs, origin_m=self.origin_m)

    def build(self) -> Road:
        """The Road in metres.

        Where no points are given its right edge line begins at (0, 0), and x runs along the first straight.
        """
        lane_widths = (self.lane_width_ft * METRES_PER_FOOT,) * (self.lane_count + self.opposing_lane_count)
        if self.reference_points_m:
            line = np.array(self.reference_points_m, dtype=float)
        else:
            line = _line_of(self.alignment or (Bend(length_ft=self.length_ft or 0.0),))
            line[:, 1] += sum(lane_widths) / 2
        road = Road(
            reference_line=line,
            lane_widths=lane_widths,
            left_shoulder=self.left_shoulder_ft * METRES_PER_FOOT,
            right_shoulder=self.right_shoulder_ft * METRES_PER_FOOT,
            opposing_lanes=self.opposing_lane_count,
        )
        if road.length > MAX_ROAD_FT * METRES_PER_FOOT:
            raise SpecError(
                f"the road is {feet_from_metres(road.length):.0f} ft long, at most {MAX_ROAD_FT:.0f} ft can be modelled"
            )
        if not road.strip(0.0, road.length, -road.right_shoulder, road.left_edge).is_valid:
            raise SpecError(
                f"the road runs across itself within its {road.length:.0f} m; shorten it, or let it turn by less than a circle"
            )
        return road


def _line_of(alignment: tuple[Bend, ...]) -> FloatArray:
    """Points (n, 2) [m] from (0, 0) along +x; curvature constant or changing linearly on each piece."""
    points, heading = [np.zeros((1, 2))], 0.0
    for bend in alignment:
        length = bend.length_ft * METRES_PER_FOOT
        start = 1 / (bend.radius_ft * METRES_PER_FOOT) if bend.radius_ft else 0.0
        end = start if bend.end_radius_ft is None else 0.0
        if isinstance(bend.end_radius_ft, float):
            end = 1 / (bend.end_radius_ft * METRES_PER_FOOT)
        sharpest = max(abs(start), abs(end))
        # Sagitta of a chord c on radius R: c^2 / (8 R).
        chord = np.sqrt(8 * MAX_CHORD_ERROR_M / sharpest) if sharpest else 50.0
        n = max(1, int(np.ceil(length / min(chord, 50.0)))) if length < MAX_POINTS * chord else MAX_POINTS + 1
        if sum(map(len, points)) + n > MAX_POINTS:
            raise SpecError(
                f"alignment: takes more than {MAX_POINTS} points, at the bend of {bend.length_ft:g} ft with radius_ft="
                f"{bend.radius_ft}, end_radius_ft={bend.end_radius_ft}; give larger radii or shorter bends"
            )
        middle = (np.arange(n) + 0.5) / n * length
        headings = heading + start * middle + (end - start) / (2 * length) * middle**2
        # A chord of an arc that turns by a is shorter than the arc by sin(a/2) / (a/2).
        half_turn = (start + (end - start) * middle / length) * length / n / 2
        steps = (length / n * np.sinc(half_turn / np.pi))[:, None] * np.column_stack([np.cos(headings), np.sin(headings)])
        points.append(points[-1][-1] + np.cumsum(steps, axis=0))
        heading += (start + end) / 2 * length
    return np.vstack(points)
