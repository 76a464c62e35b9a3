"""The road before a work zone, from a scenario file or from a file that describes the road alone."""

from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import Field

from wzsumo.announced_zone import VERIFIED_SD_M, AnnouncedZone
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.errors import InputError, SpecError
from wzsumo.geography import LocalFrame
from wzsumo.road import Road, RoadSpec
from wzsumo.scenario.scenario import load_scenario
from wzsumo.spec import Spec, parse_spec, read_toml
from wzsumo.units import METRES_PER_FOOT
from wzsumo.work_zone import WorkZoneLayout

# A zone of a plan, set out on the road: between WZDx's verified (15 m) and estimated (150 m). Chosen by us
PLANNED_SD_FT = 200.0
MAX_FIX_DISTANCE_M = 5.0  # a fix farther from the pavement than a GNSS error is not on the road; chosen by us


class AnnouncedSection(Spec):
    """The section [announced]: where the work zone is said to be, in feet along the road from its beginning."""

    start_ft: float = Field(ge=0)  # first device
    end_ft: float = Field(gt=0)  # last device
    start_sd_ft: float = Field(PLANNED_SD_FT, gt=0)  # how well they are known: standard deviations
    end_sd_ft: float = Field(PLANNED_SD_FT, gt=0)


class RoadBefore(Spec):
    """A file that describes the road before the zone, in the frame of the traces, and the announced zone where one is."""

    road: RoadSpec
    announced: AnnouncedSection | None = None


class AnnouncedFile(Spec):
    """A file that describes the announced zone alone."""

    announced: AnnouncedSection


def read_road_spec(path: Path) -> tuple[Road, LocalFrame | None, AnnouncedZone | None]:
    """(the road, the frame of its metres, the announced zone) of a scenario or a file with [road] and [announced].

    A scenario's closed lanes are not taken from it: the traces are to show what is closed.
    """
    content = read_toml(path)
    if "work_zone" in content:
        scenario = load_scenario(path)
        facility = scenario.facility()
        layout = facility.layout
        return layout.road, facility.frame, _reported_zone(layout, source=str(path))
    spec = parse_spec(RoadBefore, content, source=str(path))
    road = spec.road.build()
    return road, spec.road.frame, _zone(spec.announced, road, path) if spec.announced else None


def read_announced(path: Path, road: Road) -> AnnouncedZone:
    """The zone that the section [announced] of a file says to be on the road."""
    content = read_toml(path)
    return _zone(parse_spec(AnnouncedFile, {"announced": content.get("announced")}, source=str(path)).announced, road, path)


def read_map_before(path: Path) -> MapBefore:
    """The road before the zone and the ends of the announced zone, from a scenario or a file with [road] and [announced]."""
    road, _, announced = read_road_spec(path)
    return map_before(road, announced)


def map_before(road: Road, announced: AnnouncedZone | None) -> MapBefore:
    """The road with the ends of the zone on it; a zone that nobody announced may be anywhere on the road."""
    return MapBefore(road=road, announced=announced)


def map_before_of(layout: WorkZoneLayout) -> MapBefore:
    """The road before a zone of our own layout, and where its crew reports it: as exactly as receivers measure."""
    return MapBefore(road=layout.road, announced=_reported_zone(layout, source="layout"))


def _reported_zone(layout: WorkZoneLayout, *, source: str) -> AnnouncedZone:
    return AnnouncedZone(
        start_m=layout.start, end_m=layout.end, start_sd_m=VERIFIED_SD_M, end_sd_m=VERIFIED_SD_M, source=source
    )


def _zone(spec: AnnouncedSection, road: Road, path: Path) -> AnnouncedZone:
    start, end = (at * METRES_PER_FOOT for at in (spec.start_ft, spec.end_ft))
    if not start < end <= road.length:
        raise SpecError(
            f"{path}: announced.start_ft={spec.start_ft:g} and announced.end_ft={spec.end_ft:g} must be in this order and on "
            f"the road, which is {road.length / METRES_PER_FOOT:.0f} ft long"
        )
    return AnnouncedZone(
        start_m=start, end_m=end, start_sd_m=spec.start_sd_ft * METRES_PER_FOOT, end_sd_m=spec.end_sd_ft * METRES_PER_FOOT,
        source=str(path),
    )  # fmt: skip


def check_on_road(traces: pd.DataFrame, before: MapBefore, *, source: str, road_source: str) -> None:
    """Raise InputError where most fixes are off the road, as fixes of another frame are, or most vehicles drive against it."""
    road = before.road
    s, d = road.to_sd(traces[["x_m", "y_m"]].to_numpy())
    on_road = (
        (s > 0)
        & (s < road.length)
        & (d > -road.right_shoulder - MAX_FIX_DISTANCE_M)
        & (d < road.left_edge + MAX_FIX_DISTANCE_M)
    )
    if on_road.mean() < 0.5:
        raise InputError(
            f"{source}: {on_road.sum()} of {len(traces)} fixes lie on the road of {road_source}; traces must be in the road's "
            "frame (where it has no reference_points_m its right edge line begins at (0, 0) and runs along x)"
        )
    in_time = pd.DataFrame({"vehicle_id": traces["vehicle_id"], "s": s}).iloc[np.argsort(traces["time_s"], kind="stable")]
    station = in_time.groupby("vehicle_id")["s"]
    if (station.last() < station.first()).mean() > 0.5:
        raise InputError(
            f"{source}: most vehicles drive against the road of {road_source}; its points must run in their direction of travel"
        )
