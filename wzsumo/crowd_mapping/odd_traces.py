"""Traces that drove in no lane: half over a line for hundreds of metres, as some do, they tell nothing of where lanes lie.

Taken for lane changes they mislead everybody: half a lane to the left and half a lane more later on are two changes to the
nearest lane, and one of ten traces had the whole map begin a lane too far to the right.
"""

import numpy as np

from wzsumo.crowd_mapping.common_path import CommonPath, without_turning
from wzsumo.frames import FloatArray
from wzsumo.grid import BoolArray

# Root mean square from a trace's lanes, of their width and of what is usual among the traces. Of 3,600 SUMO traces (seeds
# 101-105, errors of 0, 1 and 2 m) 9 are beyond both; the usual is 0.02 to 0.1 m, 0.3 m and 0.5 m.
FAR_SHARE, FAR_TIMES = 0.2, 3.0
MOST_ODD = 0.25  # share of the traces; where more seem to be, it is the lanes that are not understood
BETWEEN_LANES = "drove between lanes, half over a line, for most of its way"


def between_lanes(path: CommonPath, offsets: FloatArray, *, width: float) -> BoolArray:
    """Which traces (n,) drove in no lane, by their offsets (n, stations) [m] and the lanes that the path has them in."""
    rest = without_turning(offsets - width * path.lanes - path.course, sizes=path.sizes, turning=path.turning)
    apart = np.where(np.isfinite(rest), rest - path.levels[:, None], 0.0)
    far = np.sqrt((apart**2).sum(axis=1) / np.maximum(np.isfinite(rest).sum(axis=1), 1))
    odd = far > max(FAR_SHARE * width, FAR_TIMES * float(np.median(far)))
    return np.asarray(odd & (odd.mean() <= MOST_ODD))
