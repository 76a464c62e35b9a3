import numpy as np
import pandas as pd
import pytest

from wzsumo.lidar_mapping.loam import LoamSpec
from wzsumo.lidar_mapping.smrf import ground_mask
from wzsumo.mutcd.spacing import DEVICE_SIZE_M
from wzsumo.road import RoadSpec
from wzsumo.sensing.ground import GroundSpec
from wzsumo.sensing.lidar import Drive, LidarSpec, cast_scan
from wzsumo.sensing.scene import SceneSpec, road_scene
from wzsumo.work_zone import DeviceKind


@pytest.mark.parametrize("kind", [DeviceKind.CONE_28_IN, DeviceKind.CONE_36_IN])
def test_smrf_leaves_points_on_95_percent_of_the_devices_seen_within_60_m(kind: DeviceKind) -> None:
    """Cross slope of 2 %, the paper's elevation threshold of 0.2 m, sixteen scans between two lines of devices."""
    road = RoadSpec(lane_count=3, left_shoulder_ft=12, right_shoulder_ft=10, length_ft=1500).build()
    height, radius = DEVICE_SIZE_M[kind]
    x = np.arange(10.0, 440.0, 12.2)  # 40 ft, the spacing of a 40 mph taper
    lines = [pd.DataFrame({"x_m": x, "y_m": y}) for y in (7.4, -0.5)]
    devices = pd.concat(lines, ignore_index=True).assign(kind=str(kind), height_m=height, radius_m=radius)
    spec = SceneSpec(ground=GroundSpec(grade_pct=1.0, cross_slope_pct=2.0))
    seen = kept = 0
    for seed in (21, 22):
        scene = road_scene(road, devices, spec, seed=seed)
        for place in np.arange(80.0, 380.0, 41.3):
            drive = Drive(time_s=np.array([0.0, 1.0]), poses=np.array([[place, 3.7, 0.0], [place + 10.0, 3.7, 0.0]]))
            scan = cast_scan(scene, drive, LidarSpec(), start_s=0.0, seed=seed)
            near = scan.range_m < 60.0
            standing = ~ground_mask(scan.points[near], LoamSpec().ground)
            number = scan.object_id[near]
            there = np.intersect1d(number, scene.device_id)
            seen += len(there)
            kept += sum(standing[number == device].any() for device in there)
    assert seen >= 300
    assert kept >= 0.95 * seen
