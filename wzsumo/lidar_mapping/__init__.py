"""LiDAR scans -> OccupancyGrid: ground filter (SMRF), odometry and mapping (LOAM), maps from bird's-eye view."""
