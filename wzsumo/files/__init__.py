"""Files that wzsumo reads and writes: traces, ROS maps, layouts, point clouds, results."""
