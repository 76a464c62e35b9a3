"""LocalFrame: metres of a plane with its place on earth.

A frame is a projected coordinate reference system (CRS) and the CRS coordinates of its own (0, 0). Where nothing else is
given it is a transverse Mercator projection around the data (`local_frame`): true to scale within 1.3e-6 up to 10 km from its
origin, north up, with no zone border, in both hemispheres and across the 180th meridian. Longitudes and latitudes are WGS 84
degrees.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

WGS_84 = "EPSG:4326"
ORIGIN_STEP_DEG = 0.01  # origins are whole hundredths of a degree, so that files of one place share a frame; chosen by us
# Lengths of a frame may differ from those on the ground by this: UTM's 0.9996 to 1.001 is metres, Web Mercator is not.
MAX_SCALE_ERROR = 0.0025
MAX_CRS_SHOWN = 120  # letters of a CRS in a message: a PROJ string has fewer, WKT more


@dataclass(frozen=True, kw_only=True)
class LocalFrame:
    """A metric frame: point (x, y) [m] has the coordinates (x, y) + `origin_m` in `crs`, x east and y north.

    `crs` is what PROJ reads: "EPSG:32617", a PROJ string, WKT. Raises SpecError where it is none, or not in metres that are
    true to scale.
    """

    crs: str
    origin_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        crs = read_crs(self.crs)
        units = {axis.unit_conversion_factor for axis in crs.axis_info[:2]}
        if not crs.is_projected or units != {1.0}:
            raise SpecError(
                f"crs={self.crs!r} ({crs.name}) must be a projected CRS in metres, such as the UTM zone of the place"
            )

    def to_lonlat(self, points: npt.ArrayLike) -> FloatArray:
        """Longitudes and latitudes (..., 2) [degrees, WGS 84] of points (..., 2) [m]."""
        xy = np.asarray(points, dtype=float)
        return np.stack(self._from_degrees.transform(*self._in_crs(xy), direction="INVERSE"), axis=-1)

    def from_lonlat(self, lonlat: npt.ArrayLike) -> FloatArray:
        """Points (..., 2) [m] of longitudes and latitudes (..., 2) [degrees, WGS 84]; not finite where the CRS has none."""
        degrees = np.asarray(lonlat, dtype=float)
        return np.stack(self._from_degrees.transform(degrees[..., 0], degrees[..., 1]), axis=-1) - self.origin_m

    def north_at(self, point: npt.ArrayLike) -> float:
        """Direction [rad, counter-clockwise from +x] of true north at a point (2,) [m]."""
        lon, lat = self.to_lonlat(np.asarray(point, dtype=float))
        step = self.from_lonlat([lon, lat + 1e-4]) - np.asarray(point, dtype=float)
        return float(np.arctan2(step[1], step[0]))

    def scale_at(self, point: npt.ArrayLike) -> float:
        """Metres of the frame for a metre on the ground, northwards, at a point (2,) [m]."""
        from pyproj import Geod

        lon, lat = self.to_lonlat(np.asarray(point, dtype=float))
        step = self.from_lonlat([lon, lat + 1e-3]) - np.asarray(point, dtype=float)
        return float(np.hypot(*step) / Geod(ellps="WGS84").inv(lon, lat, lon, lat + 1e-3)[2])

    def as_json(self) -> dict[str, Any]:
        """What frame.json says: the CRS, and where the frame's (0, 0) lies in it and on earth."""
        lon, lat = self.to_lonlat((0.0, 0.0))
        return {
            "crs": self.crs,
            "crs_name": self._name,
            "origin_m": list(self.origin_m),
            "origin_lon": float(lon),
            "origin_lat": float(lat),
            "axes": "x east, y north, metres; a point's coordinates in the CRS are (x, y) + origin_m",
        }

    @property
    def _name(self) -> str:
        """The CRS's name, or its projection's where it is a PROJ string without one."""
        operation = self._crs.coordinate_operation
        return self._crs.name if self._crs.name != "unknown" or operation is None else str(operation.method_name)

    def _in_crs(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        return xy[..., 0] + self.origin_m[0], xy[..., 1] + self.origin_m[1]

    @cached_property
    def _crs(self) -> "CRS":
        return read_crs(self.crs)

    @cached_property
    def _from_degrees(self) -> "Transformer":
        return _transformer(WGS_84, self.crs)


def local_frame(lonlat: npt.ArrayLike, *, step_deg: float = ORIGIN_STEP_DEG) -> LocalFrame:
    """The frame around points (n, 2) [degrees]: transverse Mercator, scale 1, with its origin at their middle, rounded.

    The middle is the median of finite points, counted from the first so that points on both sides of 180 degrees lie together.

    >>> local_frame([[-83.7399, 42.2801]]).crs
    '+proj=tmerc +lat_0=42.28 +lon_0=-83.74 +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m +no_defs +type=crs'
    """
    degrees = np.asarray(lonlat, dtype=float).reshape(-1, 2)
    degrees = degrees[np.isfinite(degrees).all(axis=1)]
    turned = wrap_longitude(degrees[:, 0] - degrees[0, 0])
    lon = float(wrap_longitude(degrees[0, 0] + np.median(turned)))
    lat = float(np.median(degrees[:, 1]))
    lon, lat = (round(round(value / step_deg) * step_deg, 9) for value in (lon, lat))
    return LocalFrame(
        crs=f"+proj=tmerc +lat_0={lat:.12g} +lon_0={lon:.12g} +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m +no_defs +type=crs"
    )


def frame_of_crs(crs: str, points: npt.ArrayLike) -> tuple[LocalFrame, FloatArray]:
    """(frame, points (n, 2) [m] in it) of points (n, 2) in the units of any CRS, x or longitude first.

    Where the CRS is in metres and true to scale it stays; else, as for degrees, feet and Web Mercator, a frame around the
    points is taken. Raises SpecError where the CRS is unknown or knows no such points.
    """
    xy = np.asarray(points, dtype=float)
    degrees = lonlat_of_crs(crs, xy)
    try:
        frame = LocalFrame(crs=crs)
    except SpecError:
        frame = local_frame(degrees)
    if abs(frame.scale_at(np.median(frame.from_lonlat(degrees), axis=0)) - 1) > MAX_SCALE_ERROR:
        frame = local_frame(degrees)
    return frame, xy if frame.crs == crs else frame.from_lonlat(degrees)


def lonlat_of_crs(crs: str, points: npt.ArrayLike) -> FloatArray:
    """Longitudes and latitudes (n, 2) [degrees, WGS 84] of points (n, 2) in the units of any CRS, x or longitude first."""
    xy = np.asarray(points, dtype=float)
    read_crs(crs)
    degrees = np.stack(_transformer(WGS_84, crs).transform(xy[..., 0], xy[..., 1], direction="INVERSE"), axis=-1)
    if not np.isfinite(degrees[np.isfinite(xy).all(axis=-1)]).all():
        x, y = xy[~np.isfinite(degrees).all(axis=-1)][0]
        raise SpecError(f"crs={crs!r}: ({x:g}, {y:g}) is no place in it; give the CRS of the coordinates")
    return degrees


def wrap_longitude(degrees: npt.ArrayLike) -> FloatArray:
    """Longitudes in [-180, 180), same shape."""
    return np.asarray(np.mod(np.asarray(degrees, dtype=float) + 180.0, 360.0) - 180.0)


def utm_crs(lon: float, lat: float) -> str:
    """The EPSG code of the UTM zone of a place.

    >>> utm_crs(-83.74, 42.28), utm_crs(151.2, -33.9)
    ('EPSG:32617', 'EPSG:32756')
    """
    zone = min(60, math.floor((float(wrap_longitude(lon)) + 180) / 6) + 1)
    return f"EPSG:{(32600 if lat >= 0 else 32700) + zone}"


def crs_name(crs: str) -> str:
    """A short name of a CRS for a message: itself, or the name within WKT or PROJJSON."""
    return crs if len(crs) <= MAX_CRS_SHOWN else read_crs(crs).name


@lru_cache(maxsize=32)
def read_crs(crs: str) -> "CRS":
    """The CRS that a text names. Raises SpecError where PROJ knows none of that name."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_user_input(crs)
    except CRSError as error:
        why = str(error).split(": ")[-1][:80]
        raise SpecError(
            f"crs={crs!r}: PROJ knows no such coordinate reference system ({why}); give an EPSG code such as "
            '"EPSG:32617", a PROJ string or WKT'
        ) from None


@lru_cache(maxsize=32)
def _transformer(source: str, target: str) -> "Transformer":
    from pyproj import Transformer

    return Transformer.from_crs(read_crs(source), read_crs(target), always_xy=True)
