"""Three maps from posed scans: raw bird's-eye view, log-odds with carved free space, and the barrier of joined devices.

In the bird's-eye view of Chen et al. 2022 a cell that is not hit is free. The log-odds map tells free cells from unknown ones.
The barrier map keeps what stood there during the whole drive, finds the devices and closes the gaps between neighbours of one
line.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from wzsumo.errors import InputError
from wzsumo.frames import FloatArray, IntArray
from wzsumo.grid import OccupancyGrid, blank_grid
from wzsumo.lidar_mapping import features, registration, smrf
from wzsumo.lidar_mapping.devices import DeviceSpec, find_devices, join_devices, with_barrier
from wzsumo.lidar_mapping.posed_scan import PosedScan, ScanState
from wzsumo.lidar_mapping.votes import Votes, VoteSpec
from wzsumo.spec import Spec


class SlamMapSpec(Spec):
    """How posed scans become maps."""

    min_points: int = Field(default=1, ge=1)  # in an occupied cell of the bird's-eye view; Chen et al. 2022 project every point
    votes: VoteSpec = VoteSpec()
    devices: DeviceSpec = DeviceSpec()


@dataclass(frozen=True, kw_only=True, eq=False)
class SlamMaps:
    """The three maps over the same cells, and the devices that the barrier map is made of."""

    birds_eye: OccupancyGrid  # 1 where hit, 0 elsewhere
    log_odds: OccupancyGrid  # 0.5 where nothing was seen
    barrier: OccupancyGrid
    devices: FloatArray  # (n, 2) [m], centres of the devices found
    links: IntArray  # (m, 2), pairs of joined devices


def build_maps(posed_scans: Iterable[PosedScan], spec: SlamMapSpec, *, cells: OccupancyGrid) -> SlamMaps:
    """All maps over the cells of a grid, whose values are not used, from one pass over the scans, which are not kept."""
    votes = Votes(cells, spec.votes)
    for posed in posed_scans:
        votes.add(posed)
    if votes.scans_added == 0:
        raise InputError("no scans to map; a drive gives one scan a turn of its LiDAR")
    standing = cells.with_p_occupied(votes.p_standing(scans=spec.devices.scans))
    devices = find_devices(votes, spec.devices)
    links = join_devices(devices, max_gap_m=spec.devices.max_gap_m)
    return SlamMaps(
        birds_eye=cells.with_p_occupied(votes.count >= spec.min_points),
        log_odds=cells.with_p_occupied(votes.p_occupied),
        barrier=with_barrier(standing, devices, links, half_width_m=spec.devices.barrier_half_width_m),
        devices=devices,
        links=links,
    )


def compile_kernels() -> None:
    """Compile, or load from the cache, every kernel of LiDAR mapping."""
    smrf.compile_kernels()
    registration.compile_kernels()
    features.compile_kernels()
    pose = np.eye(4)
    cloud, standing = np.array([[1.0, 0.0, 0.0], [1.5, 0.5, 0.5]]), np.array([False, True])
    posed = PosedScan(
        time_s=0.0, pose=pose, dead_reckoned=pose, state=ScanState.FIRST_SCAN, free_directions=0, scale_m=0.0,
        deviation=np.zeros(6), has_gnss=False, cloud=cloud, standing=standing, sensor=np.array([0.0, 0.0, 1.0]),
    )  # fmt: skip
    build_maps([posed], SlamMapSpec(), cells=blank_grid((0.0, 0.0, 2.0, 2.0), resolution=0.2, p_occupied=0.0))
