"""The LaneMap of a zone as it is laid out: what a map of it should show, and lanes to export without any trace."""

import numpy as np

from wzsumo.lane_map import LaneMap, MappedLane
from wzsumo.work_zone import WorkZoneLayout

STATION_STEP_M = 2.0
STRIPS = 12  # across a lane, which close one after the other along its taper; a strip is then a foot wide
P_OPEN, P_CLOSED = 0.99, 0.01  # of ground that is known


def laid_out_lanes(layout: WorkZoneLayout, *, sd_m: float = 0.0) -> LaneMap:
    """The lanes along the stations of a layout, known to a standard deviation [m].

    A lane that goes through has its lines as they are laid out. One that closes or opens keeps its place on the road, and its
    strips are open as far as the line of devices leaves them.
    """
    road = layout.road
    stations = np.linspace(0.0, road.length, max(2, round(road.length / STATION_STEP_M) + 1))
    sd = np.full(len(stations), sd_m)
    own = [lane for lane in layout.lanes if not lane.opposing]
    places = [(lane.index, lane.start <= 0 and lane.end >= road.length) for lane in own]
    lanes = []
    for place in sorted(set(places)):
        index, goes_through = place
        right, left = (np.full(len(stations), edge) for edge in road.lane_span(index))
        p_open = np.full((len(stations), STRIPS), P_CLOSED)
        for lane in (lane for lane, its_place in zip(own, places, strict=True) if its_place == place):
            here = (stations >= lane.start) & (stations <= lane.end)
            near, far = lane.right(stations[here]), lane.left(stations[here])
            if goes_through:
                right[here], left[here] = near, far
            share = (np.arange(STRIPS) + 0.5) / STRIPS
            middle = right[here, None] + share * (left - right)[here, None]
            p_open[here] = np.where((middle > near[:, None]) & (middle < far[:, None]), P_OPEN, P_CLOSED)
        lanes.append(MappedLane(right=right, left=left, right_sd=sd, left_sd=sd, p_open=p_open, n_traces=0))
    lanes.sort(key=lambda lane: float(lane.middle.mean()))
    return LaneMap(axis=road, stations=stations, lanes=tuple(lanes), n_traces=0, first_time_s=0.0, last_time_s=0.0)
