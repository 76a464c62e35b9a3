"""LiDAR scans -> OccupancyGrid: the baseline of a single mapping car (SMRF, LOAM, bird's-eye view)."""
