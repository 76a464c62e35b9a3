"""The lines that a plan is guided by: nominal lanes where the road is as it was, and what the crowd drove in between."""

from itertools import pairwise

import numpy as np

from wzsumo.crowd_mapping.drivable_area import driven_lines
from wzsumo.frames import FloatArray
from wzsumo.study.mapping_methods import Crowd
from wzsumo.study.site import Site

LINE_STEP_M = 20.0  # on a bend of 300 m radius the chord leaves the arc by 0.17 m


def crowd_guide(crowd: Crowd, *, site: Site) -> FloatArray:
    """Lines (n, 2, 2) [m] for a map of the crowd: nominal lane centres outside the announced zone, driven lines inside."""
    return np.concatenate([nominal_guide(site), driven_lines(crowd.mixture)])


def nominal_guide(site: Site) -> FloatArray:
    """Lines (n, 2, 2) [m] of the lane centres before and after the announced zone."""
    road, layout = site.layout.road, site.layout
    lines = []
    for start, end in ((0.0, layout.start), (layout.end, road.length)):
        stations = np.linspace(start, end, max(2, int(np.ceil((end - start) / LINE_STEP_M)) + 1))
        for lane in range(road.own_lanes):
            points = road.to_xy(stations, np.full_like(stations, road.lane_centre(lane)))
            lines += [np.stack(pair) for pair in pairwise(points)]
    return np.stack(lines)
