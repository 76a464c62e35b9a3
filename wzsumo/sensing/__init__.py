"""What vehicles measure: reported traces, LiDAR scans, and the mapping car's motion readings."""
