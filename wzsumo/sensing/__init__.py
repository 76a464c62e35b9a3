"""What vehicles measure: reported traces, LiDAR scans."""
