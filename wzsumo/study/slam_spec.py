"""SlamSpec: what the LiDAR SLAM baseline drives with, sees and maps."""

from wzsumo.lidar_mapping.loam import LoamSpec
from wzsumo.lidar_mapping.slam_map import SlamMapSpec
from wzsumo.sensing.imu import ImuSpec, MappingGnssSpec
from wzsumo.sensing.lidar import LidarSpec
from wzsumo.sensing.scene import SceneSpec
from wzsumo.spec import Spec


class SlamSpec(Spec):
    """One mapping drive: a 128-layer LiDAR, high-precision GNSS and IMU (Chen et al. 2022) through the zone and its traffic."""

    traffic: bool = True  # whether the vehicles of the moment stand in the scans
    scene: SceneSpec = SceneSpec()
    lidar: LidarSpec = LidarSpec()
    imu: ImuSpec = ImuSpec()
    gnss: MappingGnssSpec = MappingGnssSpec()
    loam: LoamSpec = LoamSpec()
    maps: SlamMapSpec = SlamMapSpec()
